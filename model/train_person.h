#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "model/forward.h"
#include "model/skinning_fit.h"

namespace sole::model {

/// One registration as training uses it: a right foot. N coarse and M fine vertices, the first N of
/// which are the coarse ones.
struct TrainingFrame {
  Eigen::MatrixX3d vertices_m;  ///< M x 3, world frame
  Eigen::VectorXd certainty;    ///< N, 0 (not seen) to 1
  Eigen::VectorXd free;         ///< N, 0 (touches or nearly) to 1 (well above the glass)
  Eigen::VectorXd contact;      ///< N, 0 or 1
  Eigen::VectorXd probability;  ///< N
};

/// One person's foot without pose, and the poses that explain the registrations.
struct PersonalFit {
  Eigen::MatrixX3d rest_m;    ///< M x 3
  Eigen::MatrixX3d joints_m;  ///< K x 3
  std::vector<ModelParameters> poses;  ///< theta and translation; beta is empty
  std::vector<double> distance_m;      ///< mean over the coarse vertices, of each frame
};

struct PersonalOptions {
  int rounds = 2;             ///< of poses, joints and rest shape in turn
  double sigma_m = 0.001;     ///< expected distance of a vertex
  double theta_sd_rad = 0.6;  ///< weak prior that keeps unseen turns at rest
  /// Vertices on the glass are deformed by it; until a network explains that, they count this much
  /// for the pose.
  double pressed_weight = 0.1;
  double prior_frames = 0.1;   ///< registrations that the model's own shape is worth
  /// A joint turned by this much halves what a pose says of the rest shape; the person's nearest pose
  /// counts as one.
  double near_rest_rad = 0.3;
  /// The glass also bends and widens what does not touch it: a frame with contact counts this much for
  /// the rest shape.
  double loaded_weight = 0.1;
  double joint_sd_m = 0.003;   ///< of a joint's centre from where the regressor has it
  double joint_sigma_m = 0.003;
};

/// The coarse surface of a model only.
FootModel CoarseOnly(const FootModel& foot);

/// The coarse model (see CoarseOnly) with one person's rest shape and joints instead of shape
/// coefficients. `beta`: what the network is told, if there is one.
FootModel PersonalModel(const FootModel& coarse, const Eigen::MatrixX3d& rest_m,
                        const Eigen::MatrixX3d& joints_m, const Eigen::VectorXd& beta = {});

/// A start for FitPerson: shape coefficients fitted to the frames nearest to rest.
PersonalFit StartPerson(const FootModel& foot, std::span<const TrainingFrame> frames,
                        const PersonalOptions& options = {});

/// Personal template, joints and poses (model.md, section 4, steps 1 and 2; MANO, equation 11: poses
/// far from rest, and what touches the glass, say less about the rest shape), in turn from `start`,
/// laid on the model's template rigidly. Correctives of the model count, its network does not.
PersonalFit FitPerson(const FootModel& foot, std::span<const TrainingFrame> frames,
                      const PersonalFit& start, const PersonalOptions& options = {});

/// Poses again, shape and joints held, with the model's network told the contact (if it has one: then
/// pressed vertices count as all others).
PersonalFit RefitPoses(const FootModel& foot, std::span<const TrainingFrame> frames,
                       const PersonalFit& start, const Eigen::VectorXd& beta,
                       const PersonalOptions& options = {});

/// Motion of every bone in a pose.
std::vector<Rigid3> BoneMotions(const FootModel& personal, const ModelParameters& pose);

/// Rest-pose places of posed vertices: each turned back by its blended motion, M x 3.
Eigen::MatrixX3d Unposed(const Eigen::MatrixX3d& posed_m, std::span<const Rigid3> motions,
                         const Eigen::MatrixXd& weights);

/// Values of the coarse vertices on the fine ones.
Eigen::VectorXd OnFine(const FootModel& foot, const Eigen::VectorXd& coarse);

/// Template laid on coarse vertices (N x 3, weighted where weights are given) rigidly: the start of a fit.
ModelParameters RigidStart(const FootModel& foot, const Eigen::MatrixX3d& targets_m,
                           const Eigen::VectorXd& weights = {});

}  // namespace sole::model
