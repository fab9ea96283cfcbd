#pragma once

#include <random>

#include "model/forward.h"

namespace sole::model::testing {

inline Eigen::MatrixXd RandomMatrix(std::mt19937_64& engine, Eigen::Index rows, Eigen::Index cols,
                                    double scale) {
  std::normal_distribution<double> normal(0, scale);
  return Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return normal(engine); });
}

inline ModelSurface RandomSurface(std::mt19937_64& engine, Eigen::Index n, Eigen::Index joints,
                                  Eigen::Index betas, Eigen::Index features) {
  ModelSurface surface;
  surface.template_m = RandomMatrix(engine, n, 3, 0.1);
  surface.triangles.resize(n - 2, 3);
  for (int t = 0; t + 2 < n; ++t) surface.triangles.row(t) << t, t + 1, t + 2;
  surface.weights = RandomMatrix(engine, n, joints, 1).cwiseMax(0);
  surface.weights.col(0).array() += 0.01;
  for (Eigen::Index i = 0; i < n; ++i) surface.weights.row(i) /= surface.weights.row(i).sum();
  surface.shapedirs = RandomMatrix(engine, 3 * n, betas, 0.01);
  surface.posedirs = RandomMatrix(engine, 3 * n, features, 0.01);
  return surface;
}

inline Eigen::Index FeaturesOf(Family family, Eigen::Index joints) {
  if (family == Family::kSupr) return 4 * joints;
  return family == Family::kStar ? 4 * (joints - 1) + 1 : 9 * (joints - 1);
}

/// A small model with every term switched on: 12 vertices (20 fine), 5 joints in a branched tree, 4
/// betas.
inline FootModel RandomModel(Family family, unsigned seed, bool affine_regressor = false,
                             bool network = true) {
  std::mt19937_64 engine(seed);
  const Eigen::Index n = 12, fine = 20, joints = 5, betas = 4,
                     features = FeaturesOf(family, joints);
  FootModel model;
  model.family = family;
  model.licence = "none";
  model.parents = {-1, 0, 1, 1, 0};
  model.joint_names = {"root", "a", "b", "c", "d"};
  model.coarse = RandomSurface(engine, n, joints, betas, features);
  model.fine = RandomSurface(engine, fine, joints, betas, features);
  model.fine.template_m.topRows(n) = model.coarse.template_m;
  model.fine.weights.topRows(n) = model.coarse.weights;
  model.fine.shapedirs.topRows(3 * n) = model.coarse.shapedirs;
  model.fine.posedirs.topRows(3 * n) = model.coarse.posedirs;
  for (int i = 0; i < fine; ++i) {
    if (i < n)
      model.upsampling.push_back({{i, 1.0}});
    else
      model.upsampling.push_back({{i - 12, 0.25}, {i - 10, 0.75}});
  }
  model.joint_regressor = affine_regressor ? RandomMatrix(engine, 3 * joints, 3 * n + 1, 0.2)
                                           : RandomMatrix(engine, joints, n, 0.2);
  if (!affine_regressor) {
    for (Eigen::Index j = 0; j < joints; ++j)
      model.joint_regressor(j, 0) += 1 - model.joint_regressor.row(j).sum();
  }
  if (network) {
    const Eigen::Index sizes[] = {4 * joints + 2 + n, 9, 7, 3 * n};
    for (int l = 0; l < 3; ++l) {
      model.network.push_back({RandomMatrix(engine, sizes[l + 1], sizes[l], 0.3),
                               RandomMatrix(engine, sizes[l + 1], 1, 0.3)});
    }
    model.network.back().weight *= 0.05;
  }
  model.landmarks = {{"heel", 3}, {"toe", 7}};
  for (int i = 0; i < n; ++i) model.material.push_back({i, {0.5, 0.25, 0.25}});
  Prepare(model);
  return model;
}

inline ModelParameters RandomParameters(const FootModel& model, unsigned seed) {
  std::mt19937_64 engine(seed);
  ModelParameters parameters;
  parameters.theta = RandomMatrix(engine, model.NumJoints(), 3, 0.5);
  parameters.beta = RandomMatrix(engine, model.NumBetas(), 1, 1);
  parameters.translation_m = RandomMatrix(engine, 3, 1, 0.2);
  parameters.contact = RandomMatrix(engine, model.NumVertices(), 1, 1).cwiseAbs().cwiseMin(1);
  return parameters;
}

}  // namespace sole::model::testing
