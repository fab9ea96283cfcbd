#include "sim/renderer.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>
#include <tbb/global_control.h>

#include "core/camera.h"
#include "core/error.h"
#include "core/plate.h"
#include "core/target.h"
#include "sim/truth_maps.h"
#include "tests/sim/test_bodies.h"

namespace sole::sim {
namespace {

using Corners = std::vector<Eigen::Vector2d>;

/// The product's own camera model with the true values: an oracle that shares no code with the
/// renderer.
Camera Oracle(const TrueCamera& truth) {
  Camera camera;
  camera.serial = truth.serial;
  camera.width = truth.width;
  camera.height = truth.height;
  camera.intrinsics << truth.fx, truth.fy, truth.cx, truth.cy, truth.k1, truth.k2, truth.p1,
      truth.p2, 0;
  camera.cam_from_world = truth.cam_from_world;
  return camera;
}

Eigen::Vector2d OraclePixel(const TrueRig& rig, int camera, const Eigen::Vector3d& point) {
  const Plate plate{rig.plate.thickness_m, rig.plate.index};
  return PixelFromWorld(Oracle(rig.cameras[static_cast<std::size_t>(camera)]), plate, point);
}

/// Corners of every marker OpenCV finds, by id. `mirrored`: seen from behind, so the image is
/// flipped first and the found positions are flipped back.
std::map<int, Corners> Detect(const ImageU8& image, bool mirrored) {
  cv::Mat mat(image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data()));
  if (mirrored) cv::flip(mat.clone(), mat, 1);
  auto parameters = cv::aruco::DetectorParameters::create();
  parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
  parameters->cornerRefinementWinSize = 3;
  std::vector<int> ids;
  std::vector<std::vector<cv::Point2f>> found;
  cv::aruco::detectMarkers(mat, cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_250), found,
                           ids, parameters);
  std::map<int, Corners> markers;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    for (const cv::Point2f& p : found[i]) {
      const double x = static_cast<double>(p.x);
      markers[ids[i]].emplace_back(mirrored ? image.width - 1 - x : x, static_cast<double>(p.y));
    }
  }
  return markers;
}

/// World corners of a marker of the cube, in OpenCV's order.
std::vector<Eigen::Vector3d> MarkerOnCube(const CharucoFace& face, int id,
                                          const Rigid3& world_from_body) {
  const int square =
      2 * (id - face.first_id) + 1;  // every second square is white, beginning with the second
  const double x = (square % face.squares_x + 0.5) * face.square_m,
               y = (square / face.squares_x + 0.5) * face.square_m;
  const double h = 0.5 * face.marker_m;
  std::vector<Eigen::Vector3d> corners;
  for (const auto& [dx, dy] : {std::pair{-h, -h}, {h, -h}, {h, h}, {-h, h}}) {
    corners.push_back(world_from_body *
                      (face.body_from_board * Eigen::Vector3d(x + dx, y + dy, 0)));
  }
  return corners;
}

class RendererTest : public testing::Test {
 protected:
  static constexpr std::uint64_t kSeed = 3;
  RigConfig config_ = MakeDefaultRig(4, 812, 618);
  TrueRig rig_ = DrawTrueRig(config_, kSeed);
};

TEST_F(RendererTest, MarkersOfTheCubeHaveTheirIdsAndPlaces) {
  const Renderer renderer(config_, rig_, {.noise = 0});
  const CalibrationBody cube =
      MakeCalibrationCube(config_.target.edge_m, config_.target.squares, config_.target.square_m,
                          config_.target.marker_m);
  Scene scene;
  scene.exposure = ExposureKind::kTexture;
  scene.fiducials = false;
  // Turned and tilted so that the cameras at the side see a face, too.
  scene.world_from_target =
      Rigid3{Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d(0.2, 1, 0).normalized())),
             Eigen::Vector3d(0.0, 0.02, 0.085)};
  const PreparedScene prepared = renderer.Prepare(scene);
  for (const int camera : {0, 3}) {
    const auto markers = Detect(renderer.Render(prepared, camera, 1), false);
    EXPECT_GE(markers.size(), 10U) << "camera " << camera;
    int precise = 0;
    for (const auto& [id, corners] : markers) {
      ASSERT_LT(id, 60);
      const CharucoFace& face = cube.faces[static_cast<std::size_t>(id / 12)];
      Corners truth;
      double shortest = 1e9;
      for (const Eigen::Vector3d& corner : MarkerOnCube(face, id, *scene.world_from_target)) {
        truth.push_back(OraclePixel(rig_, camera, corner));
        if (truth.size() > 1)
          shortest = std::min(shortest, (truth.back() - truth[truth.size() - 2]).norm());
      }
      // OpenCV places the corners of strongly foreshortened markers badly; those only tell the
      // order.
      const double tolerance = shortest > 24 ? 1.5 : 0.3 * shortest;
      precise += shortest > 24;
      for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_LT((corners[i] - truth[i]).norm(), tolerance)
            << "camera " << camera << " marker " << id << " corner " << i;
      }
    }
    EXPECT_GE(precise, 8) << "camera " << camera;
  }
}

/// Where the oracle's ray of a pixel meets a board, board coordinates.
Eigen::Vector2d OnBoard(const TrueRig& rig, int camera, const Rigid3& board_from_world,
                        const Eigen::Vector2d& pixel) {
  const Plate plate{rig.plate.thickness_m, rig.plate.index};
  const Ray ray = RayFromPixel(Oracle(rig.cameras[static_cast<std::size_t>(camera)]), plate, pixel);
  const Eigen::Vector3d origin = board_from_world * ray.origin,
                        direction = board_from_world.rotation * ray.direction;
  return (origin - origin.z() / direction.z() * direction).head<2>();
}

/// By how many pixels the image of a chessboard corner is displaced against a picture of it painted
/// from the oracle's rays (black where the board coordinates have the same sign), blurred as the
/// camera does. Least squares over shift, contrast and brightness.
Eigen::Vector2d Displacement(const ImageU8& image, const TrueRig& rig, int camera,
                             const Rigid3& board_from_world, const Eigen::Vector2d& corner,
                             const Eigen::Vector2d& corner_pixel) {
  constexpr int kHalf = 6, kPad = 4, kSide = 2 * (kHalf + kPad) + 1, kFine = 12;
  const int cx = static_cast<int>(std::lround(corner_pixel.x())),
            cy = static_cast<int>(std::lround(corner_pixel.y()));
  cv::Mat painted(kSide, kSide, CV_64F, cv::Scalar(0));
  for (int i = 0; i < kSide * kSide * kFine * kFine; ++i) {
    const int fine_x = i % (kSide * kFine), fine_y = i / (kSide * kFine);
    const Eigen::Vector2d pixel(cx - kHalf - kPad - 0.5 + (fine_x + 0.5) / kFine,
                                cy - kHalf - kPad - 0.5 + (fine_y + 0.5) / kFine);
    const Eigen::Vector2d p = OnBoard(rig, camera, board_from_world, pixel) - corner;
    painted.at<double>(fine_y / kFine, fine_x / kFine) +=
        p.x() * p.y() > 0 ? 0.0 : 1.0 / (kFine * kFine);
  }
  const double blur = rig.cameras[static_cast<std::size_t>(camera)].blur_px;
  cv::GaussianBlur(painted, painted, {7, 7}, blur, blur);
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

TEST_F(RendererTest, CornersStandWhereTheyBelongInAirAndThroughGlass) {
  const Renderer renderer(config_, rig_, {.noise = 0});
  const CalibrationBody cube =
      MakeCalibrationCube(config_.target.edge_m, config_.target.squares, config_.target.square_m,
                          config_.target.marker_m);
  const CharucoFace& face = cube.faces[0];
  for (const int camera : {0, 2}) {
    // Lays a face nearly square to the camera, 6 cm above the glass.
    const Eigen::Vector3d view =
        rig_.cameras[static_cast<std::size_t>(camera)].Centre().normalized();
    Scene scene;
    scene.exposure = ExposureKind::kTexture;
    scene.fiducials = scene.dust = false;
    scene.world_from_target =
        Rigid3{Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d(0.15, 0.1, -1), view) *
                   Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ())),
               Eigen::Vector3d(0.0, 0.0, 0.09)};
    const ImageU8 image = renderer.Render(renderer.Prepare(scene), camera, 1);
    const Rigid3 world_from_board = *scene.world_from_target * face.body_from_board;
    for (const int i : {0, 2, 5, 7, 9, 12, 14, 15}) {
      const Eigen::Vector3d corner = CornerInBody(face, i);
      const Eigen::Vector2d on_board = (face.body_from_board.Inverse() * corner).head<2>();
      const Eigen::Vector2d pixel = OraclePixel(rig_, camera, *scene.world_from_target * corner);
      EXPECT_LT(
          Displacement(image, rig_, camera, world_from_board.Inverse(), on_board, pixel).norm(),
          0.01)
          << "camera " << camera << " corner " << i;
    }
  }
}

TEST_F(RendererTest, FiducialsAreUprightFromAboveAndMirroredFromBelow) {
  const Renderer renderer(config_, rig_, {.noise = 0});
  Scene scene;
  scene.exposure = ExposureKind::kTexture;
  const PreparedScene prepared = renderer.Prepare(scene);
  for (const int camera : {1, 2}) {
    const auto markers = Detect(renderer.Render(prepared, camera, 1), camera < 2);
    EXPECT_GE(markers.size(), 7U) << "camera " << camera;
    for (const Fiducial& fiducial : config_.plate.fiducials) {
      if (!markers.contains(fiducial.id)) continue;
      const auto truth = FiducialCorners(fiducial);
      for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_LT((markers.at(fiducial.id)[i] - OraclePixel(rig_, camera, truth[i])).norm(), 1.5)
            << "camera " << camera << " fiducial " << fiducial.id << " corner " << i;
      }
    }
  }
}

TEST_F(RendererTest, FiducialsGoDownWithTheGlass) {
  constexpr double kDown_m = 0.0005;
  const Renderer renderer(config_, rig_, {.noise = 0});
  Scene scene;
  scene.exposure = ExposureKind::kTexture;
  const PreparedScene still = renderer.Prepare(scene);
  // Down everywhere by the same: what a camera sees that was raised by as much.
  scene.sag = {rig_.plate.size_x_m, rig_.plate.size_y_m, 2, 2, std::vector<double>(4, kDown_m)};
  const PreparedScene sagged = renderer.Prepare(scene);
  TrueRig raised = rig_;
  for (TrueCamera& camera : raised.cameras) {
    camera.cam_from_world.translation -= camera.cam_from_world.rotation * Eigen::Vector3d(0, 0, kDown_m);
  }
  for (const int camera : {0, 2}) {
    const auto before = Detect(renderer.Render(still, camera, 1), camera < 2);
    const auto after = Detect(renderer.Render(sagged, camera, 1), camera < 2);
    // A corner is found to a fraction of a pixel only: how far all of them went, relative to what is expected.
    int compared = 0;
    double along = 0, squared = 0;
    for (const Fiducial& fiducial : config_.plate.fiducials) {
      if (!before.contains(fiducial.id) || !after.contains(fiducial.id)) continue;
      const auto truth = FiducialCorners(fiducial);
      for (std::size_t i = 0; i < 4; ++i) {
        const Eigen::Vector2d expected =
            OraclePixel(raised, camera, truth[i]) - OraclePixel(rig_, camera, truth[i]);
        along += expected.dot(after.at(fiducial.id)[i] - before.at(fiducial.id)[i]);
        squared += expected.squaredNorm();
        ++compared;
      }
    }
    ASSERT_GE(compared, 20) << "camera " << camera;
    EXPECT_NEAR(along / squared, 1, 0.3) << "camera " << camera;
  }
}

TEST_F(RendererTest, ImagesFollowTheSeedAndNotTheThreads) {
  config_ = MakeDefaultRig(4, 406, 309);
  rig_ = DrawTrueRig(config_, kSeed);
  const Renderer renderer(config_, rig_);
  Scene scene;
  scene.meshes.push_back(MakeSphere({0, 0, 0.05}, 0.05));
  const ImageU8 image = renderer.Render(renderer.Prepare(scene), 2, 9);
  EXPECT_NE(renderer.Render(renderer.Prepare(scene), 2, 10).pixels, image.pixels);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(Renderer(config_, rig_).Render(renderer.Prepare(scene), 2, 9).pixels, image.pixels);
}

TEST_F(RendererTest, CamerasDoNotShareTheirNoise) {
  config_ = MakeDefaultRig(4, 203, 154);
  rig_ = DrawTrueRig(config_, kSeed);
  rig_.cameras[1] = rig_.cameras[0];
  const PreparedScene prepared = Renderer(config_, rig_).Prepare({});
  const Renderer quiet(config_, rig_, {.noise = 0}), noisy(config_, rig_);
  EXPECT_EQ(quiet.Render(prepared, 0, 9).pixels, quiet.Render(prepared, 1, 9).pixels);
  EXPECT_NE(noisy.Render(prepared, 0, 9).pixels, noisy.Render(prepared, 1, 9).pixels);
}

TEST_F(RendererTest, TruthMapsAgreeWithTheProjectionThroughTheGlass) {
  config_ = MakeDefaultRig(4, 406, 309);
  rig_ = DrawTrueRig(config_, kSeed);
  const Renderer renderer(config_, rig_);
  Scene scene;
  scene.meshes.push_back(MakeSphere({0.01, 0, 0.05}, 0.05));
  const PreparedScene prepared = renderer.Prepare(scene);
  for (const int camera : {0, 3}) {
    const TruthMaps maps = MapTruth(renderer, prepared, camera);
    int covered = 0;
    for (int y = 0; y < 309; y += 5) {
      for (int x = 0; x < 406; x += 5) {
        if (maps.mesh.At(x, y) < 0) {
          EXPECT_TRUE(std::isnan(maps.depth_m.At(x, y)));
          continue;
        }
        ++covered;
        const Eigen::Vector3d point = maps.point_m.At(x, y).cast<double>();
        EXPECT_LT((OraclePixel(rig_, camera, point) - Eigen::Vector2d(x, y)).norm(), 0.003);
        EXPECT_NEAR((point - Eigen::Vector3d(0.01, 0, 0.05)).norm(), 0.05, 1e-4);
        EXPECT_GT(maps.normal.At(x, y).cast<double>().dot(
                      (point - Eigen::Vector3d(0.01, 0, 0.05)).normalized()),
                  0.99);
      }
    }
    EXPECT_GT(covered, 300);
  }
}

TEST_F(RendererTest, SpeckleOnSkinHasContrastAndNoSaturation) {
  const Renderer renderer(config_, rig_);
  Scene scene;
  scene.fiducials = scene.dust = false;
  scene.meshes.push_back(MakeSphere({0, 0, 0.05}, 0.05));
  const PreparedScene prepared = renderer.Prepare(scene);
  for (const int camera : {0, 3}) {
    const ImageU8 image = renderer.Render(prepared, camera, 1);
    const TruthMaps maps = MapTruth(renderer, prepared, camera);
    std::vector<std::uint8_t> grey;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
      const TrueCamera& view = rig_.cameras[static_cast<std::size_t>(camera)];
      if (maps.mesh.pixels[i] < 0) continue;
      const Eigen::Vector3f to_camera =
          (view.Centre().cast<float>() - maps.point_m.pixels[i]).normalized();
      if (maps.normal.pixels[i].dot(to_camera) > 0.8f) grey.push_back(image.pixels[i]);
    }
    std::sort(grey.begin(), grey.end());
    ASSERT_GT(grey.size(), 10000U);
    EXPECT_LT(grey[grey.size() / 20], 60) << "camera " << camera;
    EXPECT_GT(grey[grey.size() * 19 / 20], 110) << "camera " << camera;
    EXPECT_LT(grey[grey.size() * 98 / 100], 240) << "camera " << camera;
  }
}

TEST_F(RendererTest, RefusesWhatDoesNotFit) {
  const Renderer renderer(config_, rig_);
  Scene scene;
  const PreparedScene prepared = renderer.Prepare(scene);
  EXPECT_THROW(renderer.Render(prepared, 4, 1), Error);
  scene.meshes.resize(1);
  scene.meshes[0].mesh.vertices.resize(3);
  scene.meshes[0].mesh.triangles.emplace_back(0, 1, 3);
  EXPECT_THROW(renderer.Prepare(scene), Error);
  EXPECT_THROW(Renderer(MakeDefaultRig(8), rig_), Error);
}

}  // namespace
}  // namespace sole::sim
