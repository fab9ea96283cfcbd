#include "sim/motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Geometry>

#include "core/error.h"
#include "sim/reference_foot.h"
#include "sim/step_motion.h"

namespace sole::sim {
namespace {

constexpr double kGravity = 9.81;

/// A slow wave in [-1, 1]: two sines of unrelated periods and drawn phases.
class Wave {
 public:
  Wave(double period_s, std::mt19937_64& random) : period_s_(period_s) {
    std::uniform_real_distribution<double> phase(0, 2 * std::numbers::pi);
    phase_a_ = phase(random);
    phase_b_ = phase(random);
  }
  double At(double time_s) const {
    const double turn = 2 * std::numbers::pi * time_s / period_s_;
    return 0.65 * std::sin(turn + phase_a_) + 0.35 * std::sin(2.37 * turn + phase_b_);
  }

 private:
  double period_s_, phase_a_ = 0, phase_b_ = 0;
};

/// Where this motion's foot stands: a few millimetres and degrees off what the options say.
Rigid3 DrawPlacement(const Subject& subject, const MotionOptions& options, std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(-1, 1);
  const Eigen::AngleAxisd yaw(options.heading_rad + 0.07 * unit(random), Eigen::Vector3d::UnitZ());
  Rigid3 placement;
  placement.rotation = yaw;
  placement.translation = {options.offset_m.x() + 0.006 * unit(random), options.offset_m.y() + 0.006 * unit(random), 0};
  return placement * StandingPlacement(subject);
}

MotionFrame Pressed(const Subject& subject, const FootPose& pose, const ContactOptions& contact, double time_s) {
  return {time_s, PressOnPlate(subject, pose, contact), pose.angles_rad};
}

std::vector<MotionFrame> Stand(const Subject& subject, const MotionOptions& options, std::mt19937_64& random) {
  const Rigid3 placement = DrawPlacement(subject, options, random);
  const Wave load(2.3, random), forward(1.9, random), ankle(3.1, random), lean(2.7, random);
  std::vector<MotionFrame> frames;
  for (int i = 0; i < options.frames; ++i) {
    const double t = options.start_s + i / options.rate_hz;
    const double load_n = options.mean_load * subject.weight_kg * kGravity * (1 + 0.06 * load.At(t));
    const double centre = 0.42 + 0.03 * forward.At(t);
    FootPose pose = LoadedStandingPose(subject, load_n, centre);
    pose.world_from_foot = placement;
    pose.angles_rad["talocrural.dorsiflexion"] += 0.017 * ankle.At(t);
    pose.angles_rad["subtalar.inversion"] += 0.012 * lean.At(t);
    frames.push_back(Pressed(subject, pose,
                             {.load_n = load_n, .pressure_centre_y = centre, .plate = options.plate}, t));
  }
  return frames;
}

std::vector<MotionFrame> Rock(const Subject& subject, const MotionOptions& options, std::mt19937_64& random) {
  const Rigid3 placement = DrawPlacement(subject, options, random);
  const Wave load(2.9, random);
  std::vector<MotionFrame> frames;
  for (int i = 0; i < options.frames; ++i) {
    const double t = options.start_s + i / options.rate_hz;
    // Heel at the start and the end, forefoot in the middle.
    const double phase = t * options.rate_hz / std::max(options.frames - 1, 1);
    const double forward = 0.5 - 0.5 * std::cos(2 * std::numbers::pi * phase);
    const double load_n = options.mean_load * subject.weight_kg * kGravity * (1 + 0.04 * load.At(t));
    const double centre = 0.22 + 0.44 * forward;
    FootPose pose = LoadedStandingPose(subject, load_n, centre);
    pose.world_from_foot = placement;
    pose.angles_rad["talocrural.dorsiflexion"] += 0.14 * (forward - 0.4);
    frames.push_back(Pressed(subject, pose,
                             {.load_n = load_n, .pressure_centre_y = centre, .plate = options.plate}, t));
  }
  return frames;
}

/// The foot as it would stand under a drawn load, its joints held: lowered onto the plate, loaded there by
/// a weight that wanders between heel and ball and from side to side, and lifted off again, so that one pose
/// is seen with every contact.
std::vector<MotionFrame> Press(const Subject& subject, const MotionOptions& options,
                               std::mt19937_64& random) {
  constexpr double kPeriod = 2.4;   // seconds from one moment highest above the plate to the next
  constexpr double kHighest = 0.008, kLowest = 2e-4;  // metres above the plate
  constexpr double kInAir = 0.2;    // of the way from there to the full load
  constexpr double kForward = 0.16, kAside = 0.006;   // the weight's way: of the foot's length, metres
  const Rigid3 placement = DrawPlacement(subject, options, random);
  std::uniform_real_distribution<double> unit(0, 1), both(-1, 1);
  const double weight_n = subject.weight_kg * kGravity, held_n = unit(random) * weight_n;
  const double centre = 0.38 + 0.08 * unit(random), phase = 0.15 * both(random);
  FootPose pose = LoadedStandingPose(subject, held_n, centre);
  pose.world_from_foot = placement;
  const ContactOptions standing{.load_n = std::max(held_n, 0.1 * weight_n), .pressure_centre_y = centre};
  const std::vector<BoneInfo> bones = Bones(subject);
  const auto fixed = std::find_if(bones.begin(), bones.end(),
                                  [&](const BoneInfo& bone) { return bone.name == pose.fixed_bone; });
  const LoadedFoot stood = PressOnPlate(subject, pose, standing);
  pose.world_from_foot = stood.foot.world_from_rest.at(static_cast<std::size_t>(fixed - bones.begin()));
  const Eigen::Quaterniond tilt = Eigen::AngleAxisd(0.05 * both(random), Eigen::Vector3d::UnitX()) *
                                  Eigen::AngleAxisd(0.03 * both(random), Eigen::Vector3d::UnitY());
  const Wave ankle(3.1, random), lean(2.7, random), forward(1.3, random), aside(1.7, random);
  const FootPose held = pose;
  std::vector<MotionFrame> frames;
  for (int i = 0; i < options.frames; ++i) {
    const double t = options.start_s + i / options.rate_hz;
    const double way = 0.5 - 0.5 * std::cos(2 * std::numbers::pi * (t / kPeriod + phase));
    pose = held;
    pose.angles_rad["talocrural.dorsiflexion"] += 0.01 * ankle.At(t);
    pose.angles_rad["subtalar.inversion"] += 0.01 * lean.At(t);
    if (way < kInAir) {
      pose.world_from_foot = Rigid3{tilt, Eigen::Vector3d::Zero()} * pose.world_from_foot;
      MotionFrame frame = Pressed(subject, pose, {}, t);
      HoldAbovePlate(kLowest + (kHighest - kLowest) * (1 - way / kInAir), frame);
      frames.push_back(std::move(frame));
      continue;
    }
    const double share = std::pow((way - kInAir) / (1 - kInAir), 1.5);
    frames.push_back(Pressed(subject, pose,
                             {.load_n = std::max(0.02, options.mean_load * share) * weight_n,
                              .pressure_centre_y = centre + kForward * forward.At(t),
                              .pressure_centre_x_m = stood.pressure_centre_m.x() + kAside * aside.At(t),
                              .plate = options.plate}, t));
  }
  return frames;
}

std::vector<MotionFrame> Air(const Subject& subject, const MotionOptions& options, std::mt19937_64& random) {
  const Rigid3 placement = DrawPlacement(subject, options, random);
  const Wave height(2.1, random), ankle(1.7, random), turn(2.3, random), hallux(1.3, random), toes(1.1, random);
  std::vector<MotionFrame> frames;
  for (int i = 0; i < options.frames; ++i) {
    const double t = options.start_s + i / options.rate_hz;
    FootPose pose;
    pose.fixed_bone = "tibia";
    pose.world_from_foot = placement;
    pose.angles_rad["talocrural.dorsiflexion"] = -0.12 + 0.2 * ankle.At(t);
    pose.angles_rad["subtalar.inversion"] = 0.05 + 0.1 * turn.At(t);
    pose.angles_rad["mtp_1.dorsiflexion"] = 0.35 * hallux.At(t);
    pose.angles_rad["ip_1.dorsiflexion"] = -0.15 + 0.15 * hallux.At(t);
    for (int toe = 2; toe <= 5; ++toe) {
      const std::string number = "_" + std::to_string(toe);
      pose.angles_rad["mtp" + number + ".dorsiflexion"] = 0.3 * toes.At(t - 0.05 * toe);
      pose.angles_rad["pip" + number + ".dorsiflexion"] = -0.2 + 0.2 * toes.At(t + 0.1);
    }
    MotionFrame frame = Pressed(subject, pose, {}, t);
    HoldAbovePlate(0.04 + 0.02 * height.At(t), frame);
    frames.push_back(std::move(frame));
  }
  return frames;
}

/// Curls, then spreads the toes, over and over; the heel stays where it is.
std::vector<MotionFrame> Toes(const Subject& subject, const MotionOptions& options, std::mt19937_64& random) {
  constexpr double kPeriod = 2.4;  // seconds for a curl and a spread
  constexpr double kHeel = 0.045;  // room for the curled toes
  Rigid3 placement = DrawPlacement(subject, options, random);
  placement.translation.z() += kHeel;
  std::uniform_real_distribution<double> unit(-1, 1);
  const double strength = 1 + 0.1 * unit(random);
  std::vector<MotionFrame> frames;
  for (int i = 0; i < options.frames; ++i) {
    const double t = options.start_s + i / options.rate_hz;
    const double wave = std::sin(2 * std::numbers::pi * t / kPeriod);
    const double curl = strength * std::max(wave, 0.0), spread = strength * std::max(-wave, 0.0);
    FootPose pose;
    pose.world_from_foot = placement;
    for (int toe = 1; toe <= 5; ++toe) {
      const std::string number = "_" + std::to_string(toe);
      const double late = 1 - 0.06 * (toe - 1);
      pose.angles_rad["mtp" + number + ".dorsiflexion"] = -0.25 * late * curl + 0.12 * spread;
      pose.angles_rad["mtp" + number + ".abduction"] = (toe == 1 ? 0.12 : -0.05 * (toe - 2)) * spread;
      if (toe == 1) {
        pose.angles_rad["ip_1.dorsiflexion"] = -0.5 * curl;
        continue;
      }
      pose.angles_rad["pip" + number + ".dorsiflexion"] = -0.6 * late * curl;
      pose.angles_rad["dip" + number + ".dorsiflexion"] = -0.35 * late * curl;
    }
    frames.push_back(Pressed(subject, pose, {}, t));
  }
  return frames;
}

}  // namespace

const std::vector<std::string>& MotionNames() {
  static const std::vector<std::string> names = {"stand", "rock", "walk", "run", "jump", "press", "air", "toes"};
  return names;
}

std::string MotionList() {
  const std::vector<std::string>& names = MotionNames();
  std::string list = names.front();
  for (std::size_t i = 1; i < names.size(); ++i) list += (i + 1 < names.size() ? ", " : " or ") + names[i];
  return list;
}

FootMotion MakeMotion(const Subject& subject, const MotionOptions& options) {
  Require(options.frames > 0 && options.rate_hz > 0 && options.mean_load > 0 && options.mean_load <= 1.5,
          "motion: frames and rate must be positive and the load between 0 and 1.5 body weights");
  Require(options.offset_m.allFinite() && std::isfinite(options.heading_rad), "motion: offset and heading must be finite");
  std::mt19937_64 random(options.seed * 7919 + subject.seed);
  FootMotion motion;
  motion.triangles = FootTriangles(subject.side);
  if (options.motion == "stand") motion.frames = Stand(subject, options, random);
  else if (options.motion == "rock") motion.frames = Rock(subject, options, random);
  else if (options.motion == "press") motion.frames = Press(subject, options, random);
  else if (options.motion == "air") motion.frames = Air(subject, options, random);
  else if (options.motion == "toes") motion.frames = Toes(subject, options, random);
  else if (IsStepMotion(options.motion)) {
    const Rigid3 placement = DrawPlacement(subject, options, random);
    motion.frames = MakeStepMotion(subject, options, placement, random);
  } else throw Error("unknown motion '" + options.motion + "': use " + MotionList());
  return motion;
}

}  // namespace sole::sim
