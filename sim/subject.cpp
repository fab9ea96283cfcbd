#include "sim/subject.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Geometry>

#include "sim/foot_kinematics.h"
#include "sim/foot_measures.h"
#include "sim/reference_foot.h"
#include "sim/shape_solver.h"
#include "sim/subject_shape.h"
#include "sim/survey.h"

namespace sole::sim {
namespace {

constexpr double kRadFromDeg = std::numbers::pi / 180;

double Clipped(std::normal_distribution<double> normal, double low, double high, std::mt19937_64& random) {
  return std::clamp(normal(random), low, high);
}

/// Redraws until the value lies in the range.
double Within(double mean, double sd, double low, double high, std::mt19937_64& random) {
  std::normal_distribution<double> normal(mean, sd);
  double value = normal(random);
  while (value < low || value > high) value = normal(random);
  return value;
}

/// What the survey does not have: navicular height (which has nothing to do with the foot's length), hallux, toes, age and heel pad.
ShapeHandles DrawHabit(std::mt19937_64& random, Subject& subject) {
  ShapeHandles handles;
  subject.measures_mm["navicular_height"] = Within(42.5, 3.5, 36, 55, random);
  subject.hallux_valgus_rad = kRadFromDeg * Clipped(std::normal_distribution<double>(4, 4), -2, 12, random);
  handles.hallux_valgus_rad = subject.hallux_valgus_rad;
  handles.toe_fan_rad = kRadFromDeg * Clipped(std::normal_distribution<double>(0.5, 1.5), -1.5, 4, random);
  subject.second_toe_longest = std::bernoulli_distribution(0.22)(random);
  handles.second_toe_length = subject.second_toe_longest
                                  ? Clipped(std::normal_distribution<double>(0.16, 0.02), 0.13, 0.2, random)
                                  : Clipped(std::normal_distribution<double>(0, 0.04), -0.08, 0.07, random);
  subject.age_years = std::uniform_real_distribution<double>(18, 75)(random);
  // The pad thins by about 2 mm in a lifetime.
  const double pad_mm = 17.9 - 0.035 * (subject.age_years - 18);
  subject.heel_pad_m = 1e-3 * Clipped(std::normal_distribution<double>(pad_mm, 0.6), 15, 19, random);
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

namespace {

/// Everything but the shape.
ShapeHandles DrawPerson(std::uint64_t seed, std::optional<Side> side, Subject& subject) {
  std::mt19937_64 random(seed * 2654435761U + 97);
  subject.seed = seed;
  const Side drawn = std::bernoulli_distribution(0.5)(random) ? Side::kLeft : Side::kRight;
  subject.side = side.value_or(drawn);
  subject.sex = std::bernoulli_distribution(0.5)(random) ? Sex::kMale : Sex::kFemale;
  const Survey& survey = SurveyOf(subject.sex);
  const Eigen::VectorXd person = DrawFromSurvey(survey, random);
  const ShapeHandles handles = DrawHabit(random, subject);
  for (std::size_t i = 0; i < survey.columns.size(); ++i) {
    subject.measures_mm[survey.columns[i]] = person[static_cast<Eigen::Index>(i)];
  }
  subject.stature_m = 1e-3 * subject.measures_mm.extract("stature").mapped();
  subject.weight_kg = subject.measures_mm.extract("weightkg").mapped();
  subject.measures_mm.erase("calfcircumference");  // above the simulated foot
  // The two feet differ by about half a per cent.
  std::mt19937_64 own(seed * 2654435761U + (subject.side == Side::kLeft ? 11 : 7));
  std::normal_distribution<double> asymmetry(1, 0.004);
  for (auto& [name, value] : subject.measures_mm) value *= asymmetry(own);
  return handles;
}

/// About 1.5 standard deviations off the survey in each of four measures, and half as stiff again.
void MakeOther(Subject& subject, ShapeHandles& handles) {
  subject.tissue_stiffness = 1.5;
  subject.measures_mm.at("navicular_height") += 5;
  subject.measures_mm.at("footbreadthhorizontal") *= 1.06;
  subject.measures_mm.at("balloffootcircumference") *= 1.04;
  subject.measures_mm.at("heelbreadth") *= 0.93;
  handles.hallux_valgus_rad += 6 * kRadFromDeg;
  subject.hallux_valgus_rad = handles.hallux_valgus_rad;
}

}  // namespace

Sex SubjectSex(std::uint64_t seed) {
  Subject subject;
  DrawPerson(seed, {}, subject);
  return subject.sex;
}

Subject DrawSubject(std::uint64_t seed, std::optional<Side> side, Population population) {
  Subject subject;
  ShapeHandles handles = DrawPerson(seed, side, subject);
  if (population == Population::kOther) MakeOther(subject, handles);
  subject.shape = SolveShape(handles, subject);
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
