#include "capture/rig_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "capture/camera.h"
#include "capture/discovery.h"
#include "capture/rig_draft.h"
#include "io/rig_file.h"
#include "tests/capture/simulated_rig.h"
#include "tests/support/error_matcher.h"

namespace sole::capture {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Field;
using ::testing::HasSubstr;

auto Finding(Severity severity, const std::string& camera, const std::string& what) {
  return AllOf(Field(&RigFinding::severity, severity), Field(&RigFinding::camera, camera),
               Field(&RigFinding::what, HasSubstr(what)));
}

TEST(DraftRig, FoundCamerasMakeARigFileThatPassesTheCheck) {
  SimulatedRig rig(107, 2);
  const RigDraft draft = DraftRig({.serials = {"T107C2", "T107C1"}});
  ASSERT_EQ(draft.config.cameras.size(), 2u);
  EXPECT_EQ(draft.config.cameras[0].serial, "T107C2");
  EXPECT_EQ(draft.config.cameras[0].address, "127.0.107.12");
  EXPECT_EQ(draft.config.cameras[1].width, 320);
  EXPECT_EQ(draft.config.cameras[1].height, 96);
  EXPECT_EQ(draft.config.cameras[1].exposure_us, 1000);
  EXPECT_EQ(draft.config.trigger.source, "simulated");
  ASSERT_EQ(draft.config.pairs.size(), 1u);
  EXPECT_EQ(draft.config.pairs[0].right, "T107C1");
  RigConfig config = io::ParseRig(io::FormatRig(draft.config), "draft");
  config.trigger.bus_port = rig.config.trigger.bus_port;
  EXPECT_TRUE(CheckRig(config, {.triggers = 3, .disk = {}, .log = {}}).Ok());
  EXPECT_THAT(testing_support::ErrorOf([] { DraftRig({.serials = {"T107C1", "T107C9"}}); }),
              AllOf(HasSubstr("T107C9"), HasSubstr("T107C2 at 127.0.107.12")));
}

TEST(CheckRig, HealthyRigPasses) {
  SimulatedRig rig(95, 2);
  const RigCheckResult result = CheckRig(rig.config, {.triggers = 6, .disk = std::filesystem::temp_directory_path(), .log = {}});
  EXPECT_TRUE(result.Ok());
  for (const RigFinding& finding : result.findings)
    EXPECT_NE(finding.severity, Severity::kError) << finding.what;
  EXPECT_GT(result.disk_bytes_per_s, 0);
  EXPECT_NEAR(result.needed_bytes_per_s, 2 * 20 * (320 * 96 + 2 * 4096), 1);
  EXPECT_THAT(result.findings, Contains(Finding(Severity::kOk, "", "recording needs 2 MB/s")));
  ASSERT_EQ(result.cameras.size(), 2u);
  for (const RigCameraCheck& camera : result.cameras) {
    EXPECT_TRUE(camera.found && camera.controlled && camera.settings_ok);
    EXPECT_EQ(camera.fired, 6);
    EXPECT_EQ(camera.answered, 6);
    EXPECT_GT(camera.latency_max_s, 0);
    EXPECT_THAT(result.findings,
                Contains(Finding(Severity::kOk, camera.serial, "settings read back")));
  }
}

TEST(CheckRig, EveryProblemGetsItsFindingAndTheOthersAreStillChecked) {
  SimulatedRig rig(96, 4);
  const Camera other(rig.config.cameras[1]);
  rig.config.cameras[2].width = 400;  // wider than its sensor
  CameraConfig missing = rig.config.cameras[0];
  missing.serial = "T96C9";
  missing.address = "127.0.96.99";
  rig.config.cameras.push_back(missing);
  const RigCheckResult result = CheckRig(rig.config, {.triggers = 4, .disk = {}, .log = {}});
  EXPECT_FALSE(result.Ok());
  EXPECT_THAT(result.findings,
              Contains(Finding(Severity::kError, "T96C2", "controlled by another program")));
  EXPECT_THAT(result.findings, Contains(Finding(Severity::kError, "T96C3", "Width")));
  EXPECT_THAT(result.findings, Contains(Finding(Severity::kError, "T96C9", "not found")));
  for (const RigFinding& finding : result.findings) {
    EXPECT_EQ(finding.mend.empty(), finding.severity == Severity::kOk) << finding.what;
  }
  EXPECT_TRUE(result.cameras[1].found);
  EXPECT_FALSE(result.cameras[1].controlled);
  EXPECT_FALSE(result.cameras[4].found);
  EXPECT_EQ(result.cameras[0].answered, 4);
  EXPECT_EQ(result.cameras[3].answered, 4);
}

TEST(CheckRig, SilentTriggerIsAFinding) {
  SimulatedRig rig(97, 1);
  rig.config.trigger.bus_port = 1;
  const RigCheckResult result = CheckRig(rig.config, {.triggers = 1, .disk = {}, .log = {}});
  EXPECT_THAT(result.findings,
              Contains(Finding(Severity::kError, "T97C1", "does not answer the trigger")));
}

TEST(CheckRig, GpioChipThatDoesNotExistIsAFinding) {
  SimulatedRig rig(98, 1);
  rig.config.trigger.source = "gpio";
  rig.config.trigger.gpio_chip = "gpiochip977";
  const RigCheckResult result = CheckRig(rig.config);
  EXPECT_THAT(result.findings, Contains(Finding(Severity::kError, "", "gpiochip977")));
}

TEST(ListCameras, NamesSerialAndAddress) {
  SimulatedRig rig(99, 2);
  const auto found = ListCameras();
  for (const CameraConfig& camera : rig.config.cameras) {
    EXPECT_TRUE(std::any_of(found.begin(), found.end(), [&](const FoundCamera& f) {
      return f.serial == camera.serial && f.address == camera.address;
    })) << Describe(found);
  }
}

}  // namespace
}  // namespace sole::capture
