// The image of the empty rig is rendered once and reused.
#include <gtest/gtest.h>

#include "sim/renderer.h"
#include "tests/sim/test_bodies.h"

namespace sole::sim {
namespace {

class Background : public testing::Test {
 protected:
  RigConfig config_ = MakeDefaultRig(4, 406, 309);
  TrueRig rig_ = DrawTrueRig(config_, 3);
  Renderer reusing_{config_, rig_, {.noise = 0}};
  Renderer from_scratch_{config_, rig_, {.noise = 0, .reuse_background = false}};
};

TEST_F(Background, ReusedGivesTheSameBitsAsRenderedFromScratch) {
  for (const ExposureKind kind : {ExposureKind::kSpeckle, ExposureKind::kTexture}) {
    // A ball beside the fiducials, in whose shadow some of them lie; then elsewhere; then moving.
    for (int frame = 0; frame < 3; ++frame) {
      Scene scene;
      scene.exposure = kind;
      scene.meshes.push_back(MakeSphere({0.06, frame == 1 ? -0.1 : 0.02, 0.045}, 0.04, 80));
      if (frame == 2)
        scene.meshes[0].velocity.assign(scene.meshes[0].mesh.vertices.size(), {0, 0.5, 0});
      for (const int camera : {0, 3}) {
        EXPECT_EQ(reusing_.Render(reusing_.Prepare(scene), camera, 1).pixels,
                  from_scratch_.Render(from_scratch_.Prepare(scene), camera, 1).pixels)
            << "camera " << camera << ", frame " << frame;
      }
    }
  }
}

TEST_F(Background, ShadowsOnMarksAreNotReused) {
  // From below, the marks beside the ball lie clear of it and of its image; what changes there is
  // the light from above.
  Scene empty, ball;
  ball.meshes.push_back(MakeSphere({0.05, 0, 0.06}, 0.04, 80));
  empty.exposure = ball.exposure = ExposureKind::kTexture;
  const ImageU8 before = reusing_.Render(reusing_.Prepare(empty), 0, 1),
                after = reusing_.Render(reusing_.Prepare(ball), 0, 1);
  int darker = 0;
  for (int y = 0; y < before.height; ++y) {
    for (int x = 0; x < before.width; ++x) darker += after.At(x, y) + 3 < before.At(x, y);
  }
  EXPECT_GT(darker, 25);
}

TEST_F(Background, OfTheEmptyRigIsTheWholePicture) {
  Scene scene;
  for (int camera = 0; camera < 4; ++camera) {
    const ImageU8 first = reusing_.Render(reusing_.Prepare(scene), camera, 1);
    EXPECT_EQ(first.pixels, reusing_.Render(reusing_.Prepare(scene), camera, 1).pixels);
    EXPECT_EQ(first.pixels, from_scratch_.Render(from_scratch_.Prepare(scene), camera, 1).pixels);
  }
}

}  // namespace
}  // namespace sole::sim
