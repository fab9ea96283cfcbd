#include <algorithm>
#include <cmath>
#include <map>

#include "calib/ground.h"
#include "calib/judge.h"

namespace sole::calib {
namespace {

struct Seen {
  int camera;
  Eigen::Vector2d pixel;
};

/// Point of a corner from two or more views; not finite if they do not agree.
Eigen::Vector3d PointFrom(const Rig& rig, const std::vector<Seen>& views, double reject_px) {
  std::vector<Ray> rays;
  for (const Seen& view : views)
    rays.push_back(RayFromPixel(rig.cameras[static_cast<std::size_t>(view.camera)], rig.plate,
                                view.pixel));
  const Eigen::Vector3d point = NearestPoint(rays);
  for (const Seen& view : views) {
    const Camera& camera = rig.cameras[static_cast<std::size_t>(view.camera)];
    const double miss = (PixelFromWorld(camera, rig.plate, point) - view.pixel).norm();
    if (!(miss <= reject_px)) return Eigen::Vector3d::Constant(std::nan(""));
  }
  return point;
}

}  // namespace

std::vector<GroundMark> MeasureMarks(const Rig& rig, const RigConfig& config,
                                     const TakeObservations& take, double reject_px) {
  constexpr double kFloor_m = 2e-6;
  std::map<int, std::vector<Seen>> corners;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    for (const PointObservation& o : MeanFiducials(take, c, 0))
      corners[o.point].push_back({static_cast<int>(c), o.pixel});
  }
  std::map<int, std::vector<Eigen::Vector3d>> fiducials;  // corners of each
  for (const auto& [corner, views] : corners) {
    if (views.size() < 2) continue;
    const Eigen::Vector3d point = PointFrom(rig, views, reject_px);
    if (point.allFinite()) fiducials[corner / 4].push_back(point);
  }
  std::vector<GroundMark> marks;
  double squares = 0;
  for (const auto& [fiducial, points] : fiducials) {
    if (points.size() < 4) continue;  // the mean of fewer is not its centre
    GroundMark mark{config.plate.fiducials[static_cast<std::size_t>(fiducial)].id};
    for (const Eigen::Vector3d& point : points) mark.point_m += 0.25 * point;
    for (const Eigen::Vector3d& point : points)
      squares += std::pow(point.z() - mark.point_m.z(), 2);
    marks.push_back(mark);
  }
  // Four corners tell too little of one mark's scatter: all marks together do, divided by the three
  // free values of each and the four corners of a mean.
  const double count = std::max(1.0, static_cast<double>(marks.size()));
  const double scatter = std::sqrt(squares / (12 * count));
  for (GroundMark& mark : marks) mark.sigma_m = std::max(kFloor_m, scatter);
  return marks;
}

HeightPlane GroundShift(const GroundSurface& surface, const std::vector<GroundMark>& marks) {
  const HeightPlane before = MarksPlane(surface), now = PlaneThrough(marks);
  return {now.offset_m - before.offset_m, now.slope_x - before.slope_x,
          now.slope_y - before.slope_y};
}

}  // namespace sole::calib
