#pragma once

#include <optional>

#include <Eigen/Core>

#include "sim/true_rig.h"

namespace sole::sim {

/// A straight piece of light; `direction` has unit length.
struct LightRay {
  Eigen::Vector3d origin;
  Eigen::Vector3d direction;
};

/// Rays of a camera's pixels in the world frame, starting at its centre, before any glass. The lens
/// is inverted by Newton's method to 1e-13.
class PixelRays {
 public:
  explicit PixelRays(const TrueCamera& camera);
  LightRay At(const Eigen::Vector2d& pixel) const;

  /// The rays around a pixel's centre: within half a pixel the lens is linear to 1e-4 px.
  struct Around {
    Eigen::Vector3d origin;
    Eigen::Vector3d centre, per_x, per_y;  ///< direction, not of unit length, and change per pixel
    LightRay At(const Eigen::Vector2d& offset) const {
      return {origin, (centre + offset.x() * per_x + offset.y() * per_y).normalized()};
    }
  };
  Around Near(const Eigen::Vector2d& pixel) const;

 private:
  double fx_, fy_, cx_, cy_, k1_, k2_, p1_, p2_;
  Eigen::Vector3d centre_;
  Eigen::Matrix3d world_from_cam_;
};
/// One such ray.
LightRay RayOfPixel(const TrueCamera& camera, const Eigen::Vector2d& pixel);

/// Pixel at which light that travels from a world direction into the camera's centre is imaged;
/// `towards` points from the centre to the scene. Empty behind the camera or beyond the lens
/// model's range.
std::optional<Eigen::Vector2d> PixelOfDirection(const TrueCamera& camera,
                                                const Eigen::Vector3d& towards);

/// Fresnel reflectance of unpolarised light; `cosine` of the angle of incidence, `ratio` = index
/// behind over index before.
double FresnelReflectance(double cosine, double ratio);

/// What a ray meets on its way to the other side of the plate.
struct PlateCrossing {
  enum class Kind { kMisses, kEdge, kThrough };
  Kind kind = Kind::kMisses;      ///< beside the plate, into its ground edge, or through both faces
  Eigen::Vector3d near_point;     ///< where it meets the nearer face
  Eigen::Vector3d far_point;      ///< where it leaves the other face
  Eigen::Vector3d direction;      ///< behind the plate
  double near_transmittance = 1;  ///< of the nearer face
  double far_transmittance = 1;
};

/// Follows a ray that starts outside the plate. Kind kMisses leaves the other fields unset.
PlateCrossing CrossPlate(const TruePlate& plate, const LightRay& ray);

/// The way of light between two points: straight where no glass lies between, else through both
/// faces.
struct LightPath {
  Eigen::Vector3d leaving;   ///< unit direction at `from`, towards `to`
  Eigen::Vector3d arriving;  ///< unit direction of travel at `to`
  double length_m = 0;       ///< geometric
  double transmittance = 1;
  bool clear = true;  ///< false if it meets the plate's edge
};

/// Path from a point outside the glass to a point at or outside its faces, or on the top of a plate that
/// sagged by less than its thickness. Through the glass by a
/// bracketed search for the sine of the angle in air that makes the lateral distances of both media
/// add up (to 1e-14 m).
LightPath PathBetween(const TruePlate& plate, const Eigen::Vector3d& from,
                      const Eigen::Vector3d& to);

}  // namespace sole::sim
