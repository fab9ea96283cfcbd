#include "io/take_archive.h"

#include <cstdio>
#include <cstdlib>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/raw_archive.h"
#include "io/take_check.h"
#include "io/take_recovery.h"
#include "tests/support/error_matcher.h"
#include "tests/support/recorded_take.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;
using namespace testing_support;

constexpr std::int64_t kTriggers = 7;

std::string Output(const std::string& command) {
  std::string output;
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  char buffer[65536];
  while (const std::size_t count = std::fread(buffer, 1, sizeof buffer, pipe))
    output.append(buffer, count);
  pclose(pipe);
  return output;
}

/// Two cameras of odd sizes; the second lost trigger 3, has an incomplete frame and a record that
/// belongs to no trigger.
TakePaths MakeTake(const fs::path& root, RigConfig& config) {
  config = TinyRig(2, 101, 67);
  config.cameras[1].width = 64;
  const TakePaths take = WriteTinyTake(root, config, kTriggers);
  const std::string serial = config.cameras[1].serial;
  fs::remove(take.Raw(serial));
  RawFileWriter writer(take.Raw(serial), serial);
  for (std::int64_t t = 1; t <= kTriggers; ++t) {
    if (t == 3) continue;
    RawRecordHeader header = TinyHeader(config, 1, t);
    if (t == 5) header.status = 1;
    if (t == 6) header.trigger = 0;
    writer.Append(header, TinyImage(config, 1, t).pixels.data());
  }
  writer.Close();
  TakeInfo info = ReadTakeInfo(take);
  info.verdict = "usable";
  WriteTakeInfo(take, info);
  return take;
}

TEST(ArchiveTake, GivesEveryRawFileBackToTheByte) {
  const TempDir dir;
  RigConfig config;
  const TakePaths take = MakeTake(dir / "take", config);
  std::vector<std::string> before;
  for (const CameraConfig& camera : config.cameras)
    before.push_back(ReadFile(take.Raw(camera.serial)));
  const TakeArchiveResult archived = ArchiveTake(take.root, {.delete_source = true});
  EXPECT_EQ(archived.records, 2 * kTriggers - 1);
  EXPECT_EQ(archived.raw_bytes, before[0].size() + before[1].size());
  EXPECT_EQ(archived.deleted, 2);
  for (const CameraConfig& camera : config.cameras)
    EXPECT_FALSE(fs::exists(take.Raw(camera.serial)));
  EXPECT_THAT(CheckTake(take.root).faults, IsEmpty());
  EXPECT_EQ(CheckTake(take.root).cameras[1].storage, "archive");
  EXPECT_EQ(CheckTake(take.root).cameras[1].incomplete, 1);
  EXPECT_THAT(ErrorOf([&] { TakeReader reader(take.root); }),
              HasSubstr("is archived: run sole take archive --restore"));
  EXPECT_THAT(ErrorOf([&] { RecoverTake(take.root); }), HasSubstr("is archived"));
  EXPECT_THAT(ErrorOf([&] { ArchiveTake(take.root); }), HasSubstr("the take is archived already"));

  const TakeArchiveResult restored = RestoreTake(take.root, {.delete_source = true});
  EXPECT_EQ(restored.deleted, 2);
  for (std::size_t c = 0; c < 2; ++c) {
    EXPECT_EQ(ReadFile(take.Raw(config.cameras[c].serial)), before[c]);
    EXPECT_FALSE(fs::exists(take.Archive(config.cameras[c].serial)));
  }
}

TEST(ArchiveTake, MakesAnotherTakeAndKeepsTheFirst) {
  const TempDir dir;
  RigConfig config;
  const TakePaths take = MakeTake(dir / "take", config);
  fs::create_directories(take.root / "scans");
  WriteStringAtomically(take.root / "scans" / "stats.json", "{}");
  ArchiveTake(take.root, {.out = dir / "archive"});
  RestoreTake(dir / "archive", {.out = dir / "back"});
  const TakePaths back{dir / "back"};
  for (const CameraConfig& camera : config.cameras)
    EXPECT_EQ(ReadFile(back.Raw(camera.serial)), ReadFile(take.Raw(camera.serial)));
  EXPECT_EQ(ReadFile(back.Info()), ReadFile(take.Info()));
  EXPECT_EQ(ReadFile(back.Triggers()), ReadFile(take.Triggers()));
  EXPECT_EQ(ReadFile(back.root / "scans" / "stats.json"), "{}");
  EXPECT_FALSE(fs::exists(dir / "archive" / "cameras" / (config.cameras[0].serial + ".raw")));
  EXPECT_THAT(ErrorOf([&] { ArchiveTake(take.root, {.out = dir / "archive"}); }),
              HasSubstr("already holds a take"));
  EXPECT_THAT(ErrorOf([&] { RestoreTake(take.root); }), HasSubstr("nothing to restore"));
}

TEST(ArchiveTake, OtherPeoplesProgramsReadTheFrames) {
  if (std::system("ffmpeg -version > /dev/null 2>&1 && ffprobe -version > /dev/null 2>&1") != 0)
    GTEST_SKIP() << "ffmpeg is not installed: apt-get install ffmpeg";
  const TempDir dir;
  RigConfig config;
  const TakePaths take = MakeTake(dir / "take", config);
  ArchiveTake(take.root);
  for (std::size_t c = 0; c < 2; ++c) {
    const std::string video = take.Archive(config.cameras[c].serial).string();
    const std::string probe = Output(
        "ffprobe -v error -count_frames -select_streams v -show_entries "
        "stream=codec_name,width,height,pix_fmt,r_frame_rate,nb_read_frames -of default=nw=1 " +
        video);
    EXPECT_THAT(probe, HasSubstr("codec_name=ffv1\n"));
    EXPECT_THAT(probe, HasSubstr("width=" + std::to_string(config.cameras[c].width) + "\n"));
    EXPECT_THAT(probe, HasSubstr("height=67\n"));
    EXPECT_THAT(probe, HasSubstr("pix_fmt=gray\n"));
    EXPECT_THAT(probe, HasSubstr("r_frame_rate=10/1\n"));
    EXPECT_THAT(
        probe,
        HasSubstr("nb_read_frames=" + std::to_string(c == 0 ? kTriggers : kTriggers - 1) + "\n"));
    const std::string raw = Output("ffmpeg -v error -i " + video + " -f rawvideo -pix_fmt gray -");
    std::string expected;
    for (std::int64_t t = 1; t <= kTriggers; ++t) {
      if (c == 1 && t == 3) continue;
      const ImageU8 image = TinyImage(config, c, t);
      expected.append(image.pixels.begin(), image.pixels.end());
    }
    EXPECT_TRUE(raw == expected) << raw.size() << " bytes, expected " << expected.size();
  }
}

TEST(ArchiveTake, ARecordingWithoutFramesSurvivesToo) {
  const TempDir dir;
  const RigConfig config = TinyRig(1);
  const TakePaths take = WriteTinyTake(dir / "take", config, 0);
  const std::string before = ReadFile(take.Raw(config.cameras[0].serial));
  ArchiveTake(take.root, {.delete_source = true});
  RestoreTake(take.root);
  EXPECT_EQ(ReadFile(take.Raw(config.cameras[0].serial)), before);
}

TEST(ArchiveTake, RefusesDamageAndDeletesNothingThen) {
  const TempDir dir;
  const RigConfig config = TinyRig(2);
  const TakePaths take = WriteTinyTake(dir / "take", config, kTriggers);
  const fs::path raw = take.Raw(config.cameras[1].serial);
  std::string bytes = ReadFile(raw);
  bytes[3 * kRawBlock - 1] ^= 1;  // pixels of trigger 1
  WriteStringAtomically(raw, bytes);
  EXPECT_THAT(ErrorOf([&] { ArchiveTake(take.root, {.delete_source = true}); }),
              HasSubstr("fails its checksum"));
  EXPECT_TRUE(fs::exists(take.Raw(config.cameras[0].serial)));
  EXPECT_FALSE(fs::exists(take.Archive(config.cameras[1].serial)));
  TakeInfo info = ReadTakeInfo(take);
  info.state = "recording";
  WriteTakeInfo(take, info);
  EXPECT_THAT(ErrorOf([&] { ArchiveTake(take.root); }), HasSubstr("run sole take recover"));
}

TEST(RestoreTake, ADamagedArchiveIsFoundAndWritesNothing) {
  const TempDir dir;
  const RigConfig config = TinyRig(1);
  const TakePaths take = WriteTinyTake(dir / "take", config, kTriggers);
  const std::string serial = config.cameras[0].serial;
  ArchiveTake(take.root, {.delete_source = true});
  const std::string good = ReadFile(take.Archive(serial));
  for (const std::size_t at : {good.size() / 4, good.size() / 2, good.size() - 300}) {
    std::string bytes = good;
    bytes[at] ^= 8;
    WriteStringAtomically(take.Archive(serial), bytes);
    EXPECT_FALSE(CheckTake(take.root).Ok()) << at;
    EXPECT_NE(ErrorOf([&] { RestoreTake(take.root, {.delete_source = true}); }), "") << at;
    EXPECT_FALSE(fs::exists(take.Raw(serial)));
    EXPECT_TRUE(fs::exists(take.Archive(serial)));
  }
  WriteStringAtomically(take.Archive(serial), good.substr(0, good.size() * 2 / 3));
  EXPECT_THAT(CheckTake(take.root).faults, testing::Not(IsEmpty()));
}

TEST(ArchiveTake, StopLeavesNoHalfFileAndRepeatingGoesOn) {
  const TempDir dir;
  const RigConfig config = TinyRig(2);
  const TakePaths take = WriteTinyTake(dir / "take", config, kTriggers);
  std::atomic<bool> stop{false};
  TakeArchiveOptions options{.threads = 1, .stop = &stop};
  // In the second camera.
  options.progress = [&](std::int64_t done, std::int64_t) { stop = done == 2 * kTriggers + 3; };
  EXPECT_THAT(ErrorOf([&] { ArchiveTake(take.root, options); }), HasSubstr("stopped"));
  EXPECT_TRUE(fs::exists(take.Archive(config.cameras[0].serial)));
  EXPECT_EQ(std::distance(fs::directory_iterator(take.root / "cameras"), {}), 3);
  EXPECT_THAT(CheckTake(take.root).faults, IsEmpty());
  ArchiveTake(take.root, {.delete_source = true});
  EXPECT_EQ(std::distance(fs::directory_iterator(take.root / "cameras"), {}), 2);
}

}  // namespace
}  // namespace sole::io
