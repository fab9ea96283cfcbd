#pragma once

#include <Eigen/Core>

#include "core/point_cloud.h"
#include "model/forward.h"
#include "model/pose_prior.h"

namespace sole::model {

/// One stage of the annealed fit of a posed model to a scan.
struct PoseFitStage {
  int rounds = 5;             ///< correspondence searches
  double radius_m = 0.01;     ///< scan points further from the surface are left out
  double kernel_m = 0.002;    ///< scale s of Geman-McClure, rho(r) = r^2 / (r^2 + s^2)
  double sigma_m = 0.001;     ///< what one effective observation is worth
  bool free_joints = true;    ///< false: only the root and the translation move
  bool free_shape = true;
};

struct PoseFitOptions {
  double effective_points = 400;       ///< scan points are correlated; together they count as this many
  double minimum_normal_cosine = 0.3;  ///< between scan and surface normal
  PosePriorOptions prior;
  double glass_height_m = 0.0003;      ///< scan points lower than this lie on the glass: flesh pressed flat there may
                                       ///< reach below it in a model without contact, so they only push up
  int solver_iterations = 2;           ///< Levenberg-Marquardt steps between two searches
  double still_m = 5e-5;               ///< a round that moves, turns and reshapes less ends the stage
  double still_rad = 1e-3;
  double still_beta = 0.01;
};

/// State of a fit and how good it is.
struct PoseFit {
  ModelParameters parameters;
  double cost = 0;        ///< mean robust cost over all scan points, 0 (all on the surface) to 1 (all far away)
  double residual_m = 0;  ///< mean distance of the matched points
  double matched = 0;     ///< share of scan points with a correspondence
  Eigen::MatrixXd covariance;  ///< of [theta (3K), beta, translation (3)]; empty until asked for
};

/// Fits theta, beta and translation to a scan by Levenberg-Marquardt (Ceres) on point-to-plane distances with
/// priors on joints and shape (energies E_g, E_theta, E_beta), searching correspondences anew every round.
PoseFit FitPose(const FootModel& model, const PointCloud& scan, const ModelParameters& start,
                const PoseFitStage& stage, const PoseFitOptions& options = {});

/// RMS that a mean distance between scan and model stands for, normal errors assumed.
inline double MisfitOf(double residual_m) { return 1.25 * residual_m; }

/// Fills `covariance` from the normal equations at the solution, the scan's points as good as the model's misfit to them.
void AddCovariance(const FootModel& model, const PointCloud& scan, const PoseFitStage& stage,
                   const PoseFitOptions& options, PoseFit& fit);

}  // namespace sole::model
