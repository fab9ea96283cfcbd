#include "recon/rectify.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "tests/recon/speckle_scene.h"

namespace sole::recon {
namespace {

using testing_support::NominalRig;

bool Inside(const Camera& camera, const Eigen::Vector2d& px) {
  return px.x() >= 0 && px.y() >= 0 && px.x() <= camera.width - 1 && px.y() <= camera.height - 1;
}

/// Largest row difference, in raw pixels, and whether disparities stay in range, over points both
/// see.
void CheckPair(const Rig& rig, const StereoPair& pair) {
  const Rectification r = Rectify(rig, pair);
  const double scale = r.focal_px / rig.cameras[0].intrinsics[0];
  double worst = 0;
  int seen = 0;
  const double top = r.left.through_plate ? 0.10 : 0.17;
  for (double x = -0.10; x <= 0.101; x += 0.05) {
    for (double y = -0.18; y <= 0.181; y += 0.06) {
      for (double z = 0; z <= top; z += 0.02) {
        const Eigen::Vector3d point(x, y, z);
        const Eigen::Vector2d raw_left = PixelFromWorld(r.left.camera, rig.plate, point);
        const Eigen::Vector2d raw_right = PixelFromWorld(r.right.camera, rig.plate, point);
        if (!Inside(r.left.camera, raw_left) || !Inside(r.right.camera, raw_right)) continue;
        ++seen;
        const Eigen::Vector2d left = RectifiedFromRaw(r, r.left, raw_left);
        const Eigen::Vector2d right = RectifiedFromRaw(r, r.right, raw_right);
        worst = std::max(worst, std::abs(left.y() - right.y()) / scale);
        EXPECT_GT(left.x() - right.x(), 0);
        EXPECT_LT(left.x() - right.x(), r.disparities);
        EXPECT_GE(left.x(), r.disparities);  // SGBM leaves those columns out
        EXPECT_LT(left.x(), r.width);
        EXPECT_GE(left.y(), 0);
        EXPECT_LT(left.y(), r.height);
        // Round trip, and the map's bilinear look-up of the same.
        EXPECT_LT((RawFromRectified(r, r.left, left) - raw_left).norm(), 1e-6);
        EXPECT_LT((LookUpRaw(r.right, right) - raw_right).norm(), 0.01);
      }
    }
  }
  EXPECT_GT(seen, 100) << pair.name;
  EXPECT_LT(worst, 1.0) << pair.name;
}

TEST(Rectify, RowsAgreeOverTheVolumeForEveryPairOfTheDefaultRigs) {
  for (const int cameras : {4, 20}) {
    const Rig rig = NominalRig(MakeDefaultRig(cameras, 812, 618));
    for (const StereoPair& pair : rig.pairs) CheckPair(rig, pair);
  }
}

TEST(Rectify, IgnoringTheGlassWouldBreakTheRows) {
  // The test above means something only if the glass matters at this size.
  Rig rig = NominalRig(MakeDefaultRig(4, 812, 618));
  const Eigen::Vector3d point(0.03, 0.08, 0.01);
  const Eigen::Vector2d with = PixelFromWorld(rig.cameras[0], rig.plate, point);
  rig.plate.thickness_m = 1e-9;
  EXPECT_GT((PixelFromWorld(rig.cameras[0], rig.plate, point) - with).norm(), 1.0);
}

TEST(Rectify, ImpossiblePairsAreNamed) {
  Rig rig = NominalRig(MakeDefaultRig(4, 812, 618));
  EXPECT_THROW(Rectify(rig, {"one place", 0, 0}), Error);
  EXPECT_THROW(Rectify(rig, {"unknown", 0, 9}), Error);
  EXPECT_THROW(Rectify(rig, {"above and below", 0, 2}), Error);
  Camera away = rig.cameras[1];
  away.cam_from_world.translation += Eigen::Vector3d(0.5, 0, 0);
  rig.cameras.push_back(away);
  Camera away_too = away;
  away_too.cam_from_world.translation += Eigen::Vector3d(0.1, 0, 0);
  rig.cameras.push_back(away_too);
  EXPECT_THROW(Rectify(rig, {"looks past the volume", 4, 5}), Error);
}

}  // namespace
}  // namespace sole::recon
