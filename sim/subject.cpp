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
                                    {&ShapeHandles::ankle_front_mm, "heelanklecircumference", -14, 18},
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

/// Measures of the mean foot where the handles carry it, before it is settled on the skin.
Eigen::VectorXd CarriedMeasures(const ShapeHandles& handles) {
  return SolvedMeasures(ShapedPoints(MeanAdultTable(), handles, Binding().shares, ReferenceFoot().vertices));
}

/// Derivative of the measures by the handles at the mean foot, on carried vertices.
Eigen::MatrixXd MeasureJacobian() {
  const auto measure = [](Eigen::Index handle, double value) {
    ShapeHandles handles;
    handles.*kSolved[handle].handle = value;
    return CarriedMeasures(handles);
  };
  Eigen::MatrixXd jacobian(kNumSolved, kNumSolved);
  for (Eigen::Index i = 0; i < kNumSolved; ++i) {
    const double step = 0.2 * kSolved[i].high;
    jacobian.col(i) = (measure(i, step) - measure(i, -step)) / (2 * step);
  }
  return jacobian;
}

/// Measures standing at half the body weight, as the survey's people did.
Eigen::VectorXd StandingMeasures(const Subject& subject) {
  Subject right = subject;
  right.side = Side::kRight;
  return SolvedMeasures(StandOnPlate(right, 0.5 * 9.81 * right.weight_kg).foot.vertices_m);
}

/// What settling on the skin and standing add to the carried measures of the mean foot.
const Eigen::VectorXd& StandingChange() {
  static const Eigen::VectorXd change = StandingMeasures(MeanSubject()) - CarriedMeasures({});
  return change;
}

/// A step of Newton's method with the mean foot's derivatives towards what is missing, within the handles' ranges.
ShapeHandles Stepped(const ShapeHandles& handles, const Eigen::VectorXd& missing_mm) {
  static const Eigen::PartialPivLU<Eigen::MatrixXd> jacobian(MeasureJacobian());
  const double size = 1 + handles.scale;
  Eigen::VectorXd change = jacobian.solve(missing_mm / size);
  change[0] *= size;
  ShapeHandles next = handles;
  for (Eigen::Index k = 0; k < kNumSolved; ++k) {
    double& value = next.*kSolved[k].handle;
    value = std::clamp(value + change[k], kSolved[k].low, kSolved[k].high);
  }
  return next;
}

/// Solves the handles for measures on carried vertices, which costs little; the handles that are not solved stay.
void SolveCarried(const Eigen::VectorXd& carried_mm, ShapeHandles& handles) {
  Eigen::VectorXd missing = carried_mm - CarriedMeasures(handles);
  double share = 1;
  for (int i = 0; i < 12 && share > 0.05 && missing.cwiseAbs().maxCoeff() > 0.1; ++i) {
    const ShapeHandles next = Stepped(handles, share * missing);
    const Eigen::VectorXd next_missing = carried_mm - CarriedMeasures(next);
    const bool better = next_missing.norm() < missing.norm();
    share = better ? std::min(1.0, 2 * share) : 0.5 * share;
    if (!better) continue;
    handles = next;
    missing = next_missing;
  }
}

/// Solves the subject's shape for what it shall measure standing: first on carried vertices, then on the standing foot.
void SolveShape(ShapeHandles handles, const Eigen::VectorXd& standing_mm, Subject& subject) {
  constexpr int kPasses = 5;
  constexpr double kClose = 0.8;  // mm
  handles.scale = standing_mm[0] / CarriedMeasures({})[0] - 1;
  SolveCarried(standing_mm - StandingChange(), handles);
  Eigen::VectorXd missing;
  std::shared_ptr<const SubjectShape> best;
  double share = 1;
  for (int pass = 0; pass < kPasses; ++pass) {
    const ShapeHandles next = pass == 0 ? handles : Stepped(handles, share * missing);
    subject.shape = std::make_shared<const SubjectShape>(MakeShape(next));
    const Eigen::VectorXd next_missing = standing_mm - StandingMeasures(subject);
    if (pass > 0 && next_missing.norm() >= missing.norm()) {
      share *= 0.4;
      continue;
    }
    handles = next;
    missing = next_missing;
    best = subject.shape;
    if (missing.cwiseAbs().maxCoeff() < kClose) break;
  }
  subject.shape = best;
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
  SolveShape(handles, person.head(kNumSolved), subject);
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
