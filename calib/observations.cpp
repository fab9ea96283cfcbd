#include "calib/observations.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace sole::calib {

std::vector<Eigen::Vector3d> TargetCorners(const CalibrationBody& body) {
  std::vector<Eigen::Vector3d> corners;
  for (const CharucoFace& face : body.faces) {
    const int count = (face.squares_x - 1) * (face.squares_y - 1);
    for (int corner = 0; corner < count; ++corner) corners.push_back(CornerInBody(face, corner));
  }
  return corners;
}

std::vector<Eigen::Vector3d> FiducialCornerPoints(const PlateConfig& plate) {
  std::vector<Eigen::Vector3d> corners;
  for (const Fiducial& fiducial : plate.fiducials) {
    for (const Eigen::Vector3d& corner : FiducialCorners(fiducial)) corners.push_back(corner);
  }
  return corners;
}

std::vector<PointObservation> MeanFiducials(const TakeObservations& observations,
                                            std::size_t camera, double sigma_floor_px) {
  std::map<int, std::vector<PointObservation>> seen;
  for (const auto& frame : observations.frames) {
    for (const PointObservation& o : frame[camera].fiducials) seen[o.point].push_back(o);
  }
  std::vector<PointObservation> means;
  for (auto& [point, views] : seen) {
    Eigen::Vector2d median;
    for (int axis = 0; axis < 2; ++axis) {
      const auto middle = views.begin() + static_cast<std::ptrdiff_t>(views.size() / 2);
      std::nth_element(views.begin(), middle, views.end(), [axis](const auto& a, const auto& b) {
        return a.pixel[axis] < b.pixel[axis];
      });
      median[axis] = middle->pixel[axis];
    }
    PointObservation mean{point, Eigen::Vector2d::Zero(), 0};
    int count = 0;
    for (const PointObservation& o : views) {
      if ((o.pixel - median).norm() > 0.5) continue;
      mean.pixel += o.pixel;
      mean.sigma_px += o.sigma_px * o.sigma_px;
      ++count;
    }
    if (2 * static_cast<std::size_t>(count) < views.size())
      continue;  // not one place: a wrong marker
    mean.pixel /= count;
    mean.sigma_px = std::hypot(std::sqrt(mean.sigma_px) / count, sigma_floor_px);
    means.push_back(mean);
  }
  return means;
}

}  // namespace sole::calib
