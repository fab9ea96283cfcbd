#include "capture/recorder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "capture/camera.h"
#include "core/error.h"
#include "io/raw_file.h"
#include "io/take.h"
#include "tests/capture/simulated_rig.h"
#include "tests/support/error_matcher.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/temp_dir.h"

namespace sole::capture {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing_support::ErrorOf;
using testing_support::FileSizeLimit;
using testing_support::TempDir;

namespace fs = std::filesystem;

RecordOptions OptionsFor(const TempDir& scratch, std::int64_t triggers) {
  RecordOptions options;
  options.directory = scratch.Path() / "take";
  options.subject = "P07";
  options.notes = "left foot";
  options.software = "test";
  options.triggers = triggers;
  options.check_images = false;  // noise shows no foot
  return options;
}

/// Number of stored images; each must be the one that its camera exposed at its trigger.
int ExpectImagesUnderTheirTriggers(const fs::path& directory) {
  io::TakeReader take(directory);
  int images = 0;
  while (const auto set = take.Next()) {
    for (std::size_t camera = 0; camera < set->images.size(); ++camera) {
      if (!set->images[camera]) continue;
      ++images;
      const ImageU8 expected = SimulatedRig::Draw(static_cast<int>(camera), set->trigger);
      EXPECT_TRUE(set->images[camera]->pixels == expected.pixels)
          << "camera " << camera << " trigger " << set->trigger << " holds other pixels";
    }
  }
  return images;
}

TEST(Record, StoresEveryImageUnderItsTrigger) {
  SimulatedRig rig(81, 4);
  rig.config.trigger.rate_hz = 20.0 / 3;  // cycles of three
  const TempDir scratch;
  RecordOptions options = OptionsFor(scratch, 10);
  options.cycle = {ExposureKind::kSpeckle, ExposureKind::kSpeckle, ExposureKind::kTexture};
  RecordProgress last;
  options.progress = [&](const RecordProgress& progress) { last = progress; };
  const RecordResult result = Record(rig.config, options);

  EXPECT_THAT(result.reasons, IsEmpty());
  EXPECT_EQ(result.verdict, "good");
  EXPECT_EQ(result.state, "complete");
  EXPECT_EQ(result.FramesExpected(), 40);
  EXPECT_EQ(result.FramesGood(), 40);
  EXPECT_EQ(last.triggers, 10);
  EXPECT_GT(last.frames, 0);
  ASSERT_EQ(result.cameras.size(), 4u);
  for (const CameraRecord& camera : result.cameras) {
    EXPECT_EQ(camera.good, 10);
    EXPECT_GT(camera.latency_mean_s, 0);
    EXPECT_GE(camera.latency_max_s, camera.latency_mean_s);
  }
  EXPECT_EQ(ExpectImagesUnderTheirTriggers(options.directory), 40);

  const io::TakeReader take(options.directory);
  EXPECT_EQ(take.Info().state, "complete");
  EXPECT_EQ(take.Info().verdict, "good");
  EXPECT_EQ(take.Info().subject, "P07");
  EXPECT_EQ(take.Info().name, "take");
  EXPECT_EQ(take.Info().rig_hash, RigIdentityHash(rig.config));
  ASSERT_EQ(take.Triggers().size(), 10u);
  for (std::size_t i = 0; i < 10; ++i) {
    const io::TriggerRecord& trigger = take.Triggers()[i];
    EXPECT_EQ(trigger.trigger, static_cast<std::int64_t>(i) + 1);
    EXPECT_NEAR(trigger.scheduled_s, 0.05 * static_cast<double>(i), 1e-6);
    EXPECT_GE(trigger.actual_s, trigger.scheduled_s - 1e-6);
    EXPECT_NEAR(trigger.exposure_end_s - trigger.exposure_start_s, 0.001, 1e-6);
    EXPECT_EQ(trigger.kind, i % 3 == 2 ? ExposureKind::kTexture : ExposureKind::kSpeckle);
  }
  EXPECT_FALSE(
      fs::exists(options.directory / "cameras" / (rig.config.cameras[0].serial + ".raw.partial")));
}

TEST(Record, FrameIdsMayWrapDuringTheTake) {
  SimulatedRig rig(82, 2, {.first_frame_id = 65531});
  const TempDir scratch;
  const RecordOptions options = OptionsFor(scratch, 10);
  const RecordResult result = Record(rig.config, options);
  EXPECT_EQ(result.verdict, "good") << ::testing::PrintToString(result.reasons);
  EXPECT_EQ(ExpectImagesUnderTheirTriggers(options.directory), 20);
  const io::RawIndex index =
      io::ReadRawIndex(io::TakePaths{options.directory}.Raw(rig.config.cameras[0].serial));
  for (std::size_t i = 1; i < index.records.size(); ++i) {
    EXPECT_EQ(index.records[i].header.frame_id, index.records[i - 1].header.frame_id + 1);
  }
}

TEST(Record, LostPacketsAreSentAgain) {
  SimulatedRig rig(
      83, 2, {.faults = {{.packet_drop_probability = 0.02}, {.packet_drop_probability = 0.02}}});
  for (CameraConfig& camera : rig.config.cameras) camera.packet_size = 1500;
  const TempDir scratch;
  const RecordOptions options = OptionsFor(scratch, 30);
  const RecordResult result = Record(rig.config, options);
  EXPECT_GT(result.cameras[0].resent_packets + result.cameras[1].resent_packets, 0u);
  EXPECT_EQ(result.FramesGood(), 60);
  EXPECT_EQ(result.verdict, "usable");
  EXPECT_THAT(result.reasons, Contains(HasSubstr("had to be sent again")));
  EXPECT_EQ(ExpectImagesUnderTheirTriggers(options.directory), 60);
}

TEST(Record, SkippedFrameIdDoesNotShiftImages) {
  SimulatedRig rig(84, 2, {.faults = {{}, {.skip_frame_id_after = 7}}});
  const TempDir scratch;
  const RecordOptions options = OptionsFor(scratch, 10);
  const RecordResult result = Record(rig.config, options);
  EXPECT_EQ(ExpectImagesUnderTheirTriggers(options.directory), 20);
  EXPECT_EQ(result.cameras[0].realigned, 0);
  EXPECT_EQ(result.cameras[1].realigned, 1);
  EXPECT_EQ(result.verdict, "usable");
  EXPECT_THAT(result.reasons, ElementsAre(HasSubstr(rig.config.cameras[1].serial)));
}

TEST(Record, CameraThatDiesIsCountedAndTheVerdictIsRepeat) {
  SimulatedRig rig(85, 2);
  const TempDir scratch;
  RecordOptions options = OptionsFor(scratch, 24);
  std::vector<std::string> lines;
  std::mutex mutex;
  options.log = [&](const std::string& line) {
    const std::lock_guard lock(mutex);
    lines.push_back(line);
  };
  options.progress = [&](const RecordProgress& progress) {
    if (progress.fired >= 5) rig.server->SetFaults(1, {.dead = true});
  };
  const RecordResult result = Record(rig.config, options);
  EXPECT_EQ(result.state, "complete");
  EXPECT_EQ(result.verdict, "repeat");
  EXPECT_EQ(result.cameras[0].good, 24);
  EXPECT_GE(result.cameras[1].lost, 10);
  EXPECT_EQ(result.cameras[1].good + result.cameras[1].lost, 24);
  EXPECT_EQ(result.cameras[1].lost_triggers.back(), 24);
  EXPECT_THAT(lines, Contains(AllOf(HasSubstr(rig.config.cameras[1].serial), HasSubstr("silent"))));
  EXPECT_EQ(ExpectImagesUnderTheirTriggers(options.directory),
            static_cast<int>(result.FramesGood()));
}

TEST(Record, CameraThatRestartsIsBroughtBackWithItsSettings) {
  const std::string serial = "T101C2";
  SimulatedRig rig(101, 2, {.schedule = {MakeFault("reboot", serial, 1.0, "", 6)}});
  rig.config.cameras[1].exposure_us = 1234;  // not what it has after power-up
  const TempDir scratch;
  RecordOptions options = OptionsFor(scratch, 160);
  int faults = 0;
  options.on_event = [&](RecordEvent event) { faults += event == RecordEvent::kFault ? 1 : 0; };
  const RecordResult result = Record(rig.config, options);
  EXPECT_EQ(result.cameras[0].good, 160) << "the other camera goes on";
  const CameraRecord& camera = result.cameras[1];
  ASSERT_EQ(camera.gaps.size(), 1u);
  EXPECT_TRUE(camera.gaps[0].ended);
  EXPECT_TRUE(camera.gaps[0].reopened);
  EXPECT_GT(camera.gaps[0].seconds, 0.5);
  EXPECT_GT(camera.good, 20);
  EXPECT_EQ(camera.good + camera.lost, 160);
  EXPECT_LT(camera.lost_triggers.back(), 160) << "its last frames are there";
  EXPECT_THAT(result.reasons, Contains(AllOf(HasSubstr(serial), HasSubstr("connected again"))));
  EXPECT_EQ(result.verdict, "repeat");
  EXPECT_GE(faults, 1);
  EXPECT_EQ(ExpectImagesUnderTheirTriggers(options.directory),
            static_cast<int>(result.FramesGood()));
}

TEST(Record, ShortBreakOfTheLinkEndsByItself) {
  SimulatedRig rig(102, 2, {.schedule = {MakeFault("dead-link", "T102C1", 0.7, "", 6)}});
  const TempDir scratch;
  const RecordOptions options = OptionsFor(scratch, 60);
  const RecordResult result = Record(rig.config, options);
  EXPECT_EQ(result.cameras[1].good, 60);
  const CameraRecord& camera = result.cameras[0];
  ASSERT_EQ(camera.gaps.size(), 1u);
  EXPECT_TRUE(camera.gaps[0].ended);
  EXPECT_FALSE(camera.gaps[0].reopened);
  EXPECT_EQ(camera.realigned, 0) << "ids went on counting";
  EXPECT_EQ(ExpectImagesUnderTheirTriggers(options.directory),
            static_cast<int>(result.FramesGood()));
}

TEST(Record, KeyStartsWithPreRollAndStopsWithPostRoll) {
  SimulatedRig rig(103, 2);
  rig.config.trigger.pre_roll_s = 0.2;
  rig.config.trigger.post_roll_s = 0.2;
  const TempDir scratch;
  RecordOptions options = OptionsFor(scratch, 0);
  options.start = StartOn::kKey;
  std::int64_t waited = 0, recorded = 0;
  TakePhase phase = TakePhase::kWaiting;
  options.progress = [&](const RecordProgress& progress) {
    phase = progress.phase;
    waited += progress.phase == TakePhase::kWaiting ? 1 : 0;
    recorded = progress.fired;
  };
  int hits = 0;
  options.key = [&] {
    const bool hit = (phase == TakePhase::kWaiting && waited == 12) ||
                     (phase == TakePhase::kRecording && recorded >= 20 && hits < 2);
    if (hit) {
      ++hits;
      waited = recorded = 0;
    }
    return hit;
  };
  std::vector<RecordEvent> events;
  options.on_event = [&](RecordEvent event) { events.push_back(event); };
  const RecordResult result = Record(rig.config, options);
  EXPECT_EQ(result.verdict, "good") << ::testing::PrintToString(result.reasons);
  EXPECT_THAT(events, ElementsAre(RecordEvent::kStart, RecordEvent::kStop));
  EXPECT_GE(result.triggers, 20);
  EXPECT_EQ(result.FramesGood(), 2 * result.triggers);

  // The take's trigger 1 is some pulse of the line; every image is that of its own pulse.
  io::TakeReader take(options.directory);
  ASSERT_EQ(static_cast<std::int64_t>(take.Triggers().size()), result.triggers);
  std::int64_t skipped = -1;
  while (const auto set = take.Next()) {
    ASSERT_TRUE(set->images[0]);
    for (std::int64_t n = 0; n < 200 && skipped < 0; ++n) {
      if (SimulatedRig::Draw(0, 1 + n).pixels == set->images[0]->pixels) skipped = n;
    }
    for (int camera = 0; camera < 2; ++camera) {
      EXPECT_TRUE(set->images[static_cast<std::size_t>(camera)]->pixels ==
                  SimulatedRig::Draw(camera, set->trigger + skipped).pixels)
          << "camera " << camera << " trigger " << set->trigger;
    }
  }
  EXPECT_GE(skipped, 5) << "the wait was longer than the pre-roll";
}

TEST(Record, StoppedWhileWaitingLeavesNothing) {
  SimulatedRig rig(104, 1);
  const TempDir scratch;
  RecordOptions options = OptionsFor(scratch, 10);
  options.start = StartOn::kFoot;
  std::atomic<bool> stop{false};
  options.stop = &stop;
  options.progress = [&](const RecordProgress&) { stop = true; };
  EXPECT_THAT(ErrorOf([&] { Record(rig.config, options); }), HasSubstr("before the first trigger"));
  EXPECT_FALSE(fs::exists(options.directory));
}

TEST(Record, TimeEndsTheTake) {
  SimulatedRig rig(105, 1);
  const TempDir scratch;
  RecordOptions options = OptionsFor(scratch, 0);
  options.seconds = 0.5;
  const RecordResult result = Record(rig.config, options);
  EXPECT_EQ(result.verdict, "good") << ::testing::PrintToString(result.reasons);
  EXPECT_NEAR(static_cast<double>(result.triggers), 10, 4);
}

TEST(Record, ActionCommandsTriggerTheCameras) {
  SimulatedRig rig(106, 2);
  rig.config.trigger.source = "action";
  rig.config.trigger.action_device_key = 0xCAFE;
  rig.config.trigger.action_group_mask = 6;
  const TempDir scratch;
  const RecordOptions options = OptionsFor(scratch, 10);
  const RecordResult result = Record(rig.config, options);
  EXPECT_EQ(result.verdict, "good") << ::testing::PrintToString(result.reasons);
  EXPECT_EQ(result.FramesGood(), 20);
}

TEST(Record, StopLeavesAReadableTake) {
  SimulatedRig rig(86, 2);
  const TempDir scratch;
  RecordOptions options = OptionsFor(scratch, 1000);
  std::atomic<bool> stop{false};
  options.stop = &stop;
  options.progress = [&](const RecordProgress& progress) { stop = progress.fired >= 6; };
  const RecordResult result = Record(rig.config, options);
  EXPECT_TRUE(result.stopped);
  EXPECT_EQ(result.state, "complete");
  EXPECT_EQ(result.verdict, "usable");
  EXPECT_GE(result.triggers, 6);
  EXPECT_LT(result.triggers, 1000);
  EXPECT_EQ(result.FramesGood(), 2 * result.triggers);
  EXPECT_EQ(ExpectImagesUnderTheirTriggers(options.directory),
            static_cast<int>(2 * result.triggers));
}

TEST(Record, TakeInProgressIsReadable) {
  SimulatedRig rig(87, 2);
  const TempDir scratch;
  RecordOptions options = OptionsFor(scratch, 40);
  int images_meanwhile = 0;
  options.progress = [&](const RecordProgress& progress) {
    if (progress.fired < 30 || images_meanwhile > 0) return;
    fs::copy(options.directory, scratch.Path() / "snapshot", fs::copy_options::recursive);
    images_meanwhile = ExpectImagesUnderTheirTriggers(scratch.Path() / "snapshot");
    EXPECT_EQ(io::TakeReader(scratch.Path() / "snapshot").Info().state, "recording");
  };
  Record(rig.config, options);
  EXPECT_GT(images_meanwhile, 0);
}

TEST(Record, MissingCameraIsNamedAndLeavesNothing) {
  SimulatedRig rig(88, 2);
  CameraConfig missing = rig.config.cameras[0];
  missing.serial = "T88C9";
  missing.address = "127.0.88.99";
  rig.config.cameras.push_back(missing);
  const TempDir scratch;
  const RecordOptions options = OptionsFor(scratch, 10);
  EXPECT_THAT(ErrorOf([&] { Record(rig.config, options); }),
              AllOf(HasSubstr("camera T88C9 not found at 127.0.88.99"),
                    HasSubstr("T88C1 at 127.0.88.11"), HasSubstr("sole sim serve")));
  EXPECT_FALSE(fs::exists(options.directory));
}

TEST(Record, CameraOfAnotherProgramIsNamed) {
  SimulatedRig rig(89, 2);
  const Camera other(rig.config.cameras[1]);
  const TempDir scratch;
  const RecordOptions options = OptionsFor(scratch, 10);
  EXPECT_THAT(ErrorOf([&] { Record(rig.config, options); }),
              AllOf(HasSubstr("T89C2"), HasSubstr("127.0.89.12"), HasSubstr("another program")));
  EXPECT_FALSE(fs::exists(options.directory));
}

TEST(Record, SilentTriggerIsNamed) {
  SimulatedRig rig(90, 2);
  rig.config.trigger.bus_port = 1;  // nobody listens
  const TempDir scratch;
  RecordOptions options = OptionsFor(scratch, 10);
  options.warmup_attempts = 1;
  EXPECT_THAT(ErrorOf([&] { Record(rig.config, options); }),
              AllOf(HasSubstr("T90C1"), HasSubstr("does not answer"), HasSubstr("bus_port 1")));
  EXPECT_FALSE(fs::exists(options.directory));
}

TEST(Record, ExistingTakeIsNotTouched) {
  const RigConfig config = MakeDefaultRig(4, 320, 240);
  const TempDir scratch;
  const RecordOptions options = OptionsFor(scratch, 10);
  fs::create_directory(options.directory);
  std::ofstream(options.directory / "take.json") << "precious";
  EXPECT_THAT(ErrorOf([&] { Record(config, options); }),
              AllOf(HasSubstr(options.directory.string()), HasSubstr("not empty")));
  std::string content;
  std::ifstream(options.directory / "take.json") >> content;
  EXPECT_EQ(content, "precious");
  EXPECT_EQ(std::distance(fs::directory_iterator(options.directory), {}), 1);
}

TEST(Record, TooLittleRoomIsToldBeforeAnything) {
  const RigConfig config = MakeDefaultRig(20);
  const TempDir scratch;
  const RecordOptions options = OptionsFor(scratch, 100'000'000);
  EXPECT_THAT(ErrorOf([&] { Record(config, options); }),
              AllOf(HasSubstr("too little room"), HasSubstr("MB")));
  EXPECT_FALSE(fs::exists(options.directory));
}

TEST(Record, PathThatCannotBeWrittenIsTold) {
  const TempDir scratch;
  std::ofstream(scratch.Path() / "file") << "x";
  RecordOptions options = OptionsFor(scratch, 10);
  options.directory = scratch.Path() / "file" / "take";
  EXPECT_THAT(ErrorOf([&] { Record(MakeDefaultRig(4, 320, 240), options); }),
              AllOf(HasSubstr("file/take")));
  options.directory = scratch.Path() / "file";
  EXPECT_THAT(ErrorOf([&] { Record(MakeDefaultRig(4, 320, 240), options); }),
              AllOf(HasSubstr("is a file")));
}

TEST(Record, FullDiskEndsTheTakeAndKeepsWhatWasStored) {
  SimulatedRig rig(91, 2);
  const TempDir scratch;
  const RecordOptions options = OptionsFor(scratch, 100);
  RecordResult result;
  {
    const FileSizeLimit limit(8 * 320 * 96);
    result = Record(rig.config, options);
  }
  EXPECT_EQ(result.state, "aborted");
  EXPECT_EQ(result.verdict, "repeat");
  EXPECT_LT(result.triggers, 100);
  EXPECT_THAT(result.reasons, Contains(HasSubstr(".raw")));
  EXPECT_EQ(result.FramesGood(), 12);  // six frames in whole blocks fit a file
  EXPECT_EQ(ExpectImagesUnderTheirTriggers(options.directory), 12);
  EXPECT_EQ(io::TakeReader(options.directory).Info().state, "aborted");
}

TEST(Record, ImpossibleOptionsAreRefused) {
  const TempDir scratch;
  EXPECT_THROW(Record(MakeDefaultRig(), OptionsFor(scratch, -1)), Error);
  EXPECT_THAT(ErrorOf([&] { Record(MakeDefaultRig(), OptionsFor(scratch, 0)); }),
              HasSubstr("without an end"));
  RecordOptions gpio = OptionsFor(scratch, 1);
  gpio.queue_frames = 0;
  EXPECT_THROW(Record(MakeDefaultRig(), gpio), Error);
}

}  // namespace
}  // namespace sole::capture
