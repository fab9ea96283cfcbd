#include "model/vertex_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "random_model.h"

namespace sole::model {
namespace {

using testing::RandomModel;
using testing::RandomParameters;

TEST(FitVertices, FindsThePoseAndShapeThatMadeTheVertices) {
  const FootModel model = RandomModel(Family::kSupr, 91, false, false);
  ModelParameters truth = RandomParameters(model, 92);
  truth.theta *= 0.4;
  truth.contact.resize(0);
  const Eigen::MatrixX3d target = Forward(model, truth, Variant::kFine).vertices_m;
  const VertexFitResult fit = FitVertices(model, Variant::kFine, target, RestParameters(model),
                                          {.iterations = 100, .sigma_m = 1e-6});
  EXPECT_LT(fit.mean_distance_m, 1e-6);
  EXPECT_GE(fit.max_distance_m, fit.mean_distance_m);
  EXPECT_LT((fit.parameters.beta - truth.beta).cwiseAbs().maxCoeff(), 1e-2);
}

TEST(FitVertices, CanKeepTheShape) {
  const FootModel model = RandomModel(Family::kSupr, 93, false, false);
  ModelParameters truth = RandomParameters(model, 94);
  truth.theta *= 0.2;
  truth.contact.resize(0);
  ModelParameters start = RestParameters(model);
  start.beta = truth.beta;
  const VertexFitResult fit =
      FitVertices(model, Variant::kFine, Forward(model, truth, Variant::kFine).vertices_m, start,
                  {.iterations = 100, .sigma_m = 1e-6, .fit_beta = false});
  EXPECT_EQ(fit.parameters.beta, truth.beta);
  EXPECT_LT(fit.mean_distance_m, 1e-6);
}

TEST(FitVertices, VerticesWithoutWeightDoNotCount) {
  const FootModel model = RandomModel(Family::kSupr, 95, false, false);
  ModelParameters truth = RandomParameters(model, 96);
  truth.theta *= 0.3;
  truth.contact.resize(0);
  Eigen::MatrixX3d target = Forward(model, truth, Variant::kFine).vertices_m;
  target.topRows(3).array() += 0.2;
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(target.rows());
  weights.head(3).setZero();
  const VertexFitResult fit =
      FitVertices(model, Variant::kFine, target, RestParameters(model),
                  {.iterations = 100, .sigma_m = 1e-6, .weights = weights});
  EXPECT_LT((fit.parameters.beta - truth.beta).cwiseAbs().maxCoeff(), 1e-2);
  EXPECT_NEAR(fit.max_distance_m, 0.2 * std::sqrt(3), 1e-4);
}

}  // namespace
}  // namespace sole::model
