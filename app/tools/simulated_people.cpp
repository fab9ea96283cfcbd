#include "app/tools/simulated_people.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <random>

#include "core/error.h"

namespace sole::tools {
namespace {

std::vector<ModelJoint> MakeModelJoints() {
  std::vector<ModelJoint> joints = {{"shank", -1, {"tibia", "fibula"}},
                                    {"ankle", 0, {"talus", "calcaneus"}},
                                    {"midfoot", 1, {"navicular", "cuboid"}}};
  for (const char* bone : {"cuneiform_1", "cuneiform_2", "cuneiform_3"})
    joints[2].bones.emplace_back(bone);
  for (int toe = 1; toe <= 5; ++toe) joints[2].bones.push_back(fmt::format("metatarsal_{}", toe));
  for (int toe = 1; toe <= 5; ++toe) {
    joints.push_back({fmt::format("toe{}_mtp", toe), 2, {fmt::format("proximal_phalanx_{}", toe)}});
    ModelJoint tip{fmt::format("toe{}_ip", toe), static_cast<int>(joints.size()) - 1, {}};
    if (toe > 1) tip.bones.push_back(fmt::format("middle_phalanx_{}", toe));
    tip.bones.push_back(fmt::format("distal_phalanx_{}", toe));
    joints.push_back(tip);
  }
  return joints;
}

Eigen::Vector3d CentreOf(const std::vector<sim::BoneInfo>& bones, const std::string& name) {
  const auto bone = std::find_if(bones.begin(), bones.end(),
                                 [&](const sim::BoneInfo& b) { return b.name == name; });
  Require(bone != bones.end(), "model generator: the simulator has no bone '" + name + "'");
  return bone->joint_centre_m;
}

Person DrawPerson(std::uint64_t seed, std::span<const SurfacePoint> points,
                  const PersonOptions& options) {
  const sim::Subject subject = sim::DrawSubject(seed, Side::kRight);
  Person person;
  person.rest_m = PointsOn(sim::SubjectRestMesh(subject).vertices, points);
  person.joints_m = JointCentres(subject);
  for (int pose = 0; pose < options.poses; ++pose) {
    const std::uint64_t pose_seed = 1000 * seed + static_cast<std::uint64_t>(pose);
    person.posed_m.push_back(PointsOn(
        sim::PoseFoot(subject, RandomPose(subject, pose_seed, options.pose_share)).vertices_m,
        points));
  }
  for (const double load : options.loads_n) {
    person.standing_m.push_back(PointsOn(sim::StandOnPlate(subject, load).foot.vertices_m, points));
  }
  return person;
}

}  // namespace

const std::vector<ModelJoint>& ModelJoints() {
  static const std::vector<ModelJoint> joints = MakeModelJoints();
  return joints;
}

Eigen::MatrixX3d PointsOn(std::span<const Eigen::Vector3d> vertices,
                          std::span<const SurfacePoint> points) {
  const std::vector<Eigen::Vector3i>& triangles = sim::ReferenceFoot().triangles;
  Eigen::MatrixX3d positions = Eigen::MatrixX3d::Zero(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3i& t = triangles.at(static_cast<std::size_t>(points[i].triangle));
    for (int corner = 0; corner < 3; ++corner) {
      positions.row(static_cast<Eigen::Index>(i)) +=
          points[i].barycentric[corner] * vertices[static_cast<std::size_t>(t[corner])].transpose();
    }
  }
  return positions;
}

Eigen::MatrixXd JointShares(std::span<const SurfacePoint> points) {
  const Eigen::MatrixXf& bone_shares = sim::BoneShares();
  const std::vector<sim::BoneInfo> bones = sim::Bones(sim::MeanSubject());
  const std::vector<ModelJoint>& joints = ModelJoints();
  Eigen::MatrixXd shares = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(points.size()),
                                                 static_cast<Eigen::Index>(joints.size()));
  const std::vector<Eigen::Vector3i>& triangles = sim::ReferenceFoot().triangles;
  for (std::size_t b = 0; b < bones.size(); ++b) {
    const auto joint = std::find_if(joints.begin(), joints.end(), [&](const ModelJoint& j) {
      return std::find(j.bones.begin(), j.bones.end(), bones[b].name) != j.bones.end();
    });
    Require(joint != joints.end(),
            "model generator: no model joint moves the bone '" + bones[b].name + "'");
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3i& t = triangles.at(static_cast<std::size_t>(points[i].triangle));
      for (int corner = 0; corner < 3; ++corner) {
        shares(static_cast<Eigen::Index>(i), joint - joints.begin()) +=
            points[i].barycentric[corner] *
            static_cast<double>(bone_shares(t[corner], static_cast<Eigen::Index>(b)));
      }
    }
  }
  return shares;
}

Eigen::MatrixX3d JointCentres(const sim::Subject& subject) {
  const std::vector<sim::BoneInfo> bones = sim::Bones(subject);
  const std::vector<ModelJoint>& joints = ModelJoints();
  Eigen::MatrixX3d centres = Eigen::MatrixX3d::Zero(static_cast<Eigen::Index>(joints.size()), 3);
  // One ball joint stands for the talocrural and the subtalar one.
  centres.row(1) = 0.5 * (CentreOf(bones, "talus") + CentreOf(bones, "calcaneus"));
  for (std::size_t j = 2; j < joints.size(); ++j)
    centres.row(static_cast<Eigen::Index>(j)) = CentreOf(bones, joints[j].bones.front());
  return centres;
}

sim::FootPose RandomPose(const sim::Subject& subject, std::uint64_t seed, double share) {
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  sim::FootPose pose;
  for (const sim::JointAxis& axis : sim::JointAxes(subject)) {
    pose.angles_rad[axis.name] =
        share * (axis.min_rad + uniform(engine) * (axis.max_rad - axis.min_rad));
  }
  return pose;
}

std::vector<Person> DrawPeople(std::span<const std::uint64_t> seeds,
                               std::span<const SurfacePoint> points, const PersonOptions& options) {
  std::vector<Person> people(seeds.size());
  tbb::parallel_for(std::size_t{0}, seeds.size(),
                    [&](std::size_t i) { people[i] = DrawPerson(seeds[i], points, options); });
  return people;
}

}  // namespace sole::tools
