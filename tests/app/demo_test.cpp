// The whole chain at reduced size: simulated cameras on the wire to an exported, measured foot.

#include <gtest/gtest.h>

#include "app/demo.h"
#include "io/atomic_file.h"
#include "io/take.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

TEST(RunDemo, WholeChainMeetsItsFiguresAtReducedSize) {
  const testing_support::TempDir directory;
  DemoOptions options;
  options.out = directory / "demo";
  options.seed = 17;
  options.frames = 2;
  options.poses = 10;
  options.size = "1000x760";
  const nlohmann::json summary = RunDemo(options);

  EXPECT_EQ(summary["capture"]["frames_lost"], 0);
  EXPECT_EQ(summary["capture"]["frames_expected"], 8);
  EXPECT_LT(summary["calibration"]["heldout_rms_glass_mm"].get<double>(), 0.1);
  EXPECT_LT(summary["reconstruction"]["surface_rms_mm"].get<double>(), 0.3);
  EXPECT_GT(summary["reconstruction"]["completeness"].get<double>(), 0.8);
  EXPECT_GT(summary["contact"]["f1"].get<double>(), 0.6);
  EXPECT_LT(summary["fit"]["v2v_contact_mm"].get<double>(), 5.0);
  EXPECT_TRUE(summary["fit"]["v2v_noncontact_mm"].is_null());  // a standing foot has no frame without contact
  EXPECT_LT(summary["measure"]["length_error_mm"].get<double>(), 3.0);

  EXPECT_EQ(nlohmann::json::parse(io::ReadFile(options.out / "summary.json")), summary);
  const std::string report = io::ReadFile(options.out / "report.html");
  std::size_t pictures = 0;
  for (std::size_t at = 0; (at = report.find("<img", at)) != std::string::npos; ++at) ++pictures;
  EXPECT_EQ(pictures, 4u + 3u + 3u + 2u);  // the last two: how contact deforms the sole
  for (const char* format : {"glb", "obj", "stl", "csv", "npz"}) {
    EXPECT_TRUE(std::filesystem::exists(options.out / "take" / "exports" / (std::string("take.") + format))) << format;
  }
}

}  // namespace
}  // namespace sole::app
