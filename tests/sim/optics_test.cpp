// Rendered pictures through the plate against closed form. The analytic side is written here: it
// shares no code with the renderer, nor with calib/ and recon/.
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "core/target.h"
#include "sim/renderer.h"
#include "sim/truth_maps.h"

namespace sole::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kFocal_px = 3250;

struct Line {
  Vector3d origin, direction;
};

/// The ray of a pixel beyond the plate: parallel to itself, the origin moved along the normal by
/// s(a) = t (1 - cos a / sqrt(n^2 - sin^2 a)).
Line AnalyticRay(const TrueCamera& c, const TruePlate& plate, const Vector2d& pixel) {
  const Vector2d seen((pixel.x() - c.cx) / c.fx, (pixel.y() - c.cy) / c.fy);
  Vector2d p = seen;
  for (int i = 0; i < 60; ++i) {  // undoes the lens by fixed-point iteration
    const double r2 = p.squaredNorm(), stretch = 1 + c.k1 * r2 + c.k2 * r2 * r2;
    const Vector2d tangential(2 * c.p1 * p.x() * p.y() + c.p2 * (r2 + 2 * p.x() * p.x()),
                              c.p1 * (r2 + 2 * p.y() * p.y()) + 2 * c.p2 * p.x() * p.y());
    p = (seen - tangential) / stretch;
  }
  const Eigen::Matrix3d world_from_cam =
      c.cam_from_world.rotation.toRotationMatrix().transpose();
  const Vector3d direction = (world_from_cam * Vector3d(p.x(), p.y(), 1)).normalized();
  Vector3d origin = -(world_from_cam * c.cam_from_world.translation);
  const double cosine = std::abs(direction.z()), n2 = plate.index * plate.index;
  const double s = plate.thickness_m * (1 - cosine / std::sqrt(n2 - 1 + cosine * cosine));
  origin.z() += std::copysign(s, direction.z());
  return {origin, direction};
}

/// A camera under the glass that looks at `target` at this angle to the plate's normal.
TrueCamera CameraAt(double degrees, const Vector3d& target, int side_px) {
  CameraConfig config;
  config.position_m =
      target + 0.62 * Vector3d(std::sin(degrees * kDegree), 0, -std::cos(degrees * kDegree));
  config.look_at_m = target;
  config.up = Vector3d::UnitY();
  TrueCamera camera;
  camera.serial = "A";
  camera.width = camera.height = side_px;
  camera.fx = kFocal_px;
  camera.fy = kFocal_px + 3;
  camera.cx = 0.5 * side_px + 7;
  camera.cy = 0.5 * side_px - 5;
  camera.k1 = -0.08;
  camera.k2 = 0.03;
  camera.p1 = 2e-4;
  camera.p2 = -3e-4;
  camera.cam_from_world = NominalCamFromWorld(config);
  return camera;
}

/// The default rig with nothing but this camera.
RigConfig OneCamera(const TrueCamera& camera) {
  RigConfig config = MakeDefaultRig();
  config.cameras.resize(1);
  config.cameras[0].width = camera.width;
  config.cameras[0].height = camera.height;
  config.pairs.clear();
  config.simulation.projectors.clear();  // texture light is enough
  return config;
}

const TruePlate kPlate{0.4, 0.5, 0.0152, 1.518};

TEST(Optics, TracedRaysThroughThePlateLandWithinAHundredthPixelOfClosedForm) {
  constexpr double kHeight = 0.03;  // of a level sheet over the plate
  SceneMesh sheet;
  sheet.mesh.vertices = {{-0.3, -0.3, kHeight}, {0.3, -0.3, kHeight}, {0.3, 0.3, kHeight},
                         {-0.3, 0.3, kHeight}};
  sheet.mesh.triangles = {{0, 2, 1}, {0, 3, 2}};
  for (int degrees = 0; degrees <= 60; degrees += 5) {
    TrueRig rig{{CameraAt(degrees, {0, 0, kHeight}, 200)}, kPlate};
    const Renderer renderer(OneCamera(rig.cameras[0]), rig, {.noise = 0});
    Scene scene;
    scene.meshes = {sheet};
    const TruthMaps maps = MapTruth(renderer, renderer.Prepare(scene), 0);
    for (int y = 0; y < 200; y += 33) {
      for (int x = 0; x < 200; x += 33) {
        ASSERT_EQ(maps.mesh.At(x, y), 0) << degrees << " degrees, pixel " << x << ", " << y;
        const Line ray = AnalyticRay(rig.cameras[0], kPlate, Vector2d(x, y));
        const double way = (kHeight - ray.origin.z()) / ray.direction.z();
        const Vector3d off =
            maps.point_m.At(x, y).cast<double>() - (ray.origin + way * ray.direction);
        const double across = (off - off.dot(ray.direction) * ray.direction).norm();
        EXPECT_LT(across / way * kFocal_px, 0.01) << degrees << " degrees, pixel " << x << ", " << y;
      }
    }
  }
}

/// By how many pixels the image of a chessboard corner is displaced against a picture of it painted
/// from analytic rays (black where the board coordinates have the same sign), blurred as the camera
/// does. Least squares over shift, contrast and brightness.
Vector2d Displacement(const ImageU8& image, const TrueCamera& camera,
                      const Rigid3& board_from_world, const Vector2d& corner, const Vector2d& at) {
  constexpr int kHalf = 6, kPad = 4, kSide = 2 * (kHalf + kPad) + 1, kFine = 12;
  const int cx = static_cast<int>(std::lround(at.x())), cy = static_cast<int>(std::lround(at.y()));
  cv::Mat painted(kSide, kSide, CV_64F, cv::Scalar(0));
  for (int i = 0; i < kSide * kSide * kFine * kFine; ++i) {
    const int fine_x = i % (kSide * kFine), fine_y = i / (kSide * kFine);
    const Line ray = AnalyticRay(camera, kPlate,
                                 {cx - kHalf - kPad - 0.5 + (fine_x + 0.5) / kFine,
                                  cy - kHalf - kPad - 0.5 + (fine_y + 0.5) / kFine});
    const Vector3d o = board_from_world * ray.origin, d = board_from_world.rotation * ray.direction;
    const Vector2d p = (o - o.z() / d.z() * d).head<2>() - corner;
    painted.at<double>(fine_y / kFine, fine_x / kFine) +=
        p.x() * p.y() > 0 ? 0.0 : 1.0 / (kFine * kFine);
  }
  cv::GaussianBlur(painted, painted, {7, 7}, camera.blur_px, camera.blur_px);
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  for (int y = kPad; y < kSide - kPad; ++y) {
    for (int x = kPad; x < kSide - kPad; ++x) {
      const Eigen::Vector4d row(0.5 * (painted.at<double>(y, x + 1) - painted.at<double>(y, x - 1)),
                                0.5 * (painted.at<double>(y + 1, x) - painted.at<double>(y - 1, x)),
                                painted.at<double>(y, x), 1);
      normal += row * row.transpose();
      right += row * image.At(cx - kHalf - kPad + x, cy - kHalf - kPad + y);
    }
  }
  const Eigen::Vector4d solution = normal.ldlt().solve(right);
  return -solution.head<2>() / solution[2];
}

/// The pixel whose analytic ray meets a board's corner, by Newton's method with differences.
Vector2d PixelOf(const TrueCamera& camera, const Rigid3& board_from_world, const Vector2d& corner) {
  const auto on_board = [&](const Vector2d& pixel) {
    const Line ray = AnalyticRay(camera, kPlate, pixel);
    const Vector3d o = board_from_world * ray.origin, d = board_from_world.rotation * ray.direction;
    return Vector2d((o - o.z() / d.z() * d).head<2>() - corner);
  };
  Vector2d pixel(camera.cx, camera.cy);
  for (int i = 0; i < 8; ++i) {
    const Vector2d value = on_board(pixel);
    Eigen::Matrix2d jacobian;
    jacobian.col(0) = on_board(pixel + Vector2d::UnitX()) - value;
    jacobian.col(1) = on_board(pixel + Vector2d::UnitY()) - value;
    pixel -= jacobian.inverse() * value;
  }
  return pixel;
}

TEST(Optics, CornersInPicturesStandWithinAHundredthPixelOfClosedForm) {
  for (int degrees = 0; degrees <= 60; degrees += 10) {
    // One face of the cube is square to the view, a few centimetres over the glass.
    const Vector3d view(std::sin(degrees * kDegree), 0, -std::cos(degrees * kDegree));
    const Vector3d centre(-0.09 * view.x(), 0, 0.1);  // so that no ray meets the plate's edge
    TrueRig rig{{CameraAt(degrees, centre + 0.05 * view, 700)}, kPlate};
    const RigConfig config = OneCamera(rig.cameras[0]);
    const Renderer renderer(config, rig, {.noise = 0});
    const CalibrationBody cube =
        MakeCalibrationCube(config.target.edge_m, config.target.squares, config.target.square_m,
                            config.target.marker_m);
    const CharucoFace& face = cube.faces[0];
    const Vector3d outward = face.body_from_board.rotation * -Vector3d::UnitZ();
    Scene scene;
    scene.exposure = ExposureKind::kTexture;
    scene.fiducials = scene.dust = false;
    scene.world_from_target = Rigid3{
        Eigen::Quaterniond(Eigen::AngleAxisd(0.2, view)) *
            Eigen::Quaterniond::FromTwoVectors(outward, view),
        centre};
    const ImageU8 image = renderer.Render(renderer.Prepare(scene), 0, 1);
    const Rigid3 board_from_world = (*scene.world_from_target * face.body_from_board).Inverse();
    for (const int i : {0, 3, 5, 10, 12, 15}) {
      const Vector2d corner = (face.body_from_board.Inverse() * CornerInBody(face, i)).head<2>();
      const Vector2d at = PixelOf(rig.cameras[0], board_from_world, corner);
      ASSERT_GT(at.minCoeff(), 20);
      ASSERT_LT(at.maxCoeff(), 680);
      EXPECT_LT(Displacement(image, rig.cameras[0], board_from_world, corner, at).norm(), 0.01)
          << degrees << " degrees, corner " << i;
    }
  }
}

}  // namespace
}  // namespace sole::sim
