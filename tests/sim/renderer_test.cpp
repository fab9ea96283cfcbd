#include "sim/renderer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>
#include <tbb/global_control.h>

#include "core/camera.h"
#include "core/error.h"
#include "core/plate.h"
#include "core/target.h"

namespace sole::sim {
namespace {

using Corners = std::vector<Eigen::Vector2d>;

/// The product's own camera model with the true values: an oracle that shares no code with the renderer.
Camera Oracle(const TrueCamera& truth) {
  Camera camera;
  camera.serial = truth.serial;
  camera.width = truth.width;
  camera.height = truth.height;
  camera.intrinsics << truth.fx, truth.fy, truth.cx, truth.cy, truth.k1, truth.k2, truth.p1, truth.p2, 0;
  camera.cam_from_world = truth.cam_from_world;
  return camera;
}

Eigen::Vector2d OraclePixel(const TrueRig& rig, int camera, const Eigen::Vector3d& point) {
  const Plate plate{rig.plate.thickness_m, rig.plate.index};
  return PixelFromWorld(Oracle(rig.cameras[static_cast<std::size_t>(camera)]), plate, point);
}

/// Corners of every marker OpenCV finds, by id. `mirrored`: seen from behind, so the image is flipped first and the found
/// positions are flipped back.
std::map<int, Corners> Detect(const ImageU8& image, bool mirrored) {
  cv::Mat mat(image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data()));
  if (mirrored) cv::flip(mat.clone(), mat, 1);
  auto parameters = cv::aruco::DetectorParameters::create();
  parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
  parameters->cornerRefinementWinSize = 3;
  std::vector<int> ids;
  std::vector<std::vector<cv::Point2f>> found;
  cv::aruco::detectMarkers(mat, cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_250), found, ids, parameters);
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
std::vector<Eigen::Vector3d> MarkerOnCube(const CharucoFace& face, int id, const Rigid3& world_from_body) {
  const int square = 2 * (id - face.first_id) + 1;  // every second square is white, beginning with the second
  const double x = (square % face.squares_x + 0.5) * face.square_m, y = (square / face.squares_x + 0.5) * face.square_m;
  const double h = 0.5 * face.marker_m;
  std::vector<Eigen::Vector3d> corners;
  for (const auto& [dx, dy] : {std::pair{-h, -h}, {h, -h}, {h, h}, {-h, h}}) {
    corners.push_back(world_from_body * (face.body_from_board * Eigen::Vector3d(x + dx, y + dy, 0)));
  }
  return corners;
}

class RendererTest : public testing::Test {
 protected:
  static constexpr std::uint64_t kSeed = 3;
  RigConfig config_ = MakeDefaultRig();
  TrueRig rig_ = DrawTrueRig(config_, kSeed);
};

TEST_F(RendererTest, MarkersOfTheCubeHaveTheirIdsAndPlaces) {
  const Renderer renderer(config_, rig_, {.noise = 0});
  const CalibrationBody cube = MakeCalibrationCube(config_.target.edge_m, config_.target.squares,
                                                   config_.target.square_m, config_.target.marker_m);
  Scene scene;
  scene.exposure = ExposureKind::kTexture;
  scene.fiducials = false;
  // Turned and tilted so that the cameras at the side see a face, too.
  scene.world_from_target = Rigid3{Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d(0.2, 1, 0).normalized())),
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
        if (truth.size() > 1) shortest = std::min(shortest, (truth.back() - truth[truth.size() - 2]).norm());
      }
      // OpenCV places the corners of strongly foreshortened markers badly; those only tell the order.
      const double tolerance = shortest > 45 ? 0.7 : 0.3 * shortest;
      precise += shortest > 45;
      for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_LT((corners[i] - truth[i]).norm(), tolerance)
            << "camera " << camera << " marker " << id << " corner " << i;
      }
    }
    EXPECT_GE(precise, 8) << "camera " << camera;
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
        EXPECT_LT((markers.at(fiducial.id)[i] - OraclePixel(rig_, camera, truth[i])).norm(), 0.7)
            << "camera " << camera << " fiducial " << fiducial.id << " corner " << i;
      }
    }
  }
}

}  // namespace
}  // namespace sole::sim
