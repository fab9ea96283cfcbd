#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/camera.h"
#include "core/error.h"
#include "core/plate.h"
#include "sim/renderer.h"
#include "tests/sim/test_bodies.h"

namespace sole::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

class ContactSheetTest : public testing::Test {
 protected:
  static constexpr double kThickness_m = 0.0006;

  ContactSheetTest() {
    Scene scene;
    scene.exposure = ExposureKind::kTexture;
    scene.sheet = SheetPlaces(3, 5)[1];
    scene.sheet->thickness_m = kThickness_m;
    sheet_ = *scene.sheet;
    const Renderer renderer(config_, rig_, {.noise = 0});
    const PreparedScene prepared = renderer.Prepare(scene);
    for (int camera = 0; camera < 4; ++camera)
      images_.push_back(renderer.Render(prepared, camera, 1));
  }

  /// The product's camera model with the true values: shares no code with the renderer.
  Vector2d Pixel(std::size_t camera, const Vector3d& point) const {
    const TrueCamera& c = rig_.cameras[camera];
    Camera oracle;
    oracle.width = c.width;
    oracle.height = c.height;
    oracle.intrinsics << c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, 0;
    oracle.cam_from_world = c.cam_from_world;
    return PixelFromWorld(oracle, Plate{rig_.plate.thickness_m, rig_.plate.index}, point);
  }
  double Grey(std::size_t camera, const Vector3d& point) const {
    const Vector2d p = Pixel(camera, point);
    const int x = static_cast<int>(std::floor(p.x())), y = static_cast<int>(std::floor(p.y()));
    const double a = p.x() - x, b = p.y() - y;
    const ImageU8& image = images_[camera];
    return (1 - b) * ((1 - a) * image.At(x, y) + a * image.At(x + 1, y)) +
           b * ((1 - a) * image.At(x, y + 1) + a * image.At(x + 1, y + 1));
  }
  /// Correlation of what the two cameras of a pair see of points at this height.
  double Correlation(std::size_t left, double height) const {
    double a = 0, b = 0, aa = 0, bb = 0, ab = 0, n = 0;
    for (double x = -0.02; x < 0.02; x += 0.0005) {
      for (double y = -0.02; y < 0.02; y += 0.0005, ++n) {
        const double p = Grey(left, {x, y, height}), q = Grey(left + 1, {x, y, height});
        a += p, b += q, aa += p * p, bb += q * q, ab += p * q;
      }
    }
    return (ab - a * b / n) / std::sqrt((aa - a * a / n) * (bb - b * b / n));
  }

  RigConfig config_ = MakeDefaultRig(4, 1624, 1236);
  TrueRig rig_ = DrawTrueRig(config_, 3);
  ContactSheet sheet_;
  std::vector<ImageU8> images_;
};

TEST_F(ContactSheetTest, LiesOnTheGlassFromBelowAndAtItsThicknessFromAbove) {
  for (const std::size_t left : {0U, 2U}) {
    double best = 0, best_height = 0;
    for (int i = -12; i <= 18; ++i) {
      const double found = Correlation(left, i * 1e-4);
      if (found > best) best = found, best_height = i * 1e-4;
    }
    EXPECT_GT(best, 0.9) << "pair of camera " << left;
    EXPECT_NEAR(best_height, left == 0 ? 0 : kThickness_m, 1.01e-4) << "pair of camera " << left;
  }
}

TEST_F(ContactSheetTest, IsDotsInsideItsEdgesAndClearGlassBeyond) {
  const Eigen::Rotation2Dd turn(sheet_.turn_rad);
  const auto mean_and_range = [&](std::size_t camera, double x, double y) {
    double sum = 0, low = 255, high = 0;
    for (int i = 0; i < 100; ++i) {
      const Vector2d place =
          turn * Vector2d(x + (i % 10 - 4.5) * 3e-4, y + (i / 10 - 4.5) * 3e-4) + sheet_.centre_m;
      const double grey = Grey(camera, {place.x(), place.y(), camera < 2 ? 0 : kThickness_m});
      sum += grey / 100;
      low = std::min(low, grey);
      high = std::max(high, grey);
    }
    return Vector2d(sum, high - low);
  };
  for (const std::size_t camera : {0U, 3U}) {
    // Just inside and just outside the middle of the long edge, and well inside.
    const double edge = 0.5 * sheet_.size_x_m;
    const Vector2d inside = mean_and_range(camera, edge - 0.002, 0.0301),
                   outside = mean_and_range(camera, edge + 0.0025, 0.0301);
    EXPECT_GT(inside[0], 50) << "camera " << camera;
    EXPECT_GT(inside[1], 60) << "camera " << camera;
    EXPECT_LT(outside[0], 20) << "camera " << camera;
  }
}

TEST(SheetPlaces, StayOnThePlateClearOfFiducialsAndFollowTheSeed) {
  const RigConfig config = MakeDefaultRig();
  const std::vector<ContactSheet> places = SheetPlaces(50, 1), again = SheetPlaces(50, 1);
  ASSERT_EQ(places.size(), 50U);
  for (std::size_t i = 0; i < places.size(); ++i) {
    const ContactSheet& sheet = places[i];
    EXPECT_EQ(sheet.centre_m, again[i].centre_m);
    EXPECT_GT((sheet.centre_m - places[(i + 1) % 50].centre_m).norm(), 0);
    for (int corner = 0; corner < 4; ++corner) {
      const Vector2d p = sheet.centre_m + Eigen::Rotation2Dd(sheet.turn_rad) *
                                              Vector2d((corner & 1 ? 0.5 : -0.5) * sheet.size_x_m,
                                                       (corner & 2 ? 0.5 : -0.5) * sheet.size_y_m);
      EXPECT_LT(std::abs(p.y()), 0.5 * config.plate.size_y_m);
      for (const Fiducial& fiducial : config.plate.fiducials)
        EXPECT_LT(std::abs(p.x()), std::abs(fiducial.centre_m.x()) - 0.5 * fiducial.size_m);
    }
  }
}

TEST(ContactSheet, LiesAlone) {
  const RigConfig config = MakeDefaultRig(4, 203, 154);
  const Renderer renderer(config, DrawTrueRig(config, 3));
  Scene scene;
  scene.sheet = ContactSheet{};
  scene.meshes.push_back(MakeSphere({0, 0, 0.05}, 0.04, 20));
  EXPECT_THROW(renderer.Prepare(scene), Error);
}

}  // namespace
}  // namespace sole::sim
