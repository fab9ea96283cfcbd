#include "io/raw_file.h"

#include <cstring>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/atomic_file.h"
#include "tests/support/error_matcher.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::FileSizeLimit;
using testing_support::TempDir;

constexpr std::uint32_t kWidth = 32, kHeight = 20;
constexpr std::size_t kRecordSize = 64 + kWidth * kHeight;

std::vector<std::uint8_t> Pixels(int trigger) {
  std::vector<std::uint8_t> pixels(kWidth * kHeight);
  for (std::size_t i = 0; i < pixels.size(); ++i)
    pixels[i] = static_cast<std::uint8_t>(i * 3 + static_cast<std::size_t>(trigger));
  return pixels;
}

RawRecordHeader HeaderOf(int trigger) {
  return {trigger, 70000U + static_cast<unsigned>(trigger), 1ULL << 60, -5, kWidth, kHeight, 0};
}

/// A closed file with records of triggers 1 to `records`; its bytes.
std::string Record(const std::filesystem::path& path, int records) {
  RawFileWriter writer(path, "SIM0001");
  for (int t = 1; t <= records; ++t) writer.Append(HeaderOf(t), Pixels(t).data());
  writer.Close();
  return ReadFile(path);
}

TEST(RawFile, RoundTripsHeadersAndPixels) {
  const TempDir dir;
  Record(dir / "a.raw", 3);
  EXPECT_FALSE(std::filesystem::exists(dir / "a.raw.partial"));
  const RawIndex index = ReadRawIndex(dir / "a.raw");
  EXPECT_EQ(index.serial, "SIM0001");
  EXPECT_FALSE(index.truncated);
  EXPECT_EQ(index.skipped_bytes, 0U);
  ASSERT_EQ(index.records.size(), 3U);
  for (int t = 1; t <= 3; ++t) {
    const RawRecord& record = index.records[static_cast<std::size_t>(t - 1)];
    EXPECT_EQ(record.header.trigger, t);
    EXPECT_EQ(record.header.frame_id, 70000U + static_cast<unsigned>(t));
    EXPECT_EQ(record.header.device_time_ns, 1ULL << 60);
    EXPECT_EQ(record.header.host_time_ns, -5);
    EXPECT_EQ(ReadRawImage(dir / "a.raw", record).pixels, Pixels(t));
  }
}

TEST(RawFile, HasTheDocumentedLayout) {
  const TempDir dir;
  const std::string bytes = Record(dir / "a.raw", 1);
  ASSERT_EQ(bytes.size(), 64 + kRecordSize);
  EXPECT_EQ(bytes.substr(0, 8), "SOLERAW1");
  EXPECT_STREQ(bytes.c_str() + 16, "SIM0001");
  EXPECT_EQ(bytes.substr(64, 4), "SREC");
  std::int64_t trigger;
  std::memcpy(&trigger, &bytes[64 + 8], 8);
  EXPECT_EQ(trigger, 1);
  std::uint32_t width;
  std::memcpy(&width, &bytes[64 + 40], 4);
  EXPECT_EQ(width, kWidth);
  EXPECT_EQ(static_cast<std::uint8_t>(bytes[128]), Pixels(1)[0]);
}

TEST(RawFile, ATornTailLosesOnlyTheLastRecordWhereverItIsCut) {
  const TempDir dir;
  const std::string bytes = Record(dir / "a.raw", 3);
  for (std::size_t size = 64; size < bytes.size(); size += 7) {
    WriteStringAtomically(dir / "cut.raw", bytes.substr(0, size));
    const RawIndex index = ReadRawIndex(dir / "cut.raw");
    EXPECT_EQ(index.records.size(), (size - 64) / kRecordSize) << size;
    EXPECT_EQ(index.truncated, (size - 64) % kRecordSize != 0) << size;
  }
}

TEST(RawFile, AnUnclosedFileStaysAsPartialAndIsReadable) {
  const TempDir dir;
  {
    RawFileWriter writer(dir / "a.raw", "A");
    writer.Append(HeaderOf(1), Pixels(1).data());
  }
  EXPECT_FALSE(std::filesystem::exists(dir / "a.raw"));
  EXPECT_EQ(ReadRawIndex(dir / "a.raw.partial").records.size(), 1U);
}

TEST(RawFile, TheScanStepsOverADamagedHeader) {
  const TempDir dir;
  std::string bytes = Record(dir / "a.raw", 3);
  bytes[64 + kRecordSize + 20] ^= 1;  // header of the second record
  WriteStringAtomically(dir / "b.raw", bytes);
  const RawIndex index = ReadRawIndex(dir / "b.raw");
  ASSERT_EQ(index.records.size(), 2U);
  EXPECT_EQ(index.records[1].header.trigger, 3);
  EXPECT_EQ(index.skipped_bytes, kRecordSize);
  EXPECT_FALSE(index.truncated);
  EXPECT_EQ(ReadRawImage(dir / "b.raw", index.records[1]).pixels, Pixels(3));
}

TEST(RawFile, DamagedPixelsAreFoundWhenRead) {
  const TempDir dir;
  std::string bytes = Record(dir / "a.raw", 2);
  bytes[64 + kRecordSize + 64 + 100] ^= 1;
  WriteStringAtomically(dir / "b.raw", bytes);
  const RawIndex index = ReadRawIndex(dir / "b.raw");
  ASSERT_EQ(index.records.size(), 2U);
  EXPECT_NO_THROW(ReadRawImage(dir / "b.raw", index.records[0]));
  EXPECT_THAT(ErrorOf([&] { ReadRawImage(dir / "b.raw", index.records[1]); }),
              HasSubstr("b.raw: record of trigger 2 fails its checksum"));
}

TEST(RawFile, RefusesOtherFilesAndVersions) {
  const TempDir dir;
  std::string bytes = Record(dir / "a.raw", 1);
  bytes[8] = 9;
  WriteStringAtomically(dir / "b.raw", bytes);
  EXPECT_THAT(ErrorOf([&] { ReadRawIndex(dir / "b.raw"); }),
              HasSubstr("b.raw: format version 9 is unknown"));
  WriteStringAtomically(dir / "c.raw", "something else");
  EXPECT_THAT(ErrorOf([&] { ReadRawIndex(dir / "c.raw"); }),
              HasSubstr("c.raw: is not a recording"));
  EXPECT_THAT(ErrorOf([&] { ReadRawIndex(dir.Path()); }), HasSubstr("it is not a file"));
}

TEST(RawFile, NeverOverwritesARecording) {
  const TempDir dir;
  Record(dir / "a.raw", 1);
  EXPECT_THAT(ErrorOf([&] { RawFileWriter(dir / "a.raw", "A"); }), HasSubstr("exists already"));
  WriteStringAtomically(dir / "b.raw.partial", "x");
  EXPECT_THAT(ErrorOf([&] { RawFileWriter(dir / "b.raw", "A"); }), HasSubstr("cannot create"));
  EXPECT_THAT(ErrorOf([&] { RawFileWriter(dir / "a.raw" / "c.raw", "A"); }),
              HasSubstr("Not a directory"));
}

TEST(RawFile, AFullDiskKeepsEarlierRecordsAndLaterOnesFollow) {
  const TempDir dir;
  RawFileWriter writer(dir / "a.raw", "A");
  writer.Append(HeaderOf(1), Pixels(1).data());
  {
    const FileSizeLimit limit(64 + kRecordSize + kRecordSize / 2);
    EXPECT_THAT(ErrorOf([&] { writer.Append(HeaderOf(2), Pixels(2).data()); }),
                HasSubstr("cannot write"));
  }
  writer.Append(HeaderOf(3), Pixels(3).data());
  writer.Close();
  const RawIndex index = ReadRawIndex(dir / "a.raw");
  ASSERT_EQ(index.records.size(), 2U);
  EXPECT_EQ(index.records[1].header.trigger, 3);
  EXPECT_FALSE(index.truncated);
}

}  // namespace
}  // namespace sole::io
