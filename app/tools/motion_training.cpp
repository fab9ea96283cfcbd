#include "app/tools/motion_training.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <cstddef>

#include "model/corrective_fit.h"
#include "model/pose_features.h"
#include "model/shape_space.h"
#include "model/skeleton.h"
#include "model/skinning_fit.h"
#include "model/train_person.h"
#include "model/vertex_fit.h"

namespace sole::tools {
namespace {

/// The model with one person's rest shape and joints, and no shape coefficients.
model::FootModel PersonalModel(const model::FootModel& foot, const Person& person) {
  model::FootModel own = foot;
  const Eigen::Index n = foot.NumVertices(), k = foot.NumJoints();
  own.fine.template_m = person.rest_m;
  own.coarse.template_m = person.rest_m.topRows(n);
  own.fine.shapedirs.resize(3 * person.rest_m.rows(), 0);
  own.coarse.shapedirs.resize(3 * n, 0);
  own.joint_regressor = Eigen::MatrixXd::Zero(3 * k, 3 * n + 1);
  for (Eigen::Index j = 0; j < k; ++j)
    own.joint_regressor.block<3, 1>(3 * j, 3 * n) = person.joints_m.row(j).transpose();
  Prepare(own);
  return own;
}

/// A posed foot with the pose that explains it.
struct Explained {
  model::ModelParameters parameters;
  model::PosedSample sample;
  double mean_distance_m = 0;
};

Explained Explain(const model::FootModel& own, const Person& person,
                  const Eigen::MatrixX3d& posed) {
  const Eigen::MatrixX3d target = posed.topRows(own.NumVertices());
  const model::VertexFitResult fit =
      FitVertices(own, model::Variant::kCoarse, target, model::RigidStart(own, target));
  Explained explained{fit.parameters, {person.rest_m, posed, {}}, fit.mean_distance_m};
  const model::Skeleton skeleton = PoseSkeleton(own, fit.parameters.theta, fit.parameters.beta);
  for (Eigen::Index j = 0; j < own.NumJoints(); ++j) {
    Rigid3 motion;
    motion.rotation = Eigen::Quaterniond(skeleton.rotations[static_cast<std::size_t>(j)]);
    motion.translation = skeleton.offsets.col(j) + fit.parameters.translation_m;
    explained.sample.posed_from_rest.push_back(motion);
  }
  return explained;
}

std::vector<Explained> ExplainAll(std::span<const Person> people, const model::FootModel& foot) {
  std::vector<std::vector<Explained>> by_person(people.size());
  tbb::parallel_for(std::size_t{0}, people.size(), [&](std::size_t p) {
    const model::FootModel own = PersonalModel(foot, people[p]);
    for (const Eigen::MatrixX3d& posed : people[p].posed_m)
      by_person[p].push_back(Explain(own, people[p], posed));
  });
  std::vector<Explained> all;
  for (std::vector<Explained>& some : by_person) {
    for (Explained& one : some) all.push_back(std::move(one));
  }
  return all;
}

double MeanDistance(const std::vector<Explained>& all) {
  double sum = 0;
  for (const Explained& one : all) sum += one.mean_distance_m / static_cast<double>(all.size());
  return sum;
}

void SetWeights(const Eigen::MatrixXd& weights, model::FootModel& foot) {
  foot.fine.weights = weights;
  foot.coarse.weights = weights.topRows(foot.NumVertices());
}

/// What the linear model lacks in the rest pose, stacked: the residual turned back by each vertex's
/// blended rotation.
Eigen::VectorXd RestOffsets(const Explained& one, const Eigen::MatrixXd& weights) {
  Eigen::VectorXd offsets(3 * weights.rows());
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    Eigen::Matrix3d blended = Eigen::Matrix3d::Zero();
    Eigen::Vector3d residual = one.sample.posed_m.row(i);
    for (Eigen::Index j = 0; j < weights.cols(); ++j) {
      if (weights(i, j) == 0) continue;
      const Rigid3& motion = one.sample.posed_from_rest[static_cast<std::size_t>(j)];
      blended += weights(i, j) * motion.rotation.toRotationMatrix();
      residual -= weights(i, j) * (motion * one.sample.rest_m.row(i).transpose());
    }
    offsets.segment<3>(3 * i) = blended.inverse() * residual;
  }
  return offsets;
}

/// A joint corrects the vertices that it or its neighbours in the tree move.
Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic> CorrectiveMask(
    const Eigen::MatrixXd& weights, const std::vector<int>& parents) {
  Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic> mask =
      Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic>::Constant(weights.rows(),
                                                                    4 * weights.cols(), false);
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    for (std::size_t j = 1; j < parents.size(); ++j) {
      const auto column = static_cast<Eigen::Index>(j);
      // The joint bends the skin where both sides of it pull.
      if (weights(i, column) > 0.01 && weights(i, column) + weights(i, parents[j]) > 0.02)
        mask.block(i, 4 * column, 1, 4).setConstant(true);
    }
  }
  return mask;
}

void AddCorrectives(const std::vector<Explained>& all, model::FootModel& foot) {
  std::vector<Eigen::VectorXd> offsets, features;
  for (const Explained& one : all) {
    offsets.push_back(RestOffsets(one, foot.fine.weights));
    features.push_back(model::PoseFeatures(foot.family, one.parameters.theta, one.parameters.beta));
  }
  foot.fine.posedirs = model::FitCorrectives(offsets, features,
                                             CorrectiveMask(foot.fine.weights, foot.parents), 1e-3);
  foot.coarse.posedirs = foot.fine.posedirs.topRows(3 * foot.NumVertices());
}

}  // namespace

std::vector<Eigen::Vector3d> PointsToVector(const Eigen::MatrixX3d& points) {
  std::vector<Eigen::Vector3d> result;
  for (Eigen::Index i = 0; i < points.rows(); ++i) result.emplace_back(points.row(i));
  return result;
}

void LearnMotion(std::span<const Person> people, const Eigen::MatrixXd& shares, int rounds,
                 bool correctives, model::FootModel& foot,
                 const std::function<void(const std::string&)>& log) {
  const Eigen::MatrixXd prior = model::WidenedWeights(shares, foot.parents);
  SetWeights(shares, foot);
  for (int round = 0; round < rounds; ++round) {
    const std::vector<Explained> all = ExplainAll(people, foot);
    log(fmt::format("round {}: posed training feet explained to {:.3f} mm", round,
                    1e3 * MeanDistance(all)));
    std::vector<model::PosedSample> samples;
    for (const Explained& one : all) samples.push_back(one.sample);
    SetWeights(model::FitSkinningWeights(samples, prior), foot);
  }
  const std::vector<Explained> all = ExplainAll(people, foot);
  log(fmt::format("skinning: {:.3f} mm", 1e3 * MeanDistance(all)));
  if (!correctives) return;
  AddCorrectives(all, foot);
  log(fmt::format("with correctives: {:.3f} mm", 1e3 * MeanDistance(ExplainAll(people, foot))));
}

}  // namespace sole::tools
