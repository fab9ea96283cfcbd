#pragma once

#include <Eigen/Core>

#include "model/forward.h"

namespace sole::model {

struct VertexFitOptions {
  int iterations = 30;
  double sigma_m = 0.001;     ///< expected distance of a vertex
  double theta_sd_rad = 1.0;  ///< weak prior that keeps unseen turns at rest (the root is free)
  double beta_sd = 1.0;
  bool fit_beta = true;  ///< otherwise the start's beta is kept
  Eigen::VectorXd weights = {};  ///< of the vertices' squared distances; empty: all 1
};

struct VertexFitResult {
  ModelParameters parameters;
  double mean_distance_m = 0;  ///< of all vertices, whatever their weights
  double max_distance_m = 0;
};

/// Pose, shape and translation whose vertices come nearest to known positions of the same vertices
/// (N x 3 of the variant), by Levenberg-Marquardt from `start`. The yardstick of how well a model
/// can explain a registered foot.
VertexFitResult FitVertices(const FootModel& model, Variant variant,
                            const Eigen::MatrixX3d& targets_m, const ModelParameters& start,
                            const VertexFitOptions& options = {});

}  // namespace sole::model
