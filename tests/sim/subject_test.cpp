#include "sim/subject.h"

#include <cmath>

#include <gtest/gtest.h>

#include "sim/foot_measures.h"
#include "sim/reference_foot.h"
#include "sim/soft_contact.h"
#include "sim/survey.h"

namespace sole::sim {
namespace {

TEST(DrawSubject, SameSeedGivesTheSameFootAndOthersDiffer) {
  const TriangleMesh once = SubjectRestMesh(DrawSubject(11, Side::kRight));
  const TriangleMesh again = SubjectRestMesh(DrawSubject(11, Side::kRight));
  const TriangleMesh other = SubjectRestMesh(DrawSubject(12, Side::kRight));
  ASSERT_EQ(once.vertices.size(), ReferenceFoot().vertices.size());
  EXPECT_TRUE(once.vertices == again.vertices);
  EXPECT_TRUE(once.triangles == other.triangles);
  EXPECT_FALSE(once.vertices == other.vertices);
}

TEST(DrawSubject, StandingFootHasTheDrawnMeasures) {
  for (const std::uint64_t seed : {3U, 33U, 101U}) {
    const Subject subject = DrawSubject(seed);
    const LoadedFoot stood = StandOnPlate(subject, 0.5 * 9.81 * subject.weight_kg);
    const auto measured = MeasureFoot(stood.foot.vertices_m, subject.side);
    for (const char* name : {"footlength", "balloffootlength", "footbreadthhorizontal", "balloffootcircumference", "heelbreadth",
                             "heelanklecircumference", "bimalleolarbreadth", "lateralmalleolusheight", "anklecircumference"}) {
      EXPECT_NEAR(measured.at(name), subject.measures_mm.at(name), 1) << name << " of " << seed;
    }
  }
}

TEST(DrawSubject, LeftFootIsNearlyTheMirroredRight) {
  const TriangleMesh right = SubjectRestMesh(DrawSubject(21, Side::kRight));
  const TriangleMesh left = SubjectRestMesh(DrawSubject(21, Side::kLeft));
  double sum = 0, largest = 0;
  for (std::size_t v = 0; v < right.vertices.size(); ++v) {
    const Eigen::Vector3d mirrored(-left.vertices[v].x(), left.vertices[v].y(), left.vertices[v].z());
    const double distance = (mirrored - right.vertices[v]).norm();
    sum += distance;
    largest = std::max(largest, distance);
  }
  const double mean = sum / static_cast<double>(right.vertices.size());
  EXPECT_GT(mean, 1e-5);
  EXPECT_LT(mean, 0.003);
  EXPECT_LT(largest, 0.012);
}

TEST(MeanSubject, LeftIsTheMirrorImage) {
  const TriangleMesh right = SubjectRestMesh(MeanSubject(Side::kRight));
  const TriangleMesh left = SubjectRestMesh(MeanSubject(Side::kLeft));
  for (std::size_t v = 0; v < right.vertices.size(); v += 101) {
    EXPECT_EQ(left.vertices[v].x(), -right.vertices[v].x());
    EXPECT_EQ(left.vertices[v].z(), right.vertices[v].z());
  }
  EXPECT_EQ(left.triangles[5], Eigen::Vector3i(right.triangles[5][0], right.triangles[5][2], right.triangles[5][1]));
}

TEST(JointAxes, LeftAxesMirrorTheSameMeaning) {
  const auto right = JointAxes(MeanSubject(Side::kRight)), left = JointAxes(MeanSubject(Side::kLeft));
  ASSERT_EQ(right.size(), left.size());
  for (std::size_t i = 0; i < right.size(); ++i) {
    EXPECT_EQ(right[i].name, left[i].name);
    // A rotation mirrors to the rotation about the mirrored axis turned round.
    EXPECT_NEAR(right[i].axis.x(), left[i].axis.x(), 1e-12);
    EXPECT_NEAR(right[i].axis.y(), -left[i].axis.y(), 1e-12);
    EXPECT_NEAR(right[i].axis.norm(), 1, 1e-9);
  }
}

TEST(BoneShares, RowsSumToOne) {
  const Eigen::MatrixXf& shares = BoneShares();
  EXPECT_EQ(shares.rows(), static_cast<Eigen::Index>(ReferenceFoot().vertices.size()));
  EXPECT_LT((shares.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-4F);
  EXPECT_GE(shares.minCoeff(), 0);
}

TEST(DrawFromSurvey, ReproducesTheSurveysMeansAndSpread) {
  const Survey& survey = SurveyOf(Sex::kFemale);
  std::mt19937_64 random(5);
  constexpr int kDraws = 4000;
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(survey.mean.size());
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(survey.mean.size(), survey.mean.size());
  for (int i = 0; i < kDraws; ++i) {
    const Eigen::VectorXd z = (DrawFromSurvey(survey, random) - survey.mean).cwiseQuotient(survey.sd);
    sum += z;
    squares += z * z.transpose();
  }
  EXPECT_LT((sum / kDraws).cwiseAbs().maxCoeff(), 0.06);
  EXPECT_NEAR(squares(0, 0) / kDraws, 1, 0.07);
  EXPECT_NEAR(squares(0, 1) / kDraws, 0.94, 0.06);
}

}  // namespace
}  // namespace sole::sim
