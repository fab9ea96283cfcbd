#include "capture/desync.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace sole::capture {
namespace {

constexpr int kMaxShift = 4;
constexpr std::size_t kMinTriggers = 8;
constexpr std::size_t kMinOverlap = 6;
constexpr double kMinRange = 0.25;   // of the movement, relative to its mean
constexpr double kCertain = 0.8;     // correlation at the true shift
constexpr double kBetter = 0.3;      // than without a shift

using Curve = std::vector<double>;

std::optional<double> Correlation(const Curve& a, const Curve& b) {
  if (a.size() < kMinOverlap) return {};
  double ma = 0, mb = 0, saa = 0, sbb = 0, sab = 0;
  const auto n = static_cast<double>(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ma += a[i] / n;
    mb += b[i] / n;
  }
  for (std::size_t i = 0; i < a.size(); ++i) {
    saa += (a[i] - ma) * (a[i] - ma);
    sbb += (b[i] - mb) * (b[i] - mb);
    sab += (a[i] - ma) * (b[i] - mb);
  }
  if (!(saa > 0) || !(sbb > 0)) return {};
  return sab / std::sqrt(saa * sbb);
}

using Motion = std::map<std::int64_t, double>;  ///< trigger -> relative movement

/// Correlation of a camera that lags by `shift` with the others.
std::optional<double> At(int shift, const Motion& camera, const Motion& others) {
  Curve a, b;
  for (const auto& [trigger, value] : camera) {
    const auto other = others.find(trigger - shift);
    if (other == others.end()) continue;
    a.push_back(value);
    b.push_back(other->second);
  }
  return Correlation(a, b);
}

/// Median over the cameras other than `except`.
Motion Consensus(const std::vector<Motion>& cameras, std::size_t except) {
  Motion consensus;
  for (const auto& [trigger, first] : cameras[0]) {
    Curve values;
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      if (c != except) values.push_back(cameras[c].at(trigger));
    }
    std::sort(values.begin(), values.end());
    consensus[trigger] = values[values.size() / 2];
  }
  return consensus;
}

}  // namespace

std::vector<int> ImageShifts(const std::vector<std::map<std::int64_t, double>>& motion) {
  std::vector<int> shifts(motion.size(), 0);
  if (motion.size() < 3) return shifts;
  std::vector<Motion> cameras(motion.size());  // triggers that all have, relative to each mean
  std::vector<double> means(motion.size(), 0);
  for (const auto& [trigger, first] : motion[0]) {
    if (!std::all_of(motion.begin(), motion.end(),
                     [t = trigger](const Motion& camera) { return camera.contains(t); })) {
      continue;
    }
    for (std::size_t c = 0; c < motion.size(); ++c) {
      cameras[c][trigger] = motion[c].at(trigger);
      means[c] += motion[c].at(trigger);
    }
  }
  const auto count = static_cast<double>(cameras[0].size());
  if (cameras[0].size() < kMinTriggers) return shifts;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    if (!(means[c] > 0)) return shifts;
    for (auto& [trigger, value] : cameras[c]) value *= count / means[c];
  }
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const Motion others = Consensus(cameras, c);
    const auto [low, high] =
        std::minmax_element(others.begin(), others.end(),
                            [](const auto& a, const auto& b) { return a.second < b.second; });
    if (high->second - low->second < kMinRange) continue;
    const double in_step = At(0, cameras[c], others).value_or(1);
    double best = std::max(kCertain, in_step + kBetter);
    for (int shift = -kMaxShift; shift <= kMaxShift; ++shift) {
      const double value = At(shift, cameras[c], others).value_or(0);
      if (shift == 0 || value < best) continue;
      best = value;
      shifts[c] = shift;
    }
  }
  return shifts;
}

}  // namespace sole::capture
