#include "capture/camera_monitor.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sole::capture {

void ClockFit::Add(std::int64_t host_ns, std::uint64_t device_ns) {
  const std::int64_t offset_ns = static_cast<std::int64_t>(device_ns) - host_ns;
  if (count_++ == 0) {
    first_host_ns_ = host_ns;
    first_offset_ns_ = offset_ns;
  }
  const double x = static_cast<double>(host_ns - first_host_ns_) * 1e-9;
  const double y = static_cast<double>(offset_ns - first_offset_ns_) * 1e-3;
  x_ += x;
  y_ += y;
  xx_ += x * x;
  xy_ += x * y;
  yy_ += y * y;
}

std::optional<ClockRate> ClockFit::Rate() const {
  if (count_ < 5) return {};
  const double n = count_;
  const double sxx = xx_ - x_ * x_ / n, sxy = xy_ - x_ * y_ / n, syy = yy_ - y_ * y_ / n;
  if (!(sxx > 0)) return {};
  const double slope = sxy / sxx;  // microseconds a second
  const double variance = std::max(0.0, syy - slope * sxy) / (n - 2);
  return ClockRate{slope, std::sqrt(variance / sxx), count_};
}

void CameraMonitor::OnFrame(const CameraFrame& frame, const FrameMatch& match) {
  Snapshot now;
  now.latency_s = static_cast<double>(frame.host_time_ns - match.edge.actual_ns) * 1e-9;
  now.residual_s = static_cast<double>(match.residual_ns) * 1e-9;
  ImageSample sample;
  if (frame.complete) sample = SampleImage(frame.width, frame.height, frame.pixels);
  const std::lock_guard lock(mutex_);
  latencies_s_.push_back(static_cast<float>(now.latency_s));
  now.whole_frames = now_.whole_frames;
  now.foot_frames = now_.foot_frames;
  now.foot = now_.foot;
  now.sample = std::move(now_.sample);
  if (frame.complete) {
    clock_.Add(match.edge.actual_ns, frame.device_time_ns);
    ++now.whole_frames;
    now.foot = FootInView(sample);
    now.foot_frames += now.foot ? 1 : 0;
    Last& last = last_[match.edge.kind];
    if (!last.sample.levels.empty()) {
      motion_[match.edge.sequence] = MotionBetween(last.sample, sample);
    }
    last = {match.edge.sequence, sample};
    sample.levels.clear();
    now.sample = std::move(sample);
    if (picture_interval_ns_ > 0 &&
        (picture_.Empty() || frame.host_time_ns >= picture_time_ns_ + picture_interval_ns_)) {
      picture_time_ns_ = frame.host_time_ns;
      picture_.width = frame.width;
      picture_.height = frame.height;
      picture_.pixels.assign(frame.pixels.begin(), frame.pixels.end());
    }
  }
  now_ = std::move(now);
}

void CameraMonitor::RestartClock() {
  const std::lock_guard lock(mutex_);
  clock_ = {};
}

void CameraMonitor::Restart() {
  const std::lock_guard lock(mutex_);
  now_.foot_frames = now_.whole_frames = 0;
  latencies_s_.clear();
  motion_.clear();
}

CameraMonitor::Snapshot CameraMonitor::Now() const {
  const std::lock_guard lock(mutex_);
  return now_;
}

double CameraMonitor::MedianLatencyS() const {
  std::vector<float> values;
  {
    const std::lock_guard lock(mutex_);
    values = latencies_s_;
  }
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return static_cast<double>(*middle);
}

std::optional<ClockRate> CameraMonitor::Clock() const {
  const std::lock_guard lock(mutex_);
  return clock_.Rate();
}

std::map<std::int64_t, double> CameraMonitor::Motion() const {
  const std::lock_guard lock(mutex_);
  return motion_;
}

void CameraMonitor::KeepPictures(double interval_s) {
  const std::lock_guard lock(mutex_);
  picture_interval_ns_ = std::llround(1e9 * interval_s);
}

ImageU8 CameraMonitor::Picture() const {
  const std::lock_guard lock(mutex_);
  return picture_;
}

}  // namespace sole::capture
