// Aravis' own fake GigE Vision camera as a foreign device: no line input, other features than ours,
// ids that wrap.
#include <arv.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "capture/camera.h"
#include "capture/discovery.h"
#include "capture/recorder.h"
#include "capture/rig_check.h"
#include "capture/rig_draft.h"
#include "core/error.h"
#include "io/take.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::capture {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing_support::ErrorOf;
using testing_support::TempDir;

class FakeCameraTest : public ::testing::Test {
 protected:
  void SetUp() override {
    device_ = arv_gv_fake_camera_new("127.0.0.1", "FOREIGN1");
    ASSERT_TRUE(arv_gv_fake_camera_is_running(device_)) << "is port 3956 of 127.0.0.1 in use?";
    CameraConfig camera;
    camera.serial = "FOREIGN1";
    camera.address = "127.0.0.1";
    camera.width = 256;
    camera.height = 128;
    camera.focal_px = 500;
    camera.look_at_m = {0, 1, 0};
    camera.exposure_us = 10000;  // scales the pattern by 1
    camera.packet_size = 1500;
    config.name = "foreign";
    config.cameras = {camera};
    config.trigger.source = "software";
    config.trigger.rate_hz = 2;  // it looks at its command register every 40 to 100 ms only
    config.trigger.warmup = 1;
  }
  void TearDown() override { g_clear_object(&device_); }

  RigConfig config;

 private:
  ArvGvFakeCamera* device_ = nullptr;
};

TEST_F(FakeCameraTest, RecordsWithSoftwareTrigger) {
  const TempDir scratch;
  RecordOptions options;
  options.directory = scratch.Path() / "take";
  options.triggers = 4;
  options.check_images = false;  // a pattern shows no foot
  const RecordResult result = Record(config, options);
  EXPECT_THAT(result.reasons, IsEmpty());
  EXPECT_EQ(result.verdict, "good");
  EXPECT_EQ(result.FramesGood(), 4);

  io::TakeReader take(options.directory);
  EXPECT_EQ(take.Info().state, "complete");
  // The device draws pixel (x, y) = (x + y + frame id) mod 255: one step per trigger.
  int first = -1;
  for (int i = 0; i < 4; ++i) {
    const auto set = take.Next();
    ASSERT_TRUE(set);
    ASSERT_TRUE(set->images.at(0));
    const int value = set->images[0]->At(3, 5);
    if (i == 0) first = value;
    EXPECT_EQ(value, (first + i) % 255);
    EXPECT_EQ(set->images[0]->At(100, 100), (value + 192) % 255);
  }
}

TEST_F(FakeCameraTest, IsListed) {
  bool listed = false;
  for (const FoundCamera& camera : ListCameras()) listed = listed || camera.serial == "FOREIGN1";
  EXPECT_TRUE(listed);
}

TEST_F(FakeCameraTest, RigFileIsDraftedFromIt) {
  const RigDraft draft = DraftRig({.serials = {"FOREIGN1"}});
  ASSERT_EQ(draft.config.cameras.size(), 1u);
  EXPECT_GT(draft.config.cameras[0].width, 256);
  EXPECT_EQ(draft.config.trigger.source, "software") << "it has no line";
}

TEST_F(FakeCameraTest, SecondControllerIsTold) {
  const Camera first(config.cameras[0]);
  EXPECT_THAT(ErrorOf([&] { Camera second(config.cameras[0]); }),
              AllOf(HasSubstr("FOREIGN1"), HasSubstr("another program")));
}

TEST_F(FakeCameraTest, MissingLineIsNamedAsTheSetting) {
  Camera camera(config.cameras[0]);
  EXPECT_THAT(ErrorOf([&] { camera.Configure({}); }),
              AllOf(HasSubstr("FOREIGN1"), HasSubstr("TriggerSource")));
}

TEST_F(FakeCameraTest, WrongSerialAtTheAddressIsNamed) {
  config.cameras[0].serial = "FOREIGN2";
  EXPECT_THAT(ErrorOf([&] { Camera camera(config.cameras[0]); }),
              AllOf(HasSubstr("FOREIGN2"), HasSubstr("is FOREIGN1")));
}

}  // namespace
}  // namespace sole::capture
