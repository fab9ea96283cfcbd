#include "capture/rig_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "capture/camera.h"
#include "capture/discovery.h"
#include "tests/capture/simulated_rig.h"

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

TEST(CheckRig, HealthyRigPasses) {
  SimulatedRig rig(95, 2);
  const RigCheckResult result = CheckRig(rig.config, {.triggers = 6, .log = {}});
  EXPECT_TRUE(result.Ok());
  for (const RigFinding& finding : result.findings)
    EXPECT_NE(finding.severity, Severity::kError) << finding.what;
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
  const RigCheckResult result = CheckRig(rig.config, {.triggers = 4, .log = {}});
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
  const RigCheckResult result = CheckRig(rig.config, {.triggers = 1, .log = {}});
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
