#include "io/take.h"

#include <cmath>
#include <limits>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/raw_file.h"
#include "io/rig_file.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

ImageU8 Picture(int width, int height, int seed) {
  ImageU8 image(width, height);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    image.pixels[i] =
        static_cast<std::uint8_t>((i * 7 + static_cast<std::size_t>(seed) * 31) % 251);
  }
  return image;
}

/// A take of two cameras and three triggers; camera 2 has no record of trigger 2 and a bad one of
/// trigger 3.
TakePaths MakeTake(const std::filesystem::path& root) {
  const TakePaths take{root};
  MakeDirectory(root / "cameras");
  RigConfig config = MakeDefaultRig(4, 64, 64);
  config.cameras.resize(2);
  config.pairs.resize(1);
  WriteRigFile(take.RigFile(), config);
  TakeInfo info;
  info.name = "first \"take\"";
  info.subject = "P01";
  info.notes = "line one\nline two, äöü";
  info.state = "complete";
  info.verdict = "usable";
  info.reasons = {"one camera lost a frame"};
  info.rig_hash = RigIdentityHash(config);
  WriteTakeInfo(take, info);
  WriteTriggers(take, {{1, ExposureKind::kSpeckle, 0, 1e-4, 0.001, 0.005},
                       {2, ExposureKind::kTexture, 0.1, 0.1 + 1.0 / 3e4, 0.101, 0.105},
                       {3, ExposureKind::kSpeckle, 0.2, 0.2001, 0.201, 0.205}});
  for (int c = 0; c < 2; ++c) {
    const std::string serial = config.cameras[static_cast<std::size_t>(c)].serial;
    RawFileWriter writer(take.Raw(serial), serial);
    for (int t = 1; t <= 3; ++t) {
      if (c == 1 && t == 2) continue;
      const RawRecordHeader header{
          .trigger = t, .width = 64, .height = 64, .status = c == 1 && t == 3 ? 1U : 0U};
      writer.Append(header, Picture(64, 64, 10 * c + t).pixels.data());
    }
    writer.Close();
  }
  return take;
}

TEST(TakeReader, GivesEveryTriggersImagesAndLeavesOutLostAndIncompleteOnes) {
  const TempDir dir;
  TakeReader reader(MakeTake(dir / "take").root);
  EXPECT_EQ(reader.Info().name, "first \"take\"");
  EXPECT_EQ(reader.Info().notes, "line one\nline two, äöü");
  EXPECT_EQ(reader.Info().reasons, std::vector<std::string>{"one camera lost a frame"});
  ASSERT_EQ(reader.Triggers().size(), 3U);
  for (int t = 1; t <= 3; ++t) {
    const std::optional<FrameSet> frames = reader.Next();
    ASSERT_TRUE(frames);
    EXPECT_EQ(frames->trigger, t);
    EXPECT_EQ(frames->kind, t == 2 ? ExposureKind::kTexture : ExposureKind::kSpeckle);
    EXPECT_EQ(frames->time_s, reader.Triggers()[static_cast<std::size_t>(t - 1)].actual_s);
    ASSERT_EQ(frames->images.size(), 2U);
    EXPECT_EQ(frames->images[0]->pixels, Picture(64, 64, t).pixels);
    EXPECT_EQ(frames->images[1].has_value(), t == 1);
  }
  EXPECT_FALSE(reader.Next());
  EXPECT_EQ(reader.Read(0).images[1]->pixels, Picture(64, 64, 11).pixels);
}

TEST(TakeReader, ReadsTheFilesOfAnInterruptedRecording) {
  const TempDir dir;
  const TakePaths take = MakeTake(dir / "take");
  const auto raw = take.Raw("SIM0001");
  std::filesystem::resize_file(raw, std::filesystem::file_size(raw) - 1);  // torn last record
  std::filesystem::rename(raw, raw.string() + ".partial");
  const TakeReader reader(take.root);
  EXPECT_EQ(reader.Read(1).images[0]->pixels, Picture(64, 64, 2).pixels);
  EXPECT_FALSE(reader.Read(2).images[0]);
}

TEST(TakeReader, ADamagedImageIsAbsentWithAWarning) {
  const TempDir dir;
  const TakePaths take = MakeTake(dir / "take");
  const RawRecord record = ReadRawIndex(take.Raw("SIM0001")).records[1];
  std::string bytes = ReadFile(take.Raw("SIM0001"));
  bytes[record.payload_offset + 77] ^= 4;
  WriteStringAtomically(take.Raw("SIM0001"), bytes);
  std::vector<std::string> warnings;
  const TakeReader reader(take.root, [&](const std::string& line) { warnings.push_back(line); });
  EXPECT_EQ(reader.Read(0).images[0]->pixels, Picture(64, 64, 1).pixels);
  EXPECT_FALSE(reader.Read(1).images[0]);
  EXPECT_TRUE(reader.Read(2).images[0]);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_THAT(warnings[0], HasSubstr("SIM0001.raw: record of trigger 2 fails its checksum"));
}

TEST(TakeReader, NamesWhatIsMissing) {
  const TempDir dir;
  EXPECT_THAT(ErrorOf([&] { TakeReader(dir / "none"); }), HasSubstr("none is not a take"));
  EXPECT_THAT(ErrorOf([&] { TakeReader reader(dir.Path()); }), HasSubstr("take.json is missing"));
  const TakePaths take = MakeTake(dir / "take");
  std::filesystem::remove(take.Raw("SIM0002"));
  EXPECT_THAT(ErrorOf([&] { TakeReader reader(take.root); }),
              HasSubstr("camera 'SIM0002' of its rig file has no recording"));
  std::filesystem::copy(take.Raw("SIM0001"), take.Raw("SIM0002"));
  EXPECT_THAT(ErrorOf([&] { TakeReader reader(take.root); }),
              HasSubstr("holds camera 'SIM0001', not 'SIM0002'"));
}

TEST(TakeReader, RefusesImagesOfAnotherSizeThanTheRigFileSays) {
  const TempDir dir;
  const TakePaths take = MakeTake(dir / "take");
  RigConfig config = ReadRigFile(take.RigFile());
  config.cameras[0].width = 128;
  WriteRigFile(take.RigFile(), config);
  EXPECT_THAT(ErrorOf([&] { TakeReader reader(take.root); }),
              HasSubstr("images of 64 x 64 pixels"));
}

TEST(ReadTakeInfo, RefusesUnknownVersionsAndStates) {
  const TempDir dir;
  const TakePaths take = MakeTake(dir / "take");
  const std::string good = ReadFile(take.Info());
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    WriteStringAtomically(take.Info(), text);
    return ErrorOf([&] { ReadTakeInfo(take); });
  };
  EXPECT_THAT(with("\"format_version\": 1", "\"format_version\": 2"),
              HasSubstr("take.json: format version 2 is unknown"));
  EXPECT_THAT(with("complete", "finished"),
              HasSubstr("key 'state' holds the unknown word 'finished'"));
  EXPECT_THAT(with("\"subject\": \"P01\"", "\"subject\": 1"),
              HasSubstr("key 'subject' must be text"));
  EXPECT_THAT(with("{", "["), HasSubstr("take.json: is not valid JSON"));
}

TEST(ReadTriggers, RoundTripsExactlyAndNamesTheLineOfAnError) {
  const TempDir dir;
  const TakePaths take = MakeTake(dir / "take");
  EXPECT_EQ(ReadTriggers(take)[1].actual_s, 0.1 + 1.0 / 3e4);
  const std::string head = "trigger,kind,scheduled_s,actual_s,exposure_start_s,exposure_end_s\n";
  const auto with = [&](const std::string& text) {
    WriteStringAtomically(take.Triggers(), text);
    return ErrorOf([&] { ReadTriggers(take); });
  };
  EXPECT_THAT(with(head + "1,speckle,0,0,0,0\n2,speckle,0,x,0,0\n"),
              HasSubstr("triggers.csv:3: column 'actual_s': 'x' is not a number"));
  EXPECT_THAT(with(head + "1,dots,0,0,0,0\n"),
              HasSubstr("triggers.csv:2: column 'kind': unknown exposure kind 'dots'"));
  EXPECT_THAT(with(head + "2,speckle,0,0,0,0\n1,speckle,0,0,0,0\n"), HasSubstr("triggers.csv:3"));
  EXPECT_THAT(with(head + "1,speckle,0\n"), HasSubstr("triggers.csv:2: has 3 fields, expected 6"));
  EXPECT_THAT(with(head + "1,speckle,\"0\n1\",0,0,0\n"),
              HasSubstr("triggers.csv:2: column 'scheduled_s': '0?1' is not a number"));
  EXPECT_THAT(with("a,b\n"), HasSubstr("the first line must be 'trigger,kind"));
}

TEST(Measurements, RoundTripNamesThatNeedQuotes) {
  const TempDir dir;
  const std::vector<Measurement> written{{3, "length", 0.1 + 0.2, "m", 1e-5, 1},
                                         {4, "width, \"ball\"", -2.5, "m", kNan, 2}};
  WriteMeasurements(dir / "m.csv", written);
  const std::vector<Measurement> read = ReadMeasurements(dir / "m.csv");
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read[0].value, 0.1 + 0.2);
  EXPECT_EQ(read[0].uncertainty, 1e-5);
  EXPECT_EQ(read[1].name, written[1].name);
  EXPECT_TRUE(std::isnan(read[1].uncertainty));
  EXPECT_EQ(read[1].definition_version, 2);
  EXPECT_EQ(read[1].frame, 4);
}

}  // namespace
}  // namespace sole::io
