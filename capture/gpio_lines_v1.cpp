// libgpiod 1.x
#include <gpiod.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "capture/gpio_lines_internal.h"
#include "core/error.h"

namespace sole::capture {
namespace {

struct ChipCloser {
  void operator()(gpiod_chip* chip) const { gpiod_chip_close(chip); }
};
using Chip = std::unique_ptr<gpiod_chip, ChipCloser>;

Chip OpenChip(const std::string& path) {
  Chip chip(gpiod_chip_open(path.c_str()));
  Require(chip != nullptr, "cannot open GPIO chip " + path + " (" + std::strerror(errno) +
                               "): check trigger gpio_chip in the rig file, `gpiodetect` lists "
                               "chips");
  return chip;
}

gpiod_line* FindLine(gpiod_chip* chip, const std::string& path, const std::string& name) {
  const unsigned count = gpiod_chip_num_lines(chip);
  const bool number =
      !name.empty() && name.size() < 6 && name.find_first_not_of("0123456789") == std::string::npos;
  gpiod_line* line = nullptr;
  if (!number) {
    line = gpiod_chip_find_line(chip, name.c_str());
  } else if (static_cast<unsigned>(std::stoi(name)) < count) {
    line = gpiod_chip_get_line(chip, static_cast<unsigned>(std::stoi(name)));
  }
  Require(line != nullptr, "GPIO chip " + path + " has no line '" + name + "' (it has " +
                               std::to_string(count) +
                               "): check the lines of [trigger] in the rig file, `gpioinfo` lists "
                               "them");
  return line;
}

}  // namespace

struct GpioOutputs::State {
  ~State() {
    if (requested) gpiod_line_release_bulk(&bulk);
  }
  std::string path;
  Chip chip;
  gpiod_line_bulk bulk{};
  std::vector<int> values;
  bool requested = false;
};

GpioOutputs::GpioOutputs(const std::string& path, const std::vector<std::string>& lines)
    : state_(std::make_unique<State>()) {
  state_->path = path;
  state_->chip = OpenChip(path);
  gpiod_line_bulk_init(&state_->bulk);
  for (const std::string& name : lines) {
    gpiod_line_bulk_add(&state_->bulk, FindLine(state_->chip.get(), path, name));
  }
  state_->values.assign(lines.size(), 0);
  Require(gpiod_line_request_bulk_output(&state_->bulk, "sole", state_->values.data()) == 0,
          "cannot drive line " + lines.front() + " of " + path + " (" + std::strerror(errno) +
              "): `gpioinfo` shows who uses it");
  state_->requested = true;
}

GpioOutputs::~GpioOutputs() = default;

void GpioOutputs::Set(const std::vector<bool>& high) {
  for (std::size_t i = 0; i < high.size(); ++i) state_->values.at(i) = high[i] ? 1 : 0;
  Require(gpiod_line_set_value_bulk(&state_->bulk, state_->values.data()) == 0,
          "cannot set the trigger line of " + state_->path + ": " + std::strerror(errno));
}

struct GpioInput::State {
  ~State() {
    if (line != nullptr) gpiod_line_release(line);
  }
  std::string path;
  Chip chip;
  gpiod_line* line = nullptr;
};

GpioInput::GpioInput(const std::string& path, const std::string& line)
    : state_(std::make_unique<State>()) {
  state_->path = path;
  state_->chip = OpenChip(path);
  gpiod_line* found = FindLine(state_->chip.get(), path, line);
  Require(gpiod_line_request_both_edges_events(found, "sole") == 0,
          "cannot watch line " + line + " of " + path + " (" + std::strerror(errno) +
              "): `gpioinfo` shows who uses it");
  state_->line = found;
}

GpioInput::~GpioInput() = default;

std::vector<GpioEvent> GpioInput::Wait(int timeout_ms) {
  const timespec timeout{timeout_ms / 1000, timeout_ms % 1000 * 1'000'000L};
  const int ready = gpiod_line_event_wait(state_->line, &timeout);
  if (ready == 0 || (ready < 0 && errno == EINTR)) return {};
  std::array<gpiod_line_event, 16> events{};
  const int count = ready < 0 ? -1
                              : gpiod_line_event_read_multiple(
                                    state_->line, events.data(), static_cast<unsigned>(events.size()));
  Require(count >= 0, "cannot read the exposure line of " + state_->path + ": " +
                          std::strerror(errno));
  std::vector<GpioEvent> result;
  for (int i = 0; i < count; ++i) {
    const gpiod_line_event& event = events[static_cast<std::size_t>(i)];
    result.push_back({event.event_type == GPIOD_LINE_EVENT_RISING_EDGE,
                      static_cast<std::int64_t>(event.ts.tv_sec) * 1'000'000'000 + event.ts.tv_nsec});
  }
  return result;
}

}  // namespace sole::capture
