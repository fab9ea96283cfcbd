#include "app/scan_person.h"

#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "sim/foot.h"
#include "sim/scan_cloud.h"
#include "sim/true_rig.h"

namespace sole::app {
namespace {

/// A motion and how long it takes, s: the frames are spread over it.
struct MotionKind {
  const char* name;
  double duration_s;
};
constexpr std::array kOnPlate = {MotionKind{"stand", 3.0}, MotionKind{"rock", 3.0},
                                 MotionKind{"walk", 1.0},  MotionKind{"run", 0.6},
                                 MotionKind{"jump", 0.8},  MotionKind{"press", 2.4},
                                 MotionKind{"press", 2.4}};
constexpr std::array kInAir = {MotionKind{"air", 3.0}, MotionKind{"toes", 2.4}};

constexpr int kSequenceFrames = 12;  ///< of a person with many: so many frames show one motion

/// A motion and how many frames of it.
struct Sequence {
  MotionKind kind;
  int frames = 0;
};

/// Motions on the plate and in the air in turn, three in eight of them in the air (of two sequences one),
/// none again before all were shown. Of two sequences the one on the plate has the odd frame.
std::vector<Sequence> DrawSequences(int frames, std::uint64_t person, std::mt19937_64& random) {
  const auto shuffled = [&](auto kinds) {
    for (std::size_t i = kinds.size(); i > 1; --i) std::swap(kinds[i - 1], kinds[random() % i]);
    return kinds;
  };
  const auto on_plate = shuffled(kOnPlate);
  const auto in_air = shuffled(kInAir);
  // A single frame is in the air for every second person.
  if (frames == 1) return {{person % 2 ? in_air[0] : on_plate[0], 1}};
  const int count = std::max(2, frames / kSequenceFrames);
  std::vector<Sequence> sequences;
  std::size_t plates = 0, airs = 0;
  for (int k = 0; k < count; ++k) {
    const bool air = k % 8 == 1 || k % 8 == 4 || k % 8 == 7;
    const int its = (frames * (k + 1) + count - 1) / count - (frames * k + count - 1) / count;
    sequences.push_back({air ? in_air[airs++ % in_air.size()] : on_plate[plates++ % on_plate.size()], its});
  }
  return sequences;
}

/// Grows with every frame.
struct Columns {
  std::vector<float> vertices_m, points_m, sigma_m, angles_rad;
  std::vector<double> time_s, load_n, bones;
  std::vector<int> sequence;
  std::vector<std::int64_t> frame_start{0};
  std::vector<std::uint8_t> contact, pair, normals;
};

io::NpyArray Floats(const std::vector<float>& values, std::vector<std::size_t> shape) {
  return io::Reshaped(io::NpyFrom(values), std::move(shape));
}

io::NpyArray Bytes(const char* dtype, std::vector<std::uint8_t> values,
                   std::vector<std::size_t> shape) {
  return {dtype, std::move(shape), std::move(values)};
}

io::NpyArray Number(double value) {
  return io::Reshaped(io::NpyFrom(std::vector<double>{value}), {});
}

void AddCloud(const PointCloud& cloud, Columns& to) {
  for (std::size_t i = 0; i < cloud.Size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      to.points_m.push_back(cloud.points_m[i][axis]);
      const auto n = static_cast<std::int8_t>(std::lround(127 * cloud.normals[i][axis]));
      to.normals.push_back(static_cast<std::uint8_t>(n));
    }
  }
  to.sigma_m.insert(to.sigma_m.end(), cloud.sigma_m.begin(), cloud.sigma_m.end());
  to.pair.insert(to.pair.end(), cloud.pair.begin(), cloud.pair.end());
  to.frame_start.push_back(static_cast<std::int64_t>(to.sigma_m.size()));
}

void AddTruth(const sim::MotionFrame& frame, const std::vector<sim::JointAxis>& axes, Columns& to) {
  for (const Eigen::Vector3d& v : frame.foot.foot.vertices_m) {
    for (int axis = 0; axis < 3; ++axis) to.vertices_m.push_back(static_cast<float>(v[axis]));
  }
  to.contact.insert(to.contact.end(), frame.foot.contact.begin(), frame.foot.contact.end());
  to.time_s.push_back(frame.time_s);
  to.load_n.push_back(frame.foot.total_load_n);
  for (const sim::JointAxis& axis : axes) {
    const auto found = frame.angles_rad.find(axis.name);
    to.angles_rad.push_back(found == frame.angles_rad.end() ? 0.0f
                                                            : static_cast<float>(found->second));
  }
  for (const Rigid3& motion : frame.foot.foot.world_from_rest) {
    const Eigen::Quaterniond& q = motion.rotation;
    to.bones.insert(to.bones.end(), {q.w(), q.x(), q.y(), q.z(), motion.translation.x(),
                                     motion.translation.y(), motion.translation.z()});
  }
}

std::vector<std::uint8_t> CutVertices() {
  std::vector<std::uint8_t> dark;
  for (const sim::FootMaterial material : sim::FootMaterials())
    dark.push_back(material == sim::FootMaterial::kCut ? 1 : 0);
  return dark;
}

io::Npz Pack(const sim::Subject& subject, std::size_t axes, const std::vector<std::string>& motions,
             Columns c) {
  const std::size_t f = c.time_s.size(), points = c.sigma_m.size(), vertices = c.contact.size() / f,
                    bones = c.bones.size() / (7 * f);
  io::Npz npz;
  npz["format_version"] = io::Reshaped(io::NpyFrom(std::vector<int>{1}), {});
  npz["person"] = io::Reshaped(
      io::NpyFrom(std::vector<std::int64_t>{static_cast<std::int64_t>(subject.seed)}), {});
  npz["sex"] = io::NpyFrom(std::string(subject.sex == sim::Sex::kFemale ? "female" : "male"));
  npz["side"] = io::NpyFrom(std::string(subject.side == Side::kLeft ? "left" : "right"));
  npz["weight_kg"] = Number(subject.weight_kg);
  npz["stature_m"] = Number(subject.stature_m);
  for (const auto& [name, value] : subject.measures_mm) npz["drawn_" + name] = Number(value);
  npz["motion"] = io::NpyFrom(motions);
  npz["sequence"] = io::NpyFrom(c.sequence);
  npz["time_s"] = io::NpyFrom(c.time_s);
  npz["load_n"] = io::NpyFrom(c.load_n);
  npz["angles_rad"] = Floats(c.angles_rad, {f, axes});
  npz["world_from_bone"] = io::Reshaped(io::NpyFrom(c.bones), {f, bones, 7});
  npz["vertices_m"] = Floats(c.vertices_m, {f, vertices, 3});
  npz["contact"] = Bytes("|u1", std::move(c.contact), {f, vertices});
  npz["frame_start"] = io::NpyFrom(c.frame_start);
  npz["points_m"] = Floats(c.points_m, {points, 3});
  npz["normals_127"] = Bytes("|i1", std::move(c.normals), {points, 3});
  npz["sigma_m"] = Floats(c.sigma_m, {points});
  npz["pair"] = Bytes("|u1", std::move(c.pair), {points});
  return npz;
}

}  // namespace

std::optional<PersonScans> MakePersonScans(std::uint64_t seed, const RigConfig& config,
                                           const sim::ScanNoise& noise,
                                           const PersonScansOptions& asked) {
  static const std::vector<std::uint8_t> dark = CutVertices();
  const auto stopped = [&] { return asked.stop != nullptr && *asked.stop; };
  if (stopped()) return {};
  const sim::Subject subject = sim::DrawSubject(seed, {}, asked.population);
  const sim::TrueRig rig = sim::DrawTrueRig(config, seed);
  const std::vector<sim::JointAxis> axes = sim::JointAxes(subject);
  std::mt19937_64 random(seed * 0x9E3779B97F4A7C15ULL + 1);
  const std::vector<Sequence> sequences = DrawSequences(asked.frames, seed, random);
  const std::uint64_t sequence_seed = random();
  Columns columns;
  std::vector<std::string> motions;
  for (std::size_t k = 0; k < sequences.size(); ++k) {
    sim::MotionOptions options;
    options.motion = sequences[k].kind.name;
    options.frames = sequences[k].frames;
    options.seed = seed + k;
    options.mean_load = 0.25 + 0.75 * std::uniform_real_distribution<double>()(random);
    options.rate_hz = options.frames / sequences[k].kind.duration_s;
    // Else all few frames of a step would show its first moment, before the foot has come down.
    options.start_s = std::uniform_real_distribution<double>(0, 1 / options.rate_hz)(random);
    const sim::FootMotion motion = sim::MakeMotion(subject, options);
    for (const sim::MotionFrame& frame : motion.frames) {
      if (stopped()) return {};
      const TriangleMesh mesh{frame.foot.foot.vertices_m, motion.triangles};
      const std::vector<sim::ScanView> views = sim::FindScanViews(config, rig, mesh, dark);
      AddCloud(sim::MakeScanCloud(mesh, views, noise,
                                  {.seed = random(),
                                   .sequence_seed = sequence_seed,
                                   .max_points = static_cast<std::size_t>(asked.points)}),
               columns);
      AddTruth(frame, axes, columns);
      columns.sequence.push_back(static_cast<int>(motions.size()));
    }
    motions.emplace_back(options.motion);
  }
  const auto points = static_cast<std::int64_t>(columns.sigma_m.size());
  return PersonScans{Pack(subject, axes.size(), motions, std::move(columns)), points};
}

}  // namespace sole::app
