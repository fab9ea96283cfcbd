#include "sim/subject.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <span>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "sim/foot_kinematics.h"
#include "sim/foot_measures.h"
#include "sim/reference_foot.h"
#include "sim/skin_binding.h"
#include "sim/soft_contact.h"
#include "sim/subject_shape.h"
#include "sim/survey.h"

namespace sole::sim {
namespace {

constexpr double kRadFromDeg = std::numbers::pi / 180;

/// Handles that are solved for the survey's first nine columns, in their order, with their ranges.
struct SolvedHandle {
  double ShapeHandles::* handle;
  const char* measure;
  double low, high;
};
constexpr SolvedHandle kSolved[] = {{&ShapeHandles::scale, "footlength", -0.25, 0.30},
                                    {&ShapeHandles::ball_length_mm, "balloffootlength", -12, 14},
                                    {&ShapeHandles::foot_breadth, "footbreadthhorizontal", -0.25, 0.3},
                                    {&ShapeHandles::ball_height, "balloffootcircumference", -0.3, 0.35},
                                    {&ShapeHandles::heel_breadth, "heelbreadth", -0.25, 0.35},
                                    {&ShapeHandles::ankle_front_mm, "heelanklecircumference", -12, 14},
                                    {&ShapeHandles::malleoli_breadth, "bimalleolarbreadth", -0.25, 0.25},
                                    {&ShapeHandles::ankle_height, "lateralmalleolusheight", -0.35, 0.25},
                                    {&ShapeHandles::shank_girth, "anklecircumference", -0.3, 0.35}};
constexpr Eigen::Index kNumSolved = std::size(kSolved);

Eigen::VectorXd SolvedMeasures(std::span<const Eigen::Vector3d> vertices) {
  const std::map<std::string, double> measures = MeasureFoot(vertices, Side::kRight);
  Eigen::VectorXd values(kNumSolved);
  for (Eigen::Index i = 0; i < kNumSolved; ++i) values[i] = measures.at(kSolved[i].measure);
  return values;
}

/// Derivative of the measures by the handles at the mean foot, on carried vertices.
Eigen::MatrixXd MeasureJacobian() {
  const auto measure = [](Eigen::Index handle, double value) {
    ShapeHandles handles;
    handles.*kSolved[handle].handle = value;
    return SolvedMeasures(ShapedPoints(MeanAdultTable(), handles, Binding().shares, ReferenceFoot().vertices));
  };
  Eigen::MatrixXd jacobian(kNumSolved, kNumSolved);
  for (Eigen::Index i = 0; i < kNumSolved; ++i) {
    const double step = 0.2 * kSolved[i].high;
    jacobian.col(i) = (measure(i, step) - measure(i, -step)) / (2 * step);
  }
  return jacobian;
}

/// What standing at half the body weight, as the survey's people did, adds to the unloaded measures (mean foot).
const Eigen::VectorXd& StandingChange() {
  static const Eigen::VectorXd change = [] {
    const Subject mean = MeanSubject();
    const LoadedFoot stood = StandOnPlate(mean, 0.5 * 9.81 * mean.weight_kg);
    return Eigen::VectorXd(SolvedMeasures(stood.foot.vertices_m) - SolvedMeasures(ReferenceFoot().vertices));
  }();
  return change;
}

/// Newton's method with the mean foot's derivatives; the given handles are kept, the solved ones change.
SubjectShape SolveShape(ShapeHandles handles, const Eigen::VectorXd& standing_mm) {
  static const Eigen::MatrixXd jacobian = MeasureJacobian();
  const Eigen::VectorXd target_mm = standing_mm - StandingChange();
  handles.scale = target_mm[0] / SolvedMeasures(ReferenceFoot().vertices)[0] - 1;
  SubjectShape shape = MakeShape(handles);
  for (int i = 0; i < 5; ++i) {
    const double size = 1 + shape.handles.scale;
    const Eigen::VectorXd missing = target_mm - SolvedMeasures(shape.rest);
    if (missing.cwiseAbs().maxCoeff() < 0.2) break;
    Eigen::VectorXd change = jacobian.partialPivLu().solve(missing / size);
    change[0] *= size;
    for (Eigen::Index k = 0; k < kNumSolved; ++k) {
      double& value = handles.*kSolved[k].handle;
      value = std::clamp(value + change[k], kSolved[k].low, kSolved[k].high);
    }
    shape = MakeShape(handles);
  }
  return shape;
}

double Clipped(std::normal_distribution<double> normal, double low, double high, std::mt19937_64& random) {
  return std::clamp(normal(random), low, high);
}

/// The drawn person's habit of foot, before the measures are solved.
ShapeHandles DrawHabit(std::mt19937_64& random, Subject& subject) {
  ShapeHandles handles;
  handles.arch_height_mm = Clipped(std::normal_distribution<double>(0, 3), -7, 7, random);
  subject.hallux_valgus_rad = kRadFromDeg * Clipped(std::normal_distribution<double>(4, 4), -2, 12, random);
  handles.hallux_valgus_rad = subject.hallux_valgus_rad;
  handles.toe_fan_rad = kRadFromDeg * Clipped(std::normal_distribution<double>(0.5, 1.5), -1.5, 4, random);
  subject.second_toe_longest = std::bernoulli_distribution(0.22)(random);
  handles.second_toe_length = subject.second_toe_longest
                                  ? Clipped(std::normal_distribution<double>(0.16, 0.02), 0.13, 0.2, random)
                                  : Clipped(std::normal_distribution<double>(0, 0.04), -0.08, 0.07, random);
  subject.heel_pad_m = 1e-3 * Clipped(std::normal_distribution<double>(17, 1), 15, 19, random);
  return handles;
}

const AnatomyTable& TableOf(const Subject& subject) { return subject.shape->table; }

}  // namespace

Subject MeanSubject(Side side) {
  static const auto shape =
      std::make_shared<const SubjectShape>(SubjectShape{{}, MeanAdultTable(), ReferenceFoot().vertices});
  Subject subject;
  subject.side = side;
  subject.shape = shape;
  subject.measures_mm = MeasureFoot(shape->rest, Side::kRight);
  return subject;
}

Subject DrawSubject(std::uint64_t seed, std::optional<Side> side) {
  std::mt19937_64 random(seed * 2654435761U + 97);
  Subject subject;
  subject.seed = seed;
  const Side drawn = std::bernoulli_distribution(0.5)(random) ? Side::kLeft : Side::kRight;
  subject.side = side.value_or(drawn);
  subject.sex = std::bernoulli_distribution(0.5)(random) ? Sex::kMale : Sex::kFemale;
  const Survey& survey = SurveyOf(subject.sex);
  Eigen::VectorXd person = DrawFromSurvey(survey, random);
  ShapeHandles handles = DrawHabit(random, subject);
  // The two feet differ by about half a per cent.
  std::mt19937_64 own(seed * 2654435761U + (subject.side == Side::kLeft ? 11 : 7));
  std::normal_distribution<double> asymmetry(1, 0.004);
  for (Eigen::Index i = 0; i < kNumSolved; ++i) person[i] *= asymmetry(own);
  for (std::size_t i = 0; i < survey.columns.size(); ++i) {
    const double value = person[static_cast<Eigen::Index>(i)];
    if (survey.columns[i] == "stature") subject.stature_m = 1e-3 * value;
    else if (survey.columns[i] == "weightkg") subject.weight_kg = value;
    else subject.measures_mm[survey.columns[i]] = value;
  }
  subject.shape = std::make_shared<const SubjectShape>(SolveShape(handles, person.head(kNumSolved)));
  return subject;
}

TriangleMesh SubjectRestMesh(const Subject& subject) {
  TriangleMesh mesh{subject.shape->rest, FootTriangles(subject.side)};
  if (subject.side == Side::kLeft) {
    for (Eigen::Vector3d& v : mesh.vertices) v = Mirrored(v);
  }
  return mesh;
}

std::vector<JointAxis> JointAxes(const Subject& subject) {
  const AnatomyTable& table = TableOf(subject);
  const bool left = subject.side == Side::kLeft;
  std::vector<JointAxis> joints;
  for (const AnatomyBone& bone : table.bones) {
    for (const AnatomyAxis& axis : bone.axes) {
      const std::string name = AngleName(bone, axis);
      const auto same = [&](const JointAxis& joint) { return joint.name == name; };
      if (std::any_of(joints.begin(), joints.end(), same)) continue;
      const Eigen::Vector3d turned = left ? Eigen::Vector3d(-Mirrored(axis.axis)) : axis.axis;
      joints.push_back({name, bone.name, table.bones[static_cast<std::size_t>(bone.parent)].name,
                        left ? Mirrored(bone.joint_centre) : bone.joint_centre, turned, axis.min_rad, axis.max_rad});
    }
  }
  return joints;
}

std::vector<BoneInfo> Bones(const Subject& subject) {
  const AnatomyTable& table = TableOf(subject);
  const auto place = [&](const Eigen::Vector3d& p) { return subject.side == Side::kLeft ? Mirrored(p) : p; };
  std::vector<BoneInfo> bones;
  for (const AnatomyBone& bone : table.bones) {
    bones.push_back({bone.name, bone.parent < 0 ? "" : table.bones[static_cast<std::size_t>(bone.parent)].name,
                     place(bone.proximal), place(bone.distal), place(bone.joint_centre)});
  }
  return bones;
}

const Eigen::MatrixXf& BoneShares() { return Binding().shares; }

}  // namespace sole::sim
