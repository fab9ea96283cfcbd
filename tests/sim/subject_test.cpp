#include "sim/subject.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <Eigen/Cholesky>
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
  for (const std::uint64_t seed : {33U, 87U, 252U}) {  // the last two have shanks as wide as their malleoli
    const Subject subject = DrawSubject(seed);
    const LoadedFoot stood = StandOnPlate(subject, 0.5 * 9.81 * subject.weight_kg);
    const auto measured = MeasureFoot(stood.foot.vertices_m, subject.side);
    for (const char* name : {"footlength", "balloffootlength", "footbreadthhorizontal", "balloffootcircumference", "heelbreadth",
                             "heelanklecircumference", "bimalleolarbreadth", "lateralmalleolusheight", "anklecircumference"}) {
      EXPECT_NEAR(measured.at(name), subject.measures_mm.at(name), 1.5) << name << " of " << seed;
    }
    EXPECT_NEAR(NavicularHeight(SubjectRestMesh(subject).vertices), subject.measures_mm.at("navicular_height"), 3) << seed;
    EXPECT_EQ(measured.at("second_toe_lead") > 0, subject.second_toe_longest) << seed;
  }
}

TEST(DrawSubject, ContradictoryMeasuresStillGiveAFootNearThem) {
  // Malleoli four standard deviations too low, a light and very long foot.
  const Subject subject = DrawSubject(117);
  const LoadedFoot stood = StandOnPlate(subject, 0.5 * 9.81 * subject.weight_kg);
  EXPECT_TRUE(stood.balanced);
  const auto measured = MeasureFoot(stood.foot.vertices_m, subject.side);
  for (const auto& [name, drawn] : subject.measures_mm) {
    if (name != "navicular_height") {
      EXPECT_NEAR(measured.at(name), drawn, 5) << name;
    }
  }
}

TEST(DrawSubject, OtherPeopleHaveOtherProportionsAndStifferSoles) {
  const Subject usual = DrawSubject(33, Side::kRight);
  Subject other = DrawSubject(33, Side::kRight, Population::kOther);
  EXPECT_EQ(other.weight_kg, usual.weight_kg);
  const double load_n = 0.5 * 9.81 * other.weight_kg;
  const LoadedFoot stood = StandOnPlate(other, load_n);
  const auto measured = MeasureFoot(stood.foot.vertices_m, Side::kRight);
  EXPECT_NEAR(measured.at("footlength"), usual.measures_mm.at("footlength"), 1.5);
  EXPECT_NEAR(measured.at("footbreadthhorizontal"), 1.06 * usual.measures_mm.at("footbreadthhorizontal"), 1.5);
  EXPECT_NEAR(measured.at("heelbreadth"), 0.93 * usual.measures_mm.at("heelbreadth"), 1.5);
  EXPECT_NEAR(NavicularHeight(SubjectRestMesh(other).vertices), usual.measures_mm.at("navicular_height") + 5, 3);
  const double stiff_area = stood.contact_area_m2;
  other.tissue_stiffness = 1;
  EXPECT_LT(stiff_area, 0.95 * StandOnPlate(other, load_n).contact_area_m2);
}

TEST(SubjectSex, IsTheDrawnOne) {
  EXPECT_EQ(SubjectSex(3), DrawSubject(3).sex);
  EXPECT_EQ(SubjectSex(33), DrawSubject(33, Side::kLeft).sex);
  int men = 0;
  for (std::uint64_t seed = 1; seed <= 400; ++seed) men += SubjectSex(seed) == Sex::kMale;
  EXPECT_NEAR(men, 200, 40);
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
  EXPECT_NEAR(squares(0, 0) / kDraws, 1, 0.07);  // variance of the first measure
  EXPECT_NEAR(squares(0, 1) / kDraws, 0.94, 0.06);
}

TEST(DrawFromSurvey, NobodyIsBeyondTheRadiusThatHoldsAllButOneInAThousand) {
  const Survey& survey = SurveyOf(Sex::kMale);
  ASSERT_EQ(survey.mean.size(), 12);
  std::mt19937_64 random(6);
  double furthest = 0;
  for (int i = 0; i < 4000; ++i) {
    const Eigen::VectorXd off = DrawFromSurvey(survey, random) - survey.mean;
    furthest = std::max(furthest, off.dot(survey.covariance.ldlt().solve(off)));
  }
  EXPECT_LT(furthest, 32.95);  // chi squared of 12 degrees of freedom at 99.9 % is 32.91
  EXPECT_GT(furthest, 27);
}

}  // namespace
}  // namespace sole::sim
