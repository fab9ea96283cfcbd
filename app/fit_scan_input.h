#pragma once

#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include "core/point_cloud.h"
#include "io/scan_file.h"

namespace sole::app {

/// Points of a scan file for the fit: metres, axes of the file, origin in the middle of the scan.
struct ScanPoints {
  PointCloud cloud;
  double unit_m = 1;                                     ///< of the file's numbers
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();    ///< file coordinates times unit_m = cloud point + middle
  std::size_t left_out = 0;                              ///< vertices that are not numbers
};

/// Draws `count` points evenly over the surface, or takes every k-th of a file of points alone. Without a unit the size
/// tells millimetres from metres. Triangles that face inwards as a whole are turned over; so are a file's own normals.
/// Throws Error, beginning with `name`, where too few points are left or no unit makes it a foot's size.
ScanPoints PointsOfScan(const io::ScanFile& file, const std::string& name, std::optional<double> unit_m,
                        std::size_t count = 30000);

}  // namespace sole::app
