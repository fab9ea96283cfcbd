#include "sim/posing.h"

#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "core/error.h"
#include "sim/foot_kinematics.h"
#include "sim/reference_foot.h"
#include "sim/subject_shape.h"

namespace sole::sim {
namespace {

FootPose Toes(double angle_rad) {
  FootPose pose;
  for (int toe = 1; toe <= 5; ++toe) pose.angles_rad["mtp_" + std::to_string(toe) + ".dorsiflexion"] = angle_rad;
  return pose;
}

/// Checks skin of a right-handed pose at foot frame: on the posed field, on its own toe, and how much of the area is folded.
void ExpectSoundSkin(const Subject& subject, const FootPose& pose, double folded_share) {
  const PosedFoot posed = PoseFoot(subject, pose);
  const AnatomyTable& table = subject.shape->table;
  std::vector<Rigid3> motions = BoneMotions(table, pose.angles_rad);
  const Rigid3 hold = motions[static_cast<std::size_t>(BoneIndex(table, pose.fixed_bone))].Inverse();
  for (Rigid3& motion : motions) motion = hold * motion;
  const ImplicitFoot foot(MovedTable(table, motions));
  const ReferenceBinding& binding = Binding();
  std::vector<Eigen::Vector3d> vertices, outwards;
  std::size_t off = 0, astray = 0;
  for (std::size_t v = 0; v < posed.vertices_m.size(); ++v) {
    vertices.push_back(subject.side == Side::kLeft ? Mirrored(posed.vertices_m[v]) : posed.vertices_m[v]);
    const ImplicitFoot::Sample sample = foot.Evaluate(vertices[v], binding.charts[v]);
    outwards.push_back(sample.gradient);
    if (binding.kinds[v] == SkinKind::kCap) continue;
    if (std::abs(sample.value) > 2e-5) ++off;
    if (binding.charts[v] == 0 || v % 7 != 0) continue;
    const auto distance = foot.GroupDistances(vertices[v]);
    if (distance[kBodyGroup] < 0.006) continue;
    for (int toe = 1; toe <= 5; ++toe) {
      if (toe != binding.charts[v] && distance[static_cast<std::size_t>(toe)] < distance[binding.charts[v]]) ++astray;
    }
  }
  EXPECT_LT(off, 5U);
  EXPECT_EQ(astray, 0U) << "vertices of one toe inside another";
  double area = 0, folded = 0, folded_elsewhere = 0;
  for (const Eigen::Vector3i& t : ReferenceFoot().triangles) {
    const auto a = static_cast<std::size_t>(t[0]), b = static_cast<std::size_t>(t[1]), c = static_cast<std::size_t>(t[2]);
    if (binding.kinds[a] != SkinKind::kSkin || binding.kinds[b] != SkinKind::kSkin || binding.kinds[c] != SkinKind::kSkin) continue;
    const Eigen::Vector3d cross = (vertices[b] - vertices[a]).cross(vertices[c] - vertices[a]);
    area += cross.norm();
    if (cross.dot(outwards[a] + outwards[b] + outwards[c]) > 0) continue;
    folded += cross.norm();
    if (binding.charts[a] + binding.charts[b] + binding.charts[c] == 0) folded_elsewhere += cross.norm();
  }
  EXPECT_LT(folded, folded_share * area);
  EXPECT_LT(folded_elsewhere, 0.0005 * area);
}

TEST(PoseFoot, SkinOfTenSubjectsStaysSoundAtRestAndWithToesUp) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SCOPED_TRACE(seed);
    const Subject subject = DrawSubject(seed);
    ExpectSoundSkin(subject, {}, 0.004);
    FootPose pose = Toes(0.7);
    pose.angles_rad["talocrural.dorsiflexion"] = -0.4;
    ExpectSoundSkin(subject, pose, 0.01);
  }
}

TEST(PoseFoot, ZeroPoseIsTheRestMesh) {
  const Subject mean = MeanSubject();
  const PosedFoot posed = PoseFoot(mean, {});
  const TriangleMesh rest = SubjectRestMesh(mean);
  double largest = 0;
  for (std::size_t v = 0; v < rest.vertices.size(); ++v) {
    if (Binding().charts[v] == 0) largest = std::max(largest, (posed.vertices_m[v] - rest.vertices[v]).norm());
  }
  EXPECT_LT(largest, 2e-4);
}

TEST(PoseFoot, AnglesBeyondTheRangeAreLimited) {
  const Subject mean = MeanSubject();
  const PosedFoot at_limit = PoseFoot(mean, Toes(60 * M_PI / 180));
  FootPose beyond = Toes(2.5);
  beyond.angles_rad["mtp_1.dorsiflexion"] = 60 * M_PI / 180;
  EXPECT_TRUE(at_limit.vertices_m == PoseFoot(mean, beyond).vertices_m);
}

TEST(PoseFoot, UnknownAngleIsRefusedByName) {
  FootPose pose;
  pose.angles_rad["knee.flexion"] = 0.1;
  try {
    PoseFoot(MeanSubject(), pose);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("knee.flexion"), std::string::npos);
  }
}

TEST(PoseFoot, FixedBoneStaysAndDorsiflexionRaisesTheToes) {
  const Subject mean = MeanSubject();
  FootPose pose;
  pose.fixed_bone = "tibia";
  pose.angles_rad["talocrural.dorsiflexion"] = 0.2;
  const PosedFoot posed = PoseFoot(mean, pose);
  EXPECT_LT(posed.world_from_rest[0].translation.norm(), 1e-12);
  const Eigen::Vector3d toe(-0.03, 0.24, 0.02);
  EXPECT_GT((posed.world_from_rest.back() * toe).z(), toe.z() + 0.02);
}

TEST(PoseFoot, LeftPoseMirrorsTheRightPose) {
  FootPose pose = Toes(0.3);
  pose.angles_rad["subtalar.inversion"] = 0.1;
  const PosedFoot right = PoseFoot(MeanSubject(Side::kRight), pose), left = PoseFoot(MeanSubject(Side::kLeft), pose);
  for (std::size_t v = 0; v < right.vertices_m.size(); v += 53) {
    EXPECT_LT((Mirrored(left.vertices_m[v]) - right.vertices_m[v]).norm(), 1e-12);
  }
  const Eigen::Vector3d p(0.01, 0.2, 0.03);
  EXPECT_LT((Mirrored(left.world_from_rest[20] * Mirrored(p)) - right.world_from_rest[20] * p).norm(), 1e-12);
}

}  // namespace
}  // namespace sole::sim
