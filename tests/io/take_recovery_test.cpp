#include "io/take_recovery.h"

#include <sys/file.h>

#include <fcntl.h>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/raw_file.h"
#include "io/take_check.h"
#include "tests/support/error_matcher.h"
#include "tests/support/recorded_take.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using namespace testing_support;

constexpr std::int64_t kTriggers = 5;
constexpr std::size_t kRecord = 2 * kRawBlock;  // 64 x 64 pixels fill a block

/// A take whose recorder was killed: open files, triggers.csv behind by `behind` triggers.
TakePaths Interrupted(const fs::path& root, const RigConfig& config, std::int64_t behind) {
  const TakePaths take = WriteTinyTake(root, config, kTriggers);
  std::vector<TriggerRecord> lines = ReadTriggers(take);
  lines.resize(static_cast<std::size_t>(kTriggers - behind));
  WriteTriggers(take, lines);
  for (const CameraConfig& camera : config.cameras)
    fs::rename(take.Raw(camera.serial), take.Raw(camera.serial).string() + ".partial");
  TakeInfo info = ReadTakeInfo(take);
  info.state = "recording";
  info.verdict = "";
  WriteTakeInfo(take, info);
  return take;
}

void Cut(const fs::path& file, std::size_t size) { fs::resize_file(file, size); }

void Damage(const fs::path& file, std::size_t at) {
  std::string bytes = ReadFile(file);
  bytes[at] = static_cast<char>(bytes[at] ^ 1);
  WriteStringAtomically(file, bytes);
}

/// Every image that the take gives is the right one; how many of each camera.
std::vector<int> ImagesOf(const TakePaths& take) {
  TakeReader reader(take.root);
  std::vector<int> images(reader.Config().cameras.size());
  while (const auto set = reader.Next()) {
    for (std::size_t c = 0; c < images.size(); ++c) {
      if (!set->images[c]) continue;
      ++images[c];
      EXPECT_EQ(set->images[c]->pixels, TinyImage(reader.Config(), c, set->trigger).pixels);
      EXPECT_EQ(set->kind, TinyKind(set->trigger));
    }
  }
  return images;
}

TEST(RecoverTake, LeavesAGoodTakeAsItIs) {
  const TempDir dir;
  const RigConfig config = TinyRig(2);
  const TakePaths take = WriteTinyTake(dir / "take", config, kTriggers);
  const std::string info = ReadFile(take.Info());
  const TakeRecovery result = RecoverTake(take.root);
  EXPECT_FALSE(result.changed);
  EXPECT_EQ(result.state, "complete");
  EXPECT_EQ(result.verdict, "good");
  EXPECT_EQ(result.triggers, kTriggers);
  EXPECT_EQ(ReadFile(take.Info()), info);
}

TEST(RecoverTake, ClosesFilesAndCompletesTriggersWithTheCamerasClocks) {
  const TempDir dir;
  const RigConfig config = TinyRig(2);
  const TakePaths take = Interrupted(dir / "take", config, 2);
  Cut(take.Raw(config.cameras[1].serial).string() + ".partial",
      kRawBlock + kTriggers * kRecord - 1);
  const TakeRecovery result = RecoverTake(take.root);
  EXPECT_TRUE(result.changed);
  EXPECT_EQ(result.state, "recovered");
  EXPECT_EQ(result.verdict, "usable");  // what was on its way when it broke off is no loss
  EXPECT_EQ(result.triggers, kTriggers);
  EXPECT_EQ(result.added_triggers, 2);
  EXPECT_EQ(result.cameras[0].kept, kTriggers);
  EXPECT_EQ(result.cameras[0].torn, 0);
  EXPECT_THAT(result.cameras[0].lost_triggers, IsEmpty());
  EXPECT_EQ(result.cameras[1].kept, kTriggers - 1);
  EXPECT_EQ(result.cameras[1].torn, 1);
  EXPECT_THAT(result.cameras[1].lost_triggers, ElementsAre(kTriggers));
  EXPECT_THAT(result.reasons,
              Contains(HasSubstr(config.cameras[1].serial + ": 1 of 5 frames lost (triggers 5)")));
  const std::vector<TriggerRecord> lines = ReadTriggers(take);
  ASSERT_EQ(lines.size(), 5U);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const TriggerRecord expected = TinyTrigger(static_cast<std::int64_t>(i) + 1);
    EXPECT_EQ(lines[i].trigger, expected.trigger);
    EXPECT_EQ(lines[i].kind, expected.kind);
    EXPECT_NEAR(lines[i].scheduled_s, expected.scheduled_s, 1e-9);
    EXPECT_NEAR(lines[i].actual_s, expected.actual_s, 1e-9);
    EXPECT_NEAR(lines[i].exposure_end_s, expected.exposure_end_s, 1e-9);
  }
  EXPECT_THAT(ImagesOf(take), ElementsAre(5, 4));
  EXPECT_EQ(ReadTakeInfo(take).state, "recovered");
  EXPECT_EQ(ReadTakeInfo(take).subject, "P01");
  EXPECT_THAT(CheckTake(take.root).faults, IsEmpty());
  EXPECT_FALSE(RecoverTake(take.root).changed);
}

TEST(RecoverTake, ATruncationAnywhereLosesNoWholeRecordAndInventsNone) {
  const TempDir dir("/dev/shm");
  const RigConfig config = TinyRig(1);
  const TakePaths whole = Interrupted(dir / "whole", config, 1);
  const fs::path name = fs::path("cameras") / (config.cameras[0].serial + ".raw.partial");
  const std::string bytes = ReadFile(whole.root / name);
  std::vector<std::size_t> sizes{0, 1, 63, 64, 100};
  for (std::size_t border = kRawBlock; border <= bytes.size(); border += kRawBlock) {
    for (const std::ptrdiff_t step : {-64, -3, -2, -1, 0, 1, 2, 3, 59, 60, 63, 64, 65}) {
      const std::size_t size = border + static_cast<std::size_t>(step);
      if (size <= bytes.size()) sizes.push_back(size);
    }
  }
  for (std::size_t size = 37; size < bytes.size(); size += 997) sizes.push_back(size);
  for (const std::size_t size : sizes) {
    fs::remove_all(dir / "cut");
    fs::copy(whole.root, dir / "cut", fs::copy_options::recursive);
    Cut(dir / "cut" / name, size);
    const TakeRecovery result = RecoverTake(dir / "cut");
    const std::size_t records = size < kRawBlock ? 0 : (size - kRawBlock) / kRecord;
    EXPECT_EQ(result.cameras[0].kept, static_cast<std::int64_t>(records)) << size;
    EXPECT_LE(result.cameras[0].torn, 1);
    // Triggers that neither file knows are beyond anybody's knowledge.
    const std::int64_t known =
        std::max<std::int64_t>(kTriggers - 1, static_cast<std::int64_t>(records));
    EXPECT_EQ(result.triggers, known) << size;
    EXPECT_EQ(result.cameras[0].lost_triggers.size(), static_cast<std::size_t>(known) - records)
        << size;
    EXPECT_THAT(ImagesOf({dir / "cut"}), ElementsAre(static_cast<int>(records))) << size;
    EXPECT_EQ(result.verdict, records == 0 ? "repeat" : "usable") << size;
    EXPECT_THAT(CheckTake(dir / "cut").faults, IsEmpty()) << size;
  }
}

TEST(RecoverTake, DamageInTheMiddleCostsThatRecordOnlyAndKeepsTheOriginal) {
  const TempDir dir;
  const RigConfig config = TinyRig(2);
  const TakePaths take = WriteTinyTake(dir / "take", config, kTriggers);
  const fs::path raw = take.Raw(config.cameras[0].serial),
                 other = take.Raw(config.cameras[1].serial);
  Damage(raw, kRawBlock + 1 * kRecord + kRawBlock + 9);  // pixels of trigger 2
  Damage(raw, kRawBlock + 3 * kRecord + 9);              // header of trigger 4
  Damage(other, 30);                                     // file header
  const std::string damaged = ReadFile(raw);
  EXPECT_THAT(
      CheckTake(take.root).faults,
      ElementsAre(HasSubstr("belong to no record"),
                  HasSubstr("record of trigger 2 does not match its checksum"),
                  HasSubstr("file header is damaged"), HasSubstr("the verdict is good, but")));
  const TakeRecovery result = RecoverTake(take.root);
  EXPECT_TRUE(result.changed);
  EXPECT_EQ(result.verdict, "repeat");
  EXPECT_THAT(result.cameras[0].lost_triggers, ElementsAre(2, 4));
  EXPECT_EQ(result.cameras[0].dropped, 1);
  EXPECT_EQ(result.cameras[0].damaged_copy, raw.string() + ".damaged");
  EXPECT_EQ(ReadFile(raw.string() + ".damaged"), damaged);
  EXPECT_EQ(result.cameras[1].kept, kTriggers);
  EXPECT_THAT(ImagesOf(take), ElementsAre(3, 5));
  EXPECT_THAT(CheckTake(take.root).faults, IsEmpty());
}

TEST(RecoverTake, AZeroTailIsCutOff) {
  const TempDir dir;
  const RigConfig config = TinyRig(1);
  const TakePaths take = Interrupted(dir / "take", config, 0);
  const fs::path partial = take.Raw(config.cameras[0].serial).string() + ".partial";
  Cut(partial, fs::file_size(partial) + 7 * kRawBlock);  // as after a power failure
  EXPECT_EQ(RecoverTake(take.root).cameras[0].kept, kTriggers);
  EXPECT_EQ(fs::file_size(take.Raw(config.cameras[0].serial)), kRawBlock + kTriggers * kRecord);
}

TEST(RecoverTake, ASilentCameraIsALossNotTheEndOfTheTake) {
  const TempDir dir;
  const RigConfig config = TinyRig(2);
  const TakePaths take = WriteTinyTake(dir / "take", config, 60);
  const fs::path raw = take.Raw(config.cameras[1].serial);
  Cut(raw, kRawBlock + 20 * kRecord);
  fs::rename(raw, raw.string() + ".partial");
  const TakeRecovery result = RecoverTake(take.root);
  EXPECT_EQ(result.verdict, "repeat");
  EXPECT_EQ(result.cameras[1].lost_triggers.size(), 40U);
  EXPECT_THAT(result.reasons, Contains(HasSubstr("40 of 60 frames lost (triggers 21 to 60)")));
}

TEST(RecoverTake, MissingAndEmptyFilesBecomeRecordingsWithoutFrames) {
  const TempDir dir;
  const RigConfig config = TinyRig(3);
  const TakePaths take = Interrupted(dir / "take", config, 0);
  fs::remove(take.Raw(config.cameras[0].serial).string() + ".partial");
  Cut(take.Raw(config.cameras[1].serial).string() + ".partial", 0);
  WriteStringAtomically(take.Info(), "");
  WriteStringAtomically(take.Triggers(), "");
  const TakeRecovery result = RecoverTake(take.root);
  EXPECT_EQ(result.verdict, "repeat");
  EXPECT_EQ(result.triggers, kTriggers);
  EXPECT_THAT(ImagesOf(take), ElementsAre(0, 0, 5));
  EXPECT_THAT(result.reasons, Contains(HasSubstr("take.json could not be read")));
  EXPECT_THAT(result.reasons, Contains(HasSubstr("triggers.csv could not be read")));
  EXPECT_THAT(CheckTake(take.root).faults, IsEmpty());
}

TEST(RecoverTake, RefusesWhatIsBeingRecordedAndNamesWhatItCannotMend) {
  const TempDir dir;
  const RigConfig config = TinyRig(1);
  const TakePaths take = BeginTake(dir / "take", config);
  {
    RawFileWriter writer(take.Raw(config.cameras[0].serial), config.cameras[0].serial);
    EXPECT_THAT(ErrorOf([&] { RecoverTake(take.root); }), HasSubstr("is being recorded right now"));
    EXPECT_EQ(ReadTakeInfo(take).state, "recording");
  }
  EXPECT_NO_THROW(RecoverTake(take.root));
  EXPECT_THAT(ErrorOf([&] { RecoverTake(dir / "none"); }), HasSubstr("is not a take"));
  fs::remove(take.RigFile());
  EXPECT_THAT(ErrorOf([&] { RecoverTake(take.root); }),
              HasSubstr("rig.toml is missing: put the rig file there"));
  const TakePaths other = WriteTinyTake(dir / "other", TinyRig(2), 2);
  fs::copy_file(other.Raw(TinyRig(2).cameras[0].serial), other.Raw(TinyRig(2).cameras[1].serial),
                fs::copy_options::overwrite_existing);
  EXPECT_THAT(ErrorOf([&] { RecoverTake(other.root); }), HasSubstr("holds camera"));
}

TEST(RecoverTake, CanBeStoppedAndRepeated) {
  const TempDir dir;
  const RigConfig config = TinyRig(2);
  const TakePaths take = Interrupted(dir / "take", config, 1);
  std::atomic<bool> stop{false};
  const RecoverOptions options{
      .progress = [&](std::int64_t done, std::int64_t) { stop = done == kTriggers + 2; },
      .stop = &stop};
  EXPECT_THAT(ErrorOf([&] { RecoverTake(take.root, options); }), HasSubstr("stopped"));
  EXPECT_THAT(ImagesOf(take), ElementsAre(4, 4));  // readable as it is
  EXPECT_EQ(RecoverTake(take.root).state, "recovered");
  EXPECT_THAT(ImagesOf(take), ElementsAre(5, 5));
}

}  // namespace
}  // namespace sole::io
