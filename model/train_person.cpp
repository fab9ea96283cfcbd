#include "model/train_person.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cstddef>
#include <numeric>

#include "core/error.h"
#include "model/constraints.h"
#include "model/contact_network.h"
#include "model/shape_space.h"
#include "model/skeleton.h"
#include "model/train_joints.h"
#include "model/vertex_fit.h"

namespace sole::model {
namespace {

Eigen::MatrixX3d CoarseOf(const TrainingFrame& frame, Eigen::Index n) {
  return frame.vertices_m.topRows(n);
}

/// How much each coarse vertex counts for the pose.
Eigen::VectorXd PoseWeights(const TrainingFrame& frame, double pressed_weight) {
  return frame.certainty.array() *
         (pressed_weight + (1 - pressed_weight) * frame.free.array());
}

void FitPoses(const FootModel& personal, std::span<const TrainingFrame> frames,
              const PersonalOptions& options, double pressed_weight, PersonalFit& fit) {
  const Eigen::Index n = personal.NumVertices();
  fit.distance_m.assign(frames.size(), 0);
  for (std::size_t f = 0; f < frames.size(); ++f) {
    ModelParameters start = fit.poses[f];
    if (!personal.network.empty()) start.contact = frames[f].contact;
    const VertexFitResult result =
        FitVertices(personal, Variant::kCoarse, CoarseOf(frames[f], n), start,
                    {.sigma_m = options.sigma_m,
                     .theta_sd_rad = options.theta_sd_rad,
                     .weights = PoseWeights(frames[f], pressed_weight)});
    fit.poses[f] = result.parameters;
    fit.poses[f].contact.resize(0);
    fit.distance_m[f] = result.mean_distance_m;
  }
}

/// What a pose says about the rest shape: 1 at rest.
double NearRest(const FootModel& personal, const Eigen::MatrixX3d& theta, double scale_rad) {
  double squares = 0;
  for (Eigen::Index j = 1; j < theta.rows(); ++j)
    squares += (LocalRotation(personal, theta, j) - Eigen::Matrix3d::Identity()).squaredNorm() / 2;
  return 1 / (1 + squares / (scale_rad * scale_rad));
}

double LoadWeight(const TrainingFrame& frame, const PersonalOptions& options) {
  return (frame.contact.array() > 0).any() ? options.loaded_weight : 1;
}

/// Correctives of the fine surface in a pose, M x 3.
Eigen::MatrixX3d Correctives(const FootModel& foot, const Eigen::MatrixX3d& theta) {
  const Eigen::Index m = foot.fine.NumVertices();
  if (foot.fine.posedirs.cols() == 0) return Eigen::MatrixX3d::Zero(m, 3);
  const Eigen::VectorXd stacked =
      foot.fine.posedirs *
      ConstrainedPoseFeatures(foot, theta, Eigen::VectorXd::Zero(kNetworkBetas));
  return Eigen::Map<const Eigen::Matrix3Xd>(stacked.data(), 3, m).transpose();
}

Eigen::MatrixX3d RestShape(const FootModel& foot, const FootModel& personal,
                           std::span<const TrainingFrame> frames, const PersonalFit& fit,
                           const Eigen::MatrixX3d& prior_m, const PersonalOptions& options) {
  Eigen::MatrixX3d sum = options.prior_frames * prior_m;
  Eigen::VectorXd weight = Eigen::VectorXd::Constant(prior_m.rows(), options.prior_frames);
  std::vector<double> near;
  for (std::size_t f = 0; f < frames.size(); ++f)
    near.push_back(NearRest(personal, fit.poses[f].theta, options.near_rest_rad) *
                   LoadWeight(frames[f], options));
  const double nearest = *std::max_element(near.begin(), near.end());
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const Eigen::MatrixX3d theta = fit.poses[f].theta;
    const Eigen::VectorXd counts =
        near[f] / nearest * OnFine(foot, frames[f].certainty.cwiseProduct(frames[f].free));
    const Eigen::MatrixX3d unposed =
        Unposed(frames[f].vertices_m, BoneMotions(personal, fit.poses[f]), foot.fine.weights) -
        Correctives(foot, theta);
    sum += counts.asDiagonal() * unposed;
    weight += counts;
  }
  return weight.cwiseInverse().asDiagonal() * sum;
}

void Move(const Rigid3& motion, Eigen::MatrixX3d& points) {
  points = (points * motion.rotation.toRotationMatrix().transpose()).rowwise() +
           motion.translation.transpose();
}

/// Joints where the model's regressor has them in a rest shape.
Eigen::MatrixX3d RegressedJoints(const FootModel& coarse, const Eigen::MatrixX3d& rest_m) {
  FootModel shaped = coarse;
  shaped.coarse.template_m = rest_m.topRows(coarse.NumVertices());
  Prepare(shaped);
  return shaped.derived.joints_m;
}

/// The model's own shape that comes nearest to a rest shape: where nothing is seen, it counts.
Eigen::MatrixX3d NearestShape(const FootModel& foot, const Eigen::MatrixX3d& rest_m) {
  const Eigen::Index m = rest_m.rows(), betas = foot.NumBetas();
  const Eigen::Matrix3Xd difference = (rest_m - foot.fine.template_m).transpose();
  const Eigen::MatrixXd& s = foot.fine.shapedirs;
  // One standard deviation is worth a millimetre in all vertices: hardly anything.
  Eigen::MatrixXd normal = s.transpose() * s;
  normal.diagonal().array() += 1e-6 * 3 * static_cast<double>(m) / 100;
  const Eigen::VectorXd beta = normal.ldlt().solve(
      s.transpose() * Eigen::Map<const Eigen::VectorXd>(difference.data(), 3 * m));
  const Eigen::VectorXd offsets =
      betas > 0 ? Eigen::VectorXd(s * beta) : Eigen::VectorXd(Eigen::VectorXd::Zero(3 * m));
  return foot.fine.template_m +
         Eigen::Map<const Eigen::Matrix3Xd>(offsets.data(), 3, m).transpose();
}

}  // namespace

FootModel CoarseOnly(const FootModel& foot) {
  FootModel coarse;
  coarse.family = foot.family;
  coarse.side = foot.side;
  coarse.parents = foot.parents;
  coarse.joint_names = foot.joint_names;
  coarse.constraints = foot.constraints;
  coarse.coarse = foot.coarse;
  coarse.joint_regressor = foot.joint_regressor;
  coarse.network = foot.network;
  coarse.mirror_axis = foot.mirror_axis;
  Prepare(coarse);
  return coarse;
}

FootModel PersonalModel(const FootModel& coarse, const Eigen::MatrixX3d& rest_m,
                        const Eigen::MatrixX3d& joints_m, const Eigen::VectorXd& beta) {
  FootModel own = coarse;
  const Eigen::Index n = coarse.NumVertices(), k = coarse.NumJoints();
  own.coarse.template_m = rest_m.topRows(n);
  own.coarse.shapedirs.resize(3 * n, 0);
  own.joint_regressor = Eigen::MatrixXd::Zero(3 * k, 3 * n + 1);
  for (Eigen::Index j = 0; j < k; ++j)
    own.joint_regressor.block<3, 1>(3 * j, 3 * n) = joints_m.row(j).transpose();
  if (!own.network.empty() && own.network[0].weight.cols() > 4 * k) {
    // The coefficients it is told never change: they belong to the first layer's bias.
    auto told = own.network[0].weight.middleCols(4 * k, kNetworkBetas);
    const Eigen::Index given = std::min(beta.size(), kNetworkBetas);
    own.network[0].bias += told.leftCols(given) * beta.head(given);
    told.setZero();
  }
  Prepare(own);
  return own;
}

ModelParameters RigidStart(const FootModel& foot, const Eigen::MatrixX3d& targets_m,
                           const Eigen::VectorXd& weights) {
  const Rigid3 motion = AlignRigidly(foot.coarse.template_m, targets_m, weights);
  ModelParameters start = RestParameters(foot);
  const Eigen::AngleAxisd turn(motion.rotation);
  start.theta.row(0) = turn.angle() * turn.axis().transpose();
  const Eigen::Vector3d root = foot.derived.joints_m.row(0);
  start.translation_m = motion * root - root;
  return start;
}

PersonalFit StartPerson(const FootModel& foot, std::span<const TrainingFrame> frames,
                        const PersonalOptions& options) {
  Require(!frames.empty(), "training: a person without registrations");
  constexpr std::size_t kShapeFrames = 3;
  FootModel coarse = CoarseOnly(foot);
  coarse.network.clear();
  const Eigen::Index n = foot.NumVertices();
  PersonalFit fit;
  std::vector<VertexFitResult> results;
  for (const TrainingFrame& frame : frames) {
    const Eigen::MatrixX3d target = CoarseOf(frame, n);
    results.push_back(FitVertices(coarse, Variant::kCoarse, target, RigidStart(coarse, target),
                                  {.sigma_m = options.sigma_m,
                                   .theta_sd_rad = options.theta_sd_rad,
                                   .weights = PoseWeights(frame, options.pressed_weight)}));
    fit.poses.push_back(results.back().parameters);
    fit.poses.back().beta.resize(0);
    fit.distance_m.push_back(results.back().mean_distance_m);
  }
  std::vector<double> says;
  for (std::size_t f = 0; f < frames.size(); ++f)
    says.push_back(NearRest(coarse, fit.poses[f].theta, 1) * frames[f].certainty.mean() *
                   LoadWeight(frames[f], options));
  std::vector<std::size_t> order(frames.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return says[a] > says[b];
  });
  order.resize(std::min(order.size(), kShapeFrames));
  Eigen::VectorXd beta = Eigen::VectorXd::Zero(foot.NumBetas());
  for (const std::size_t f : order)
    beta += results[f].parameters.beta / static_cast<double>(order.size());
  const Eigen::VectorXd offsets = foot.fine.shapedirs * beta;
  fit.rest_m = foot.fine.template_m +
               Eigen::Map<const Eigen::Matrix3Xd>(offsets.data(), 3, offsets.size() / 3).transpose();
  fit.joints_m = RestJoints(coarse, beta);
  return fit;
}

PersonalFit FitPerson(const FootModel& foot, std::span<const TrainingFrame> frames,
                      const PersonalFit& start, const PersonalOptions& options) {
  Require(start.poses.size() == frames.size(), "training: a person's poses and frames differ");
  FootModel coarse = CoarseOnly(foot);
  coarse.network.clear();
  const Eigen::Index n = foot.NumVertices();
  PersonalFit fit = start;
  for (int round = 0; round < options.rounds; ++round) {
    FootModel personal = PersonalModel(coarse, fit.rest_m, fit.joints_m);
    FitPoses(personal, frames, options, options.pressed_weight, fit);
    std::vector<JointEvidence> evidence;
    for (std::size_t f = 0; f < frames.size(); ++f) {
      evidence.push_back({CoarseOf(frames[f], n), Forward(personal, fit.poses[f]).vertices_m,
                          PoseSkeleton(personal, fit.poses[f].theta, {}).rotations,
                          PoseWeights(frames[f], options.pressed_weight)});
    }
    const Eigen::MatrixX3d regressed = RegressedJoints(coarse, fit.rest_m);
    fit.joints_m = FitJoints(personal, evidence, regressed,
                             {options.joint_sigma_m, options.joint_sd_m});
    personal = PersonalModel(coarse, fit.rest_m, fit.joints_m);
    FitPoses(personal, frames, options, options.pressed_weight, fit);
    fit.rest_m = RestShape(foot, personal, frames, fit, NearestShape(foot, fit.rest_m), options);
    const Rigid3 motion = AlignRigidly(fit.rest_m, foot.fine.template_m);
    Move(motion, fit.rest_m);
    Move(motion, fit.joints_m);
  }
  FitPoses(PersonalModel(coarse, fit.rest_m, fit.joints_m), frames, options,
           options.pressed_weight, fit);
  return fit;
}

PersonalFit RefitPoses(const FootModel& foot, std::span<const TrainingFrame> frames,
                       const PersonalFit& start, const Eigen::VectorXd& beta,
                       const PersonalOptions& options) {
  Require(start.poses.size() == frames.size(), "training: a person's poses and frames differ");
  PersonalFit fit = start;
  FitPoses(PersonalModel(CoarseOnly(foot), fit.rest_m, fit.joints_m, beta), frames, options,
           foot.network.empty() ? options.pressed_weight : 1, fit);
  return fit;
}

std::vector<Rigid3> BoneMotions(const FootModel& personal, const ModelParameters& pose) {
  const Skeleton skeleton = PoseSkeleton(personal, pose.theta, pose.beta);
  std::vector<Rigid3> motions;
  for (Eigen::Index j = 0; j < personal.NumJoints(); ++j) {
    Rigid3 motion;
    motion.rotation = Eigen::Quaterniond(skeleton.rotations[static_cast<std::size_t>(j)]);
    motion.translation = skeleton.offsets.col(j) + pose.translation_m;
    motions.push_back(motion);
  }
  return motions;
}

Eigen::MatrixX3d Unposed(const Eigen::MatrixX3d& posed_m, std::span<const Rigid3> motions,
                         const Eigen::MatrixXd& weights) {
  Eigen::MatrixX3d rest(posed_m.rows(), 3);
  std::vector<Eigen::Matrix3d> rotations;
  for (const Rigid3& motion : motions) rotations.push_back(motion.rotation.toRotationMatrix());
  for (Eigen::Index i = 0; i < posed_m.rows(); ++i) {
    Eigen::Matrix3d blended = Eigen::Matrix3d::Zero();
    Eigen::Vector3d place = posed_m.row(i);
    for (Eigen::Index j = 0; j < weights.cols(); ++j) {
      if (weights(i, j) == 0) continue;
      const auto at = static_cast<std::size_t>(j);
      blended += weights(i, j) * rotations[at];
      place -= weights(i, j) * motions[at].translation;
    }
    rest.row(i) = blended.inverse() * place;
  }
  return rest;
}

Eigen::VectorXd OnFine(const FootModel& foot, const Eigen::VectorXd& coarse) {
  Eigen::VectorXd fine(static_cast<Eigen::Index>(foot.upsampling.size()));
  for (std::size_t i = 0; i < foot.upsampling.size(); ++i) {
    double value = 0;
    for (const auto& [vertex, weight] : foot.upsampling[i]) value += weight * coarse[vertex];
    fine[static_cast<Eigen::Index>(i)] = value;
  }
  return fine;
}

}  // namespace sole::model
