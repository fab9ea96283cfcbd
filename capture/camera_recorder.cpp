#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "capture/camera_recorder_internal.h"
#include "capture/host_clock.h"
#include "core/error.h"

namespace sole::capture {

CameraRecorder::CameraRecorder(Camera& camera, const CameraSync& sync, const TriggerLog& log,
                               Options options)
    : camera_(camera),
      log_(log),
      options_(std::move(options)),
      file_(options_.path, camera.Config().serial, {.discard = options_.discard}),
      matcher_(sync, options_.period_ns),
      holding_(options_.hold_frames > 0) {
  counts_.serial = camera.Config().serial;
  before_ = camera.Statistics();
  last_arrival_ns_ = HostNowNs();
  writer_ = std::thread([this] { Write(); });
  camera_.SetHandler([this](const CameraFrame& frame) { OnFrame(frame); });
}

CameraRecorder::~CameraRecorder() { Join(); }

void CameraRecorder::Join() {
  if (!writer_.joinable()) return;
  camera_.SetHandler({});
  {
    const std::lock_guard lock(mutex_);
    finishing_ = true;
  }
  changed_.notify_all();
  writer_.join();
}

void CameraRecorder::Release(std::int64_t first_trigger) {
  const std::scoped_lock locks(match_mutex_, mutex_);
  first_trigger_ = first_trigger;
  before_ = camera_.Statistics();
  const std::string serial = counts_.serial;
  counts_ = {};
  counts_.serial = serial;
  latency_sum_s_ = 0;
  std::erase_if(queue_, [&](const Frame& frame) { return frame.header.trigger < first_trigger; });
  arrived_ = static_cast<std::int64_t>(queue_.size());
  holding_ = false;
  changed_.notify_all();
}

void CameraRecorder::Retie(std::optional<std::int64_t> host_minus_device_ns) {
  const std::lock_guard lock(match_mutex_);
  matcher_.Retie(host_minus_device_ns.value_or(0));
  clock_unknown_ = !host_minus_device_ns;
}

int CameraRecorder::Queued() const {
  const std::lock_guard lock(mutex_);
  return static_cast<int>(queue_.size());
}

void CameraRecorder::Finish() {
  Join();
  file_.Close();
}

void CameraRecorder::OnFrame(const CameraFrame& frame) {
  last_arrival_ns_ = frame.host_time_ns;
  const std::lock_guard lock(match_mutex_);
  if (clock_unknown_ && frame.complete) {
    const double latency_s =
        arrived_ > 0 ? latency_sum_s_ / static_cast<double>(arrived_.load()) : 0;
    matcher_.Retie(frame.host_time_ns - std::llround(1e9 * latency_s) -
                   static_cast<std::int64_t>(frame.device_time_ns));
    clock_unknown_ = false;
  }
  const FrameMatch match =
      matcher_.Match(frame.frame_id, frame.device_time_ns, frame.complete, log_);
  const bool fits = frame.width == camera_.Config().width &&
                    frame.height == camera_.Config().height &&
                    frame.pixels.size() == static_cast<std::size_t>(frame.width) *
                                               static_cast<std::size_t>(frame.height);
  if (match.outcome == MatchOutcome::kRepeated || match.outcome == MatchOutcome::kUnknown ||
      !fits) {
    ++counts_.strays;
    return;
  }
  if (match.edge.sequence < first_trigger_) return;
  if (match.outcome == MatchOutcome::kRealigned) ++counts_.realigned;
  (match.id_jump < 0 ? counts_.ids_behind : counts_.ids_ahead) += std::abs(match.id_jump);
  const double latency_s = static_cast<double>(frame.host_time_ns - match.edge.actual_ns) * 1e-9;
  latency_sum_s_ += latency_s;
  counts_.latency_max_s = std::max(counts_.latency_max_s, latency_s);
  ++arrived_;
  if (options_.on_frame) options_.on_frame(frame, match);
  Enqueue(frame, match);
}

void CameraRecorder::Enqueue(const CameraFrame& frame, const FrameMatch& match) {
  const io::RawRecordHeader header{.trigger = match.edge.sequence,
                                   .frame_id = static_cast<std::uint64_t>(frame.frame_id),
                                   .device_time_ns = frame.device_time_ns,
                                   .host_time_ns = frame.host_time_ns,
                                   .width = static_cast<std::uint32_t>(frame.width),
                                   .height = static_cast<std::uint32_t>(frame.height),
                                   .status = frame.complete ? 0U : 1U,
                                   .kind = match.edge.kind};
  {
    const std::lock_guard lock(mutex_);
    if (holding_) {
      while (static_cast<int>(queue_.size()) >= options_.hold_frames) queue_.pop_front();
    } else if (static_cast<int>(queue_.size()) >= options_.hold_frames + options_.queue_frames) {
      ++counts_.dropped;
      return;
    }
    queue_.push_back({header, frame.pixels, frame.hold});
  }
  changed_.notify_one();
}

void CameraRecorder::Write() {
  bool failed = false;
  std::int64_t first = 1;
  for (;;) {
    Frame next;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return finishing_ || (!holding_ && !queue_.empty()); });
      if (holding_ || queue_.empty()) return;
      next = std::move(queue_.front());
      queue_.pop_front();
      first = first_trigger_;  // changes together with holding_, under both locks
    }
    if (!failed) {
      try {
        next.header.trigger -= first - 1;
        const std::uint32_t crc = file_.Append(next.header, next.pixels.data());
        stored_triggers_[next.header.trigger] = next.header.status == 0;
        ++stored_;
        if (options_.on_stored) options_.on_stored(next.header, crc);
      } catch (const std::exception& error) {
        failed = true;  // what still comes is counted as lost
        if (options_.on_failure) options_.on_failure(error.what());
      }
    }
  }
}

CameraRecord CameraRecorder::Result(std::int64_t fired) const {
  CameraRecord record = counts_;
  record.expected = fired;
  for (std::int64_t trigger = 1; trigger <= fired; ++trigger) {
    const auto stored = stored_triggers_.find(trigger);
    if (stored == stored_triggers_.end()) {
      record.lost_triggers.push_back(trigger);
    } else {
      ++(stored->second ? record.good : record.incomplete);
    }
  }
  record.lost = static_cast<std::int64_t>(record.lost_triggers.size());
  const auto arrived = arrived_.load();
  record.latency_mean_s = arrived > 0 ? latency_sum_s_ / static_cast<double>(arrived) : 0;
  const CameraStatistics statistics = camera_.Statistics();
  record.resent_packets = statistics.resent_packets - before_.resent_packets;
  record.missing_packets = statistics.missing_packets - before_.missing_packets;
  record.underruns = statistics.underruns - before_.underruns;
  return record;
}

}  // namespace sole::capture
