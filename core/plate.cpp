#include "core/plate.h"

#include <limits>

namespace sole {

Eigen::Vector2d PixelFromWorld(const Camera& camera, const Plate& plate,
                               const Eigen::Vector3d& point_in_world) {
  const Eigen::Vector3d apparent =
      ApparentPoint<double>(plate.thickness_m, plate.index, camera.CentreInWorld(), point_in_world);
  const Eigen::Vector3d point_in_cam = camera.cam_from_world * apparent;
  if (!(point_in_cam.z() > 0)) {
    return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  }
  return PixelFromPointInCam<double>(camera.intrinsics.data(), point_in_cam);
}

Ray RayFromPixel(const Camera& camera, const Plate& plate, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d n = NormalizedFromPixel(camera.intrinsics, pixel);
  const Rigid3 world_from_cam = camera.cam_from_world.Inverse();
  Ray ray{world_from_cam.translation, world_from_cam.rotation * n.homogeneous().normalized()};
  const bool looks_through = ray.origin.z() < -plate.thickness_m && ray.direction.z() > 1e-6;
  if (looks_through) {
    const double cosine = ray.direction.z();
    const double sine2 = 1 - cosine * cosine;
    ray.origin.z() +=
        plate.thickness_m * (1 - cosine / std::sqrt(plate.index * plate.index - sine2));
  }
  return ray;
}

RayIntersection IntersectRays(const Ray& a, const Ray& b) {
  const Eigen::Vector3d w = a.origin - b.origin;
  const double cosine = a.direction.dot(b.direction);
  const double denominator = 1 - cosine * cosine;
  const double da = a.direction.dot(w), db = b.direction.dot(w);
  const double s = (cosine * db - da) / denominator;
  const double t = (db - cosine * da) / denominator;
  const Eigen::Vector3d pa = a.origin + s * a.direction, pb = b.origin + t * b.direction;
  return {0.5 * (pa + pb), (pa - pb).norm()};
}

}  // namespace sole
