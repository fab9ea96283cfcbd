#include "model/train_two_joints.h"

#include <cstddef>
#include <string>

#include "core/error.h"

namespace sole::model {
namespace {

/// Of each joint: 0 shank, 1 ankle, 2 ball.
std::vector<int> GroupsOf(const FootModel& foot) {
  std::vector<int> groups;
  for (const std::string& name : foot.joint_names) {
    if (name.starts_with("toe"))
      groups.push_back(2);
    else
      groups.push_back(groups.empty() ? 0 : 1);
  }
  return groups;
}

Eigen::MatrixXd Summed(const Eigen::MatrixXd& weights, const std::vector<int>& groups) {
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(weights.rows(), 3);
  for (std::size_t j = 0; j < groups.size(); ++j)
    sums.col(groups[j]) += weights.col(static_cast<Eigen::Index>(j));
  return sums;
}

}  // namespace

FootModel TwoJointModel(const FootModel& foot) {
  const std::vector<int> groups = GroupsOf(foot);
  const auto at = [&](int j) { return groups[static_cast<std::size_t>(j)]; };
  double toes = 0;
  bool fits = groups.size() > 3 && foot.constraints.empty() &&
              foot.joint_regressor.cols() == foot.NumVertices();
  for (std::size_t j = 0; j < groups.size(); ++j) {
    const int parent = foot.parents[j];
    if (groups[j] == 2 && parent >= 0 && at(parent) == 1) ++toes;
    fits = fits && (parent < 0 || at(parent) <= groups[j]);
  }
  Require(fits && toes > 0,
          "two joints: the template's joints are not a shank, what hangs on it and toes named toe...");
  FootModel two = foot;
  two.parents = {-1, 0, 1};
  two.joint_names = {"shank", "ankle", "ball"};
  two.pose_index.resize(0, 3);
  for (ModelSurface* surface : {&two.coarse, &two.fine}) {
    surface->weights = Summed(surface->weights, groups);
    surface->posedirs.resize(3 * surface->NumVertices(), 0);
  }
  two.activations.resize(0, 0);
  two.network.clear();
  two.pose_space = {};
  two.joint_regressor = Eigen::MatrixXd::Zero(3, foot.NumVertices());
  two.joint_regressor.row(0) = foot.joint_regressor.row(0);
  two.joint_regressor.row(1) = foot.joint_regressor.row(1);
  for (std::size_t j = 0; j < groups.size(); ++j) {
    if (groups[j] == 2 && at(foot.parents[j]) == 1)
      two.joint_regressor.row(2) += foot.joint_regressor.row(static_cast<Eigen::Index>(j)) / toes;
  }
  Prepare(two);
  return two;
}

}  // namespace sole::model
