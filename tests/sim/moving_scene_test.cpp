// What moves while the shutter is open, and what does not.
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "sim/renderer.h"
#include "tests/sim/test_bodies.h"

namespace sole::sim {
namespace {

using Eigen::Vector3d;

constexpr double kExposure_s = 0.001;  // of the default rig

class MovingScene : public testing::Test {
 protected:
  /// A ball with skin, moved by `shift`, whose texture stays with it.
  static Scene Ball(const Vector3d& shift, const Vector3d& velocity) {
    Scene scene;
    scene.fiducials = scene.dust = false;
    SceneMesh ball = MakeSphere({0, 0, 0.06}, 0.04, 100);
    ball.material = ball.mesh.vertices;
    for (Vector3d& v : ball.mesh.vertices) v += shift;
    ball.velocity.assign(ball.mesh.vertices.size(), velocity);
    scene.meshes.push_back(ball);
    return scene;
  }
  static ImageU8 RenderWith(const Renderer& renderer, const Scene& scene, int camera,
                            std::uint64_t seed = 1) {
    return renderer.Render(renderer.Prepare(scene), camera, seed);
  }
  ImageU8 Render(const Scene& scene, int camera) const {
    return RenderWith(renderer_, scene, camera);
  }

  RigConfig config_ = MakeDefaultRig(4, 406, 309);
  TrueRig rig_ = DrawTrueRig(config_, 3);
  Renderer renderer_{config_, rig_, {.noise = 0}};
};

TEST_F(MovingScene, IsTheMeanOfPicturesTakenDuringTheExposure) {
  const Vector3d velocity(2, 3.6, 1.6);
  for (const int camera : {0, 3}) {
    for (const ExposureKind kind : {ExposureKind::kSpeckle, ExposureKind::kTexture}) {
      Scene moving = Ball(Vector3d::Zero(), velocity), still = Ball(Vector3d::Zero(), {});
      moving.exposure = still.exposure = kind;
      const ImageU8 blurred = Render(moving, camera), sharp = Render(still, camera);
      constexpr int kPictures = 21;
      std::vector<double> mean(blurred.pixels.size(), 0.0);
      for (int i = 0; i < kPictures; ++i) {
        Scene at = Ball(((i + 0.5) / kPictures - 0.5) * kExposure_s * velocity, {});
        at.exposure = kind;
        const ImageU8 picture = Render(at, camera);
        for (std::size_t p = 0; p < mean.size(); ++p) mean[p] += picture.pixels[p] / double{kPictures};
      }
      double off = 0, off_sharp = 0;
      for (std::size_t p = 0; p < mean.size(); ++p) {
        off += std::pow(blurred.pixels[p] - mean[p], 2);
        off_sharp += std::pow(sharp.pixels[p] - mean[p], 2);
      }
      EXPECT_LT(std::sqrt(off / off_sharp), 0.25) << "camera " << camera;
      EXPECT_GT(std::sqrt(off_sharp / static_cast<double>(mean.size())), 0.5) << "it shows";
    }
  }
}

TEST_F(MovingScene, SlowMotionAndJitterAtRestDoNotShow) {
  const ImageU8 rest = Render(Ball(Vector3d::Zero(), Vector3d::Zero()), 3);
  EXPECT_EQ(Render(Ball(Vector3d::Zero(), {0.002, 0, 0}), 3).pixels, rest.pixels);
  const Renderer jittering(config_, rig_, {.noise = 0, .trigger_jitter_s = 1e-4});
  EXPECT_EQ(RenderWith(jittering, Ball(Vector3d::Zero(), Vector3d::Zero()), 3).pixels, rest.pixels);
}

TEST_F(MovingScene, JitterMovesThePictureByVelocityTimesDelay) {
  // The foot's way along the image's x axis, by the shift of its centre of brightness.
  const Vector3d velocity(0, 1, 0);
  const auto centre = [](const ImageU8& image) {
    double sum = 0, x_sum = 0;
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        const double light = std::max(image.At(x, y) - 12, 0);
        sum += light;
        x_sum += light * x;
      }
    }
    return x_sum / sum;
  };
  Scene scene = Ball(Vector3d::Zero(), velocity);
  scene.exposure = ExposureKind::kTexture;
  constexpr double kJitter_s = 2e-4;
  const Renderer jittering(config_, rig_, {.noise = 0, .trigger_jitter_s = kJitter_s});
  const double without = centre(Render(scene, 0)), px_per_m = 812.5 / 0.70;
  double square = 0;
  constexpr int kShots = 12;
  for (int i = 0; i < kShots; ++i) {
    const ImageU8 image = RenderWith(jittering, scene, 0, static_cast<std::uint64_t>(i));
    square += std::pow(centre(image) - without, 2);
  }
  const double sd = std::sqrt(square / kShots), expected = px_per_m * kJitter_s;
  EXPECT_GT(sd, 0.5 * expected);
  EXPECT_LT(sd, 1.6 * expected);
}

TEST_F(MovingScene, VelocitiesMustFit) {
  Scene scene = Ball(Vector3d::Zero(), Vector3d::Zero());
  scene.meshes[0].velocity.resize(5);
  EXPECT_THROW(Render(scene, 0), Error);
}

}  // namespace
}  // namespace sole::sim
