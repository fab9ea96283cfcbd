#include "app/live_table.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <mutex>
#include <vector>

#include <fmt/format.h>

namespace sole::app {
namespace {

using Clock = std::chrono::steady_clock;

std::string Duration(double seconds) {
  if (!std::isfinite(seconds) || seconds > 359999) return "-";
  const int whole = std::max(0, static_cast<int>(seconds));
  return whole >= 3600 ? fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60)
                       : fmt::format("{}:{:02}", whole / 60, whole % 60);
}

std::string State(const capture::CameraStatus& camera) {
  if (camera.reconnecting) return "reconnecting";
  if (camera.silent) return "SILENT";
  return camera.foot ? "foot" : "ok";
}

}  // namespace

std::string FormatStatus(const capture::RecordProgress& progress, bool cameras) {
  std::int64_t lost = 0;
  std::uint64_t resent = 0;
  int silent = 0;
  double sync_s = 0;
  for (const capture::CameraStatus& camera : progress.cameras) {
    lost += camera.lost;
    resent += camera.resent_packets;
    silent += camera.silent ? 1 : 0;
    sync_s = std::max(sync_s, std::abs(camera.sync_s));
  }
  std::string text = fmt::format(
      "{} {}{} triggers, {} frames stored, {} missing, {} resent, jitter {:.1f} ms, sync {:.1f} ms, "
      "disk {}{}\n",
      capture::ToString(progress.phase), progress.fired,
      progress.triggers > 0 ? fmt::format(" of {}", progress.triggers) : "", progress.frames, lost,
      resent, 1e3 * progress.trigger_jitter_s, 1e3 * sync_s, Duration(progress.disk_left_s),
      silent > 0 ? fmt::format(", {} CAMERAS SILENT", silent) : "");
  if (!cameras) return text;
  text += fmt::format("{:<12}{:>8}{:>6}{:>8}{:>7}{:>7}{:>7}{:>9}{:>9}  {}\n", "camera", "frames",
                      "lost", "resent", "sat %", "focus", "queue", "late ms", "sync ms", "state");
  for (const capture::CameraStatus& c : progress.cameras) {
    text += fmt::format("{:<12}{:>8}{:>6}{:>8}{:>7.2f}{:>7.2f}{:>7}{:>9.1f}{:>9.2f}  {}\n", c.serial,
                        c.frames, c.lost, c.resent_packets, 100 * c.saturated, c.focus, c.queued,
                        1e3 * c.latency_s, 1e3 * c.sync_s, State(c));
  }
  return text;
}

struct LiveTable::State {
  std::mutex mutex;
  bool terminal = isatty(STDERR_FILENO) != 0;
  int lines = 0;  ///< of the table on the screen
  Clock::time_point next;
  capture::TakePhase phase = capture::TakePhase::kDone;
  std::vector<bool> silent;

  void Clear() {
    if (lines > 0) std::fprintf(stderr, "\x1b[%dA\x1b[J", lines);
    lines = 0;
  }
};

LiveTable::LiveTable() : state_(std::make_unique<State>()) {}
LiveTable::~LiveTable() = default;

void LiveTable::Show(const capture::RecordProgress& progress) {
  const std::lock_guard lock(state_->mutex);
  std::vector<bool> silent;
  for (const auto& camera : progress.cameras) silent.push_back(camera.silent);
  const bool changed = progress.phase != state_->phase || silent != state_->silent;
  const auto now = Clock::now();
  if (!state_->terminal && !changed && now < state_->next) return;
  state_->next = now + std::chrono::seconds(2);
  state_->phase = progress.phase;
  state_->silent = std::move(silent);
  const std::string text = FormatStatus(progress, state_->terminal);
  if (state_->terminal) {
    state_->Clear();
    state_->lines = static_cast<int>(std::count(text.begin(), text.end(), '\n'));
  }
  std::fputs(text.c_str(), stderr);
  std::fflush(stderr);
}

void LiveTable::Say(const std::string& line) {
  const std::lock_guard lock(state_->mutex);
  if (state_->terminal) state_->Clear();
  std::fprintf(stderr, "%s\n", line.c_str());
  std::fflush(stderr);
}

}  // namespace sole::app
