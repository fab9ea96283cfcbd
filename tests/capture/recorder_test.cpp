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
    EXPECT_NEAR(trigger.exposure_end_s - trigger.exposure_start_s, 0.004, 1e-6);
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
  EXPECT_EQ(result.verdict, "good") << ::testing::PrintToString(result.reasons);
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
  EXPECT_THROW(Record(MakeDefaultRig(), OptionsFor(scratch, 0)), Error);
  RecordOptions gpio = OptionsFor(scratch, 1);
  gpio.queue_frames = 0;
  EXPECT_THROW(Record(MakeDefaultRig(), gpio), Error);
}

}  // namespace
}  // namespace sole::capture
