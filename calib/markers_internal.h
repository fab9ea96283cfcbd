#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/image.h"

namespace sole::calib {

using Quad = std::array<Eigen::Vector2d, 4>;

/// A decoded marker, corners in OpenCV's order.
struct Marker {
  int id;
  Quad corners;
};

/// Markers of one of OpenCV's dictionaries (number of its enumeration) with a black border of
/// `border_cells` cells. `mirrored`: those that are legible in the flipped image.
std::vector<Marker> FindMarkers(const ImageU8& image, bool mirrored, int dictionary,
                                int border_cells = 1);

/// A plane-to-image homography and how well it fits.
struct Homography {
  Eigen::Matrix3d image_from_plane;

  Eigen::Vector2d operator*(const Eigen::Vector2d& p) const {
    return (image_from_plane * p.homogeneous()).hnormalized();
  }
  /// Derivative: image displacement per unit along x and y.
  Eigen::Matrix2d JacobianAt(const Eigen::Vector2d& p) const {
    const Eigen::Vector3d h = image_from_plane * p.homogeneous();
    return (image_from_plane.topLeftCorner<2, 2>() -
            h.hnormalized() * image_from_plane.row(2).head<2>()) /
           h.z();
  }
};

/// Homography through the corners of markers at known places in a plane; `inlier` tells which
/// markers agree within `tolerance_px`. Empty if fewer than `min_markers` do.
std::optional<Homography> FitPlane(const std::vector<Marker>& markers,
                                   const std::vector<Quad>& in_plane, double tolerance_px,
                                   int min_markers, std::vector<bool>& inlier);

}  // namespace sole::calib
