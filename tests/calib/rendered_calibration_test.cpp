#include <gtest/gtest.h>

#include <cmath>

#include "calib/calibrate.h"
#include "calib/judge.h"
#include "core/plate.h"
#include "tests/calib/rendered_take.h"

namespace sole::calib {
namespace {

using testing_support::RenderedTake;
using testing_support::SyntheticRig;
using testing_support::TruePixel;

/// RMS distance (mm) of points of the capture volume from where the pair's calibration puts their
/// true pixels.
double VolumeError(const Rig& rig, const StereoPair& pair, const SyntheticRig& truth) {
  double squares = 0;
  int count = 0;
  for (double x = -0.04; x <= 0.041; x += 0.04) {
    for (double y = -0.10; y <= 0.101; y += 0.05) {
      for (const double z : {0.0, 0.03, 0.10}) {
        std::vector<Ray> rays;
        for (const int c : {pair.left, pair.right}) {
          const auto camera = static_cast<std::size_t>(c);
          rays.push_back(
              RayFromPixel(rig.cameras[camera], rig.plate, TruePixel(truth, camera, {x, y, z})));
        }
        squares += (NearestPoint(rays) - Eigen::Vector3d(x, y, z)).squaredNorm();
        ++count;
      }
    }
  }
  return 1000 * std::sqrt(squares / count);
}

TEST(RenderedCalibration, FourCamerasOfReducedSize) {
  const RigConfig config = MakeDefaultRig(4, 812, 618);
  RenderedTake take(config, 7, 4);
  const Calibration calibration = Calibrate(config, take);
  const CalibrationStats& stats = calibration.stats;
  EXPECT_EQ(stats.poses_used + stats.poses_heldout, 7);
  EXPECT_LT(stats.reprojection_rms_px, 0.05);
  EXPECT_LT(stats.heldout_rms_air_mm, 0.08);
  EXPECT_LT(stats.heldout_rms_glass_mm, 0.08);
  EXPECT_LT(stats.ground_rms_mm, 0.1);
  for (const StereoPair& pair : calibration.rig.pairs) {
    EXPECT_LT(VolumeError(calibration.rig, pair, take.Truth()), 0.08) << pair.name;
  }
}

}  // namespace
}  // namespace sole::calib
