#include "sim/step_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include <Eigen/Geometry>

#include "core/error.h"

namespace sole::sim {
namespace {

constexpr double kGravity = 9.81;
constexpr double kRadFromDeg = std::numbers::pi / 180;
constexpr double kLeastLoad = 0.01;  // of body weight; below this the foot is in the air

/// What the foot does at a moment of the step.
enum Channel { kPitch, kAnkle, kToes, kReach, kLoad, kHeight, kForward, kNumChannels };
/// Time (s or share of the cycle), pitch of the hindfoot (deg, heel up negative), dorsiflexion (deg), MTP extension where the toes are
/// not on the ground (deg), how far they reach for it (0 to 1, beyond 1 they push), load (body weights), height of the lowest
/// point in the air (mm), forward shift (mm).
struct Key {
  double at;
  std::array<double, kNumChannels> value;
};

// Joint angles, ground reaction and events as textbooks of gait give them.
constexpr Key kWalk[] = {{-0.12, {14, 2, 18, 0, 0, 26, -70}},      {-0.05, {20, 2, 20, 0, 0, 9, -16}},
                         {0.00, {21, 0, 20, 0, 0.0, 0.2, 0}},      {0.02, {18, -1, 18, 0, 0.30, 0, 0}},
                         {0.06, {8, -5, 10, 0, 0.75, 0, 0}},       {0.10, {0.8, -4, 2, 0.9, 0.95, 0, 0}},
                         {0.15, {0.3, 0, 0, 1, 1.08, 0, 0}},       {0.28, {-0.1, 6, 0, 1, 0.78, 0, 0}},
                         {0.37, {-0.7, 11, 0, 1, 0.98, 0, 0}},     {0.40, {-1.6, 12, 0, 1, 1.05, 0, 0}},
                         {0.45, {-9, 10, 0, 1.05, 1.10, 0, 0}},    {0.50, {-24, 2, 0, 1.2, 0.95, 0, 0}},
                         {0.56, {-53, -12, 48, 1.6, 0.38, 0, 0}},  {0.595, {-68, -17, 50, 2.2, 0.05, 0, 0}},
                         {0.60, {-69, -17, 49, 1, 0, 0.3, 0}},     {0.66, {-60, -14, 20, 0, 0, 14, 45}},
                         {0.75, {-30, -4, 4, 0, 0, 45, 120}},      {0.88, {14, 2, 18, 0, 0, 26, -70}}};
constexpr Key kRun[] = {{-0.10, {4, 0, 14, 0, 0, 50, -150}},    {-0.03, {9, 2, 14, 0, 0, 14, -30}},
                        {0.00, {10, 4, 14, 0, 0, 0.3, 0}},      {0.02, {6, 3, 10, 0, 0.9, 0, 0}},
                        {0.045, {1, 6, 2, 0.9, 1.5, 0, 0}},     {0.10, {-0.8, 16, 0, 1, 2.35, 0, 0}},
                        {0.14, {-4, 17, 0, 1.05, 2.2, 0, 0}},   {0.18, {-20, 6, 0, 1.2, 1.4, 0, 0}},
                        {0.225, {-53, -14, 46, 1.7, 0.45, 0, 0}}, {0.245, {-66, -20, 50, 2.2, 0.04, 0, 0}},
                        {0.25, {-67, -20, 49, 1, 0, 0.5, 0}},   {0.33, {-68, -12, 12, 0, 0, 70, 120}},
                        {0.60, {4, 0, 14, 0, 0, 50, -150}}};
constexpr Key kJump[] = {{-0.20, {-16, -18, 8, 0, 0, 110, 0}},  {-0.05, {-18, -20, 14, 0, 0, 42, 0}},
                         {0.00, {-18, -20, 16, 0, 0, 0.3, 0}},  {0.02, {-13, -14, 14, 0.5, 0.7, 0, 0}},
                         {0.05, {-4, -3, 4, 1, 1.6, 0, 0}},     {0.08, {-0.3, 5, 0, 1, 2.1, 0, 0}},
                         {0.20, {-0.2, 18, 0, 1, 1.2, 0, 0}},   {0.45, {-0.2, 15, 0, 1, 0.45, 0, 0}},
                         {0.80, {0, 4, 0, 1, 0.55, 0, 0}},      {1.10, {0, 0, 0, 1, 0.5, 0, 0}}};

/// A motion's keys; `seconds` is the length of a unit of Key::at.
struct Step {
  const char* name;
  std::span<const Key> keys;
  double seconds;
  bool repeats;
};
constexpr std::array<Step, 3> kSteps = {
    {{"walk", kWalk, 1.1, true}, {"run", kRun, 1.0, true}, {"jump", kJump, 1.0, false}}};

using State = std::array<double, kNumChannels>;

/// Monotone cubic interpolation (Fritsch and Carlson's limits), so no channel overshoots its keys.
State StateAt(std::span<const Key> keys, double at) {
  if (at <= keys.front().at) return keys.front().value;
  if (at >= keys.back().at) return keys.back().value;
  std::size_t k = 0;
  while (keys[k + 1].at <= at) ++k;
  const auto secant = [&](std::size_t i, std::size_t c) {
    return (keys[i + 1].value[c] - keys[i].value[c]) / (keys[i + 1].at - keys[i].at);
  };
  const auto slope = [&](std::size_t i, std::size_t c) {
    if (i == 0 || i + 1 == keys.size()) return 0.0;
    const double a = secant(i - 1, c), b = secant(i, c);
    return a * b <= 0 ? 0.0 : 2 * a * b / (a + b);
  };
  const double width = keys[k + 1].at - keys[k].at, t = (at - keys[k].at) / width;
  State state;
  for (std::size_t c = 0; c < kNumChannels; ++c) {
    const double p = keys[k].value[c], q = keys[k + 1].value[c];
    state[c] = (1 + 2 * t) * (1 - t) * (1 - t) * p + t * (1 - t) * (1 - t) * width * slope(k, c) +
               t * t * (3 - 2 * t) * q - t * t * (1 - t) * width * slope(k + 1, c);
  }
  return state;
}

/// The hindfoot turned about the heel (toes up) or the ball (heel up), so that the part on the ground stays in place.
Rigid3 Pitched(const Subject& subject, double pitch_rad, double forward_m) {
  const double length = -2 * StandingPlacement(subject).translation.y();
  const Eigen::Vector3d pivot(0, (pitch_rad > 0 ? 0.08 : 0.72) * length, 0);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitX()));
  return {turn, pivot - turn * pivot + Eigen::Vector3d(0, forward_m, 0)};
}

/// Blends the toes between their free place and the ground.
void PoseToes(const Subject& subject, const State& state, double load_n, FootPose& pose) {
  const double reach = std::clamp(state[kReach], 0.0, 1.0), push = std::max(state[kReach] - 1, 0.0);
  FootPose grounded = pose;
  if (reach > 0) ReachForGround(subject, {.load_n = load_n}, 0.002 + 0.006 * push, grounded);
  for (int toe = 1; toe <= 5; ++toe) {
    const std::string number = "_" + std::to_string(toe);
    const double free = kRadFromDeg * state[kToes] * (toe == 1 ? 1 : 0.85);
    const auto blend = [&](const std::string& angle, double raised) {
      const auto found = grounded.angles_rad.find(angle);
      const double low = found == grounded.angles_rad.end() ? raised : found->second;
      pose.angles_rad[angle] = reach * low + (1 - reach) * raised;
    };
    blend("mtp" + number + ".dorsiflexion", free);
    if (toe > 1) blend("pip" + number + ".dorsiflexion", -0.3 * free);
  }
}

/// Keeps the record of what was posed within the joints' ranges.
void LimitAngles(const Subject& subject, FootPose& pose) {
  for (const JointAxis& joint : JointAxes(subject)) {
    const auto found = pose.angles_rad.find(joint.name);
    if (found != pose.angles_rad.end()) found->second = std::clamp(found->second, joint.min_rad, joint.max_rad);
  }
}

MotionFrame FrameAt(const Subject& subject, const MotionOptions& options, const State& state, const Rigid3& placement,
                    double time_s) {
  const double load_n = state[kLoad] * subject.weight_kg * kGravity;
  const bool air = state[kLoad] < kLeastLoad;
  FootPose pose;
  pose.world_from_foot = placement * Pitched(subject, kRadFromDeg * state[kPitch], 1e-3 * state[kForward]);
  // The arch gives way under load and is wound up again when the toes are bent at push-off.
  const double wound = std::clamp(-state[kPitch] / 35, 0.0, 1.0);
  LowerArch(std::min(state[kLoad], 1.2) * (1 - wound), pose);
  pose.angles_rad["talocrural.dorsiflexion"] = kRadFromDeg * state[kAnkle];
  if (air) {
    State free = state;
    free[kReach] = 0;
    PoseToes(subject, free, 0, pose);
  } else {
    PoseToes(subject, state, load_n, pose);
  }
  LimitAngles(subject, pose);
  MotionFrame frame{time_s, PressOnPlate(subject, pose, {.load_n = air ? 0 : load_n, .plate = options.plate}), pose.angles_rad};
  if (air) HoldAbovePlate(1e-3 * std::max(state[kHeight], 0.2), frame);
  return frame;
}

const Step* Find(const std::string& name) {
  for (const Step& step : kSteps) {
    if (step.name == name) return &step;
  }
  return nullptr;
}

}  // namespace

bool IsStepMotion(const std::string& name) { return Find(name) != nullptr; }

void HoldAbovePlate(double height_m, MotionFrame& frame) {
  double lowest = 1;
  for (const Eigen::Vector3d& v : frame.foot.foot.vertices_m) lowest = std::min(lowest, v.z());
  const Eigen::Vector3d lift(0, 0, height_m - lowest);
  for (Eigen::Vector3d& v : frame.foot.foot.vertices_m) v += lift;
  for (Rigid3& bone : frame.foot.foot.world_from_rest) bone.translation += lift;
}

std::vector<MotionFrame> MakeStepMotion(const Subject& subject, const MotionOptions& options, const Rigid3& placement,
                                        std::mt19937_64& random) {
  const Step* step = Find(options.motion);
  Require(step != nullptr, "'" + options.motion + "' is not a stepping motion");
  // Nobody walks like the textbook: pace and force differ by a few per cent.
  std::uniform_real_distribution<double> unit(-1, 1);
  const double seconds = step->seconds * (1 + 0.05 * unit(random)), force = 1 + 0.04 * unit(random);
  const double first = step->keys.front().at, period = step->keys.back().at - first;
  std::vector<MotionFrame> frames;
  for (int i = 0; i < options.frames; ++i) {
    const double t = options.start_s + i / options.rate_hz;
    double at = t / seconds;
    if (step->repeats) at = std::fmod(at, period);
    State state = StateAt(step->keys, first + at);
    state[kLoad] *= force;
    frames.push_back(FrameAt(subject, options, state, placement, t));
  }
  return frames;
}

}  // namespace sole::sim
