#include "model/forward_batch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/error.h"
#include "random_model.h"

namespace sole::model {
namespace {

using testing::RandomModel;
using testing::RandomParameters;

std::vector<ModelParameters> ManyFeet(const FootModel& model, unsigned count) {
  std::vector<ModelParameters> feet;
  for (unsigned m = 0; m < count; ++m) feet.push_back(RandomParameters(model, 100 + m));
  feet[1].beta.conservativeResize(2);
  feet[2].contact.resize(0);
  return feet;
}

/// Largest difference from the single forward function, m.
template <class Scalar>
double WorstDifference(const FootModel& model, Variant variant) {
  const std::vector<ModelParameters> feet = ManyFeet(model, 131);
  const PosedBatch<Scalar> batch = ForwardBatch(PrepareBatch<Scalar>(model, variant), feet);
  double worst = 0;
  for (std::size_t m = 0; m < feet.size(); ++m) {
    const PosedFoot foot = Forward(model, feet[m], variant);
    const Eigen::Matrix3Xd vertices = foot.vertices_m.transpose(),
                           joints = foot.joints_m.transpose();
    const auto column = static_cast<Eigen::Index>(m);
    const Eigen::VectorXd batch_vertices = batch.vertices_m.col(column).template cast<double>(),
                          batch_joints = batch.joints_m.col(column).template cast<double>();
    worst = std::max({worst, (batch_vertices - vertices.reshaped()).cwiseAbs().maxCoeff(),
                      (batch_joints - joints.reshaped()).cwiseAbs().maxCoeff()});
  }
  return worst;
}

TEST(ForwardBatch, AgreesWithTheSingleForwardForEveryFamilyAndVariant) {
  for (const Family family : {Family::kSupr, Family::kStar, Family::kSmpl}) {
    for (const bool network : {false, true}) {
      const FootModel model = RandomModel(family, 41, false, network);
      for (const Variant variant : {Variant::kCoarse, Variant::kFine}) {
        EXPECT_LT(WorstDifference<double>(model, variant), 1e-14);
        EXPECT_LT(WorstDifference<float>(model, variant), 1e-6);
      }
    }
  }
}

TEST(ForwardBatch, TakesNoneAndOne) {
  const FootModel model = RandomModel(Family::kSupr, 42);
  EXPECT_EQ(ForwardBatch(model, {}).vertices_m.cols(), 0);
  const std::vector<ModelParameters> one = {RandomParameters(model, 43)};
  const Eigen::Matrix3Xd wanted = Forward(model, one[0]).vertices_m.transpose();
  EXPECT_LT((ForwardBatch(model, one).vertices_m - wanted.reshaped()).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(ForwardBatch, RefusesParametersOfAnotherModel) {
  const FootModel model = RandomModel(Family::kSupr, 44);
  std::vector<ModelParameters> feet = ManyFeet(model, 5);
  feet[3].theta.conservativeResize(4, 3);
  EXPECT_THROW(ForwardBatch(model, feet), Error);
}

}  // namespace
}  // namespace sole::model
