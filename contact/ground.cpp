#include "contact/ground.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>
#include <pcl/ModelCoefficients.h>
#include <pcl/point_types.h>
#include <pcl/segmentation/sac_segmentation.h>

namespace sole::contact {
namespace {

/// Indices of the platform points that lie on one near-horizontal plane once `before` is taken off.
std::vector<int> PlaneInliers(const PointCloud& platform, const HeightPlane& before, const GroundOptions& options) {
  pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  cloud->reserve(platform.Size());
  for (const Eigen::Vector3f& p : platform.points_m) {
    cloud->emplace_back(p.x(), p.y(), p.z() - static_cast<float>(before.At(p.head<2>().cast<double>())));
  }
  pcl::SACSegmentation<pcl::PointXYZ> segmentation;
  segmentation.setModelType(pcl::SACMODEL_PERPENDICULAR_PLANE);
  segmentation.setAxis(Eigen::Vector3f::UnitZ());
  segmentation.setEpsAngle(0.02);
  segmentation.setMethodType(pcl::SAC_RANSAC);
  segmentation.setMaxIterations(200);
  segmentation.setDistanceThreshold(options.inlier_distance_m);
  segmentation.setInputCloud(cloud);
  pcl::PointIndices inliers;
  pcl::ModelCoefficients plane;
  segmentation.segment(inliers, plane);
  return {inliers.indices.begin(), inliers.indices.end()};
}

}  // namespace

GroundPlane EstimateGround(const PointCloud& platform, const GroundSurface& calibrated, const GroundOptions& options) {
  GroundPlane ground;
  ground.offset_m = calibrated.plane.offset_m;
  ground.slope_x = calibrated.plane.slope_x;
  ground.slope_y = calibrated.plane.slope_y;
  ground.sigma_m = options.prior_sigma_m;
  if (platform.Size() < static_cast<std::size_t>(options.minimum_points)) return ground;
  const HeightPlane before = MarksPlane(calibrated);
  const std::vector<int> inliers = PlaneInliers(platform, before, options);
  if (inliers.size() < static_cast<std::size_t>(options.minimum_points)) return ground;

  // z - before = offset + slope_x x + slope_y y. Neighbouring points share calibration and matching errors, so their
  // mean is never trusted better than a hundredth of the points' own scatter would allow.
  const double prior_offset = 1 / (options.prior_sigma_m * options.prior_sigma_m);
  const double prior_tilt = 1 / (options.prior_tilt_sigma * options.prior_tilt_sigma);
  Eigen::Matrix3d normal = Eigen::Vector3d(prior_offset, prior_tilt, prior_tilt).asDiagonal();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  const double share = std::min(1.0, 100.0 / static_cast<double>(inliers.size()));
  for (const int index : inliers) {
    const auto i = static_cast<std::size_t>(index);
    const double sigma =
        platform.sigma_m.empty() ? 1e-4 : std::max<double>(platform.sigma_m[i], 2e-5);
    const Eigen::Vector3d p = platform.points_m[i].cast<double>();
    const Eigen::Vector3d row(1, p.x(), p.y());
    const double weight = share / (sigma * sigma);
    normal += weight * row * row.transpose();
    right += weight * (p.z() - before.At(p.head<2>())) * row;
  }
  const Eigen::LDLT<Eigen::Matrix3d> factor(normal);
  const Eigen::Vector3d solution = factor.solve(right);
  ground.offset_m += solution[0];
  ground.slope_x += solution[1];
  ground.slope_y += solution[2];
  ground.sigma_m = std::sqrt(factor.solve(Eigen::Matrix3d::Identity())(0, 0));
  ground.points = static_cast<int>(inliers.size());
  return ground;
}

double Gap(const GroundPlane& ground, const Eigen::Vector3d& point, const GroundSurface& calibrated) {
  const double height =
      point.z() - (ground.offset_m + ground.slope_x * point.x() + ground.slope_y * point.y()) -
      ResidualAt(calibrated, point.head<2>());
  return height / std::sqrt(1 + ground.slope_x * ground.slope_x + ground.slope_y * ground.slope_y);
}

}  // namespace sole::contact
