#include "app/fit_placing.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "model/foot_start.h"
#include "model/fit.h"

namespace sole::app {
namespace {

constexpr double kFootHeight_m = 0.2;  ///< of any foot, from the sole to where the model ends
constexpr std::size_t kSearchPoints = 600;

/// 32 directions all round, at most 21 degrees from any: the corners of an icosahedron and of its dual.
std::vector<Eigen::Vector3d> DirectionsAllRound() {
  const double golden = (1 + std::sqrt(5.0)) / 2;
  std::vector<Eigen::Vector3d> directions;
  for (const double s : {-1.0, 1.0}) {
    for (const double t : {-1.0, 1.0}) {
      for (int k = 0; k < 3; ++k) {
        Eigen::Vector3d corner, face;
        corner[k] = 0, corner[(k + 1) % 3] = s, corner[(k + 2) % 3] = t * golden;
        face[k] = 0, face[(k + 1) % 3] = s * golden, face[(k + 2) % 3] = t / golden;
        directions.push_back(corner.normalized());
        directions.push_back(face.normalized());
      }
      for (const double r : {-1.0, 1.0}) directions.push_back(Eigen::Vector3d(r, s, t).normalized());
    }
  }
  return directions;
}

Eigen::Matrix3d Upright(const Eigen::Vector3d& up) {
  return Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

}  // namespace

PointCloud TurnedFoot(const PointCloud& scan, const Eigen::Matrix3d& level_from_scan) {
  const Eigen::Matrix3f turn = level_from_scan.cast<float>();
  std::vector<float> heights;
  for (const Eigen::Vector3f& p : scan.points_m) heights.push_back(turn.row(2).dot(p));
  std::vector<float> sorted = heights;
  const auto low = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 100);
  std::nth_element(sorted.begin(), low, sorted.end());
  PointCloud turned;
  for (std::size_t i = 0; i < scan.Size(); ++i) {
    if (heights[i] > *low + static_cast<float>(kFootHeight_m)) continue;
    turned.points_m.push_back(turn * scan.points_m[i]);
    if (!scan.normals.empty()) turned.normals.push_back(turn * scan.normals[i]);
    if (!scan.sigma_m.empty()) turned.sigma_m.push_back(scan.sigma_m[i]);
  }
  return turned;
}

Placing FindPlacing(const PointCloud& scan, const ModelPair& models, std::optional<Eigen::Vector3d> up,
                    std::span<const Eigen::Vector3d> hints) {
  const PointCloud thinned = model::ThinForFit(scan, kSearchPoints);
  const Eigen::VectorXd beta = Eigen::VectorXd::Zero(models.right.NumBetas());
  Placing best;
  const auto attempt = [&](const Eigen::Vector3d& direction) {
    const Eigen::Matrix3d turn = Upright(direction);
    model::FootStartOptions options;
    options.points = 200;
    options.keep = 1;
    const auto starts =
        model::FindFootStarts(models.right, models.left, TurnedFoot(thinned, turn), beta, {}, {}, options);
    if (starts.empty() || starts.front().cost >= best.cost) return;
    best.cost = starts.front().cost;
    const Eigen::Vector3d root = starts.front().parameters.theta.row(0).transpose();
    const Eigen::Matrix3d level_from_foot =
        root.norm() > 0 ? Eigen::AngleAxisd(root.norm(), root.normalized()).toRotationMatrix()
                        : Eigen::Matrix3d::Identity();
    // Up is where the foot found has it, so that the fit begins with a level sole.
    best.level_from_scan =
        up ? turn : Eigen::Matrix3d(Upright(level_from_foot * Eigen::Vector3d::UnitZ()) * turn);
  };
  if (up) {
    attempt(*up);
    return best;
  }
  for (const Eigen::Vector3d& hint : hints) attempt(hint), attempt(-hint);
  for (const Eigen::Vector3d& direction : DirectionsAllRound()) attempt(direction);
  return best;
}

}  // namespace sole::app
