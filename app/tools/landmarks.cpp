#include "app/tools/landmarks.h"

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <limits>

#include "core/error.h"

namespace sole::tools {
namespace {

/// The vertex furthest along `direction` among those that `among` accepts.
model::Landmark Furthest(const model::FootModel& foot, const std::string& name,
                         const Eigen::Vector3d& direction,
                         const std::function<bool(Eigen::Index)>& among) {
  model::Landmark landmark{name, -1};
  double best = -std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 0; i < foot.NumVertices(); ++i) {
    const double along = foot.coarse.template_m.row(i).dot(direction);
    if (!among(i) || along <= best) continue;
    best = along;
    landmark.vertex = static_cast<int>(i);
  }
  Require(landmark.vertex >= 0, "model generator: no vertex for landmark '" + name + "'");
  return landmark;
}

}  // namespace

std::vector<model::Landmark> FindLandmarks(const model::FootModel& foot) {
  const Eigen::MatrixX3d& at = foot.coarse.template_m;
  const Eigen::MatrixXd joints = foot.joint_regressor * at;
  const auto near_y = [&](Eigen::Index joint, double width, double low, double high) {
    return [&, joint, width, low, high](Eigen::Index i) {
      return std::abs(at(i, 1) - joints(joint, 1)) < width && at(i, 2) > low && at(i, 2) < high;
    };
  };
  const double heel_y = at.col(1).minCoeff();
  const Eigen::Vector3d lateral = Eigen::Vector3d::UnitX(), forward = Eigen::Vector3d::UnitY(),
                        up = Eigen::Vector3d::UnitZ();
  std::vector<model::Landmark> landmarks;
  landmarks.push_back(
      Furthest(foot, "heel_back", -forward, [&](Eigen::Index i) { return at(i, 2) < 0.05; }));
  landmarks.push_back(
      Furthest(foot, "heel_bottom", -up, [&](Eigen::Index i) { return at(i, 1) < heel_y + 0.06; }));
  for (int toe = 1; toe <= 5; ++toe) {
    const Eigen::Index tip = 2 + 2 * toe;
    landmarks.push_back(Furthest(foot, fmt::format("toe{}_tip", toe), forward, [&](Eigen::Index i) {
      return foot.coarse.weights(i, tip) > 0.5;
    }));
  }
  landmarks.push_back(Furthest(foot, "metatarsal1_medial", -lateral, near_y(3, 0.015, -1, 1)));
  landmarks.push_back(Furthest(foot, "metatarsal5_lateral", lateral, near_y(11, 0.015, -1, 1)));
  landmarks.push_back(Furthest(foot, "malleolus_medial", -lateral, near_y(1, 0.025, 0.05, 0.09)));
  landmarks.push_back(Furthest(foot, "malleolus_lateral", lateral, near_y(1, 0.025, 0.05, 0.09)));
  return landmarks;
}

}  // namespace sole::tools
