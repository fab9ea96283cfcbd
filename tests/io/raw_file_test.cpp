#include "io/raw_file.h"

#include <sys/stat.h>

#include <cstdlib>
#include <cstring>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/atomic_file.h"
#include "io/bytes_internal.h"
#include "tests/support/error_matcher.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::FileSizeLimit;
using testing_support::TempDir;

constexpr std::uint32_t kWidth = 96, kHeight = 50;  // 4800 bytes: two blocks
constexpr std::size_t kBlock = 4096;
constexpr std::size_t kRecordSize = 3 * kBlock;

std::vector<std::uint8_t> Pixels(int trigger) {
  std::vector<std::uint8_t> pixels(kWidth * kHeight);
  for (std::size_t i = 0; i < pixels.size(); ++i)
    pixels[i] = static_cast<std::uint8_t>(i * 3 + static_cast<std::size_t>(trigger));
  return pixels;
}

RawRecordHeader HeaderOf(int trigger) {
  return {.trigger = trigger,
          .frame_id = 70000U + static_cast<unsigned>(trigger),
          .device_time_ns = 1ULL << 60,
          .host_time_ns = -5,
          .width = kWidth,
          .height = kHeight,
          .status = 0,
          .kind = trigger % 2 == 0 ? ExposureKind::kTexture : ExposureKind::kSpeckle};
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
    EXPECT_EQ(record.header.kind, t % 2 == 0 ? ExposureKind::kTexture : ExposureKind::kSpeckle);
    EXPECT_TRUE(CheckRawRecord(dir / "a.raw", record));
    EXPECT_EQ(ReadRawImage(dir / "a.raw", record).pixels, Pixels(t));
  }
}

TEST(RawFile, HasTheDocumentedLayout) {
  const TempDir dir;
  const std::string bytes = Record(dir / "a.raw", 1);
  ASSERT_EQ(bytes.size(), kBlock + kRecordSize);
  EXPECT_EQ(bytes.substr(0, 8), "SOLERAW1");
  EXPECT_EQ(bytes[8], 2);
  EXPECT_STREQ(bytes.c_str() + 16, "SIM0001");
  EXPECT_EQ(bytes.substr(kBlock, 4), "SREC");
  std::int64_t trigger;
  std::memcpy(&trigger, &bytes[kBlock + 8], 8);
  EXPECT_EQ(trigger, 1);
  std::uint32_t width;
  std::memcpy(&width, &bytes[kBlock + 40], 4);
  EXPECT_EQ(width, kWidth);
  EXPECT_EQ(bytes[kBlock + 56], 1);  // speckle
  const std::vector<std::uint8_t> pixels = Pixels(1);
  EXPECT_EQ(std::memcmp(&bytes[2 * kBlock], pixels.data(), pixels.size()), 0);
  EXPECT_EQ(bytes.find_first_not_of('\0', 2 * kBlock + pixels.size()), std::string::npos);
}

TEST(RawFile, ReadsVersionOneWhichHasNoPadding) {
  const TempDir dir;
  const std::string now = Record(dir / "a.raw", 3);
  const auto sealed = [&](std::string header, char version) {
    if (version == 1) {
      header[8] = 1;
      header[12] = 64, header[13] = 0;
    }
    const std::uint32_t crc = Crc32(header.data(), 60);
    std::memcpy(&header[60], &crc, 4);
    return header;
  };
  std::string old = sealed(now.substr(0, 64), 1);
  for (std::size_t t = 0; t < 3; ++t) {
    old += now.substr(kBlock + t * kRecordSize, 64);
    old += now.substr(2 * kBlock + t * kRecordSize, kWidth * kHeight);
  }
  for (const std::size_t cut : {0, 1, 500}) {
    WriteStringAtomically(dir / "old.raw", old.substr(0, old.size() - cut));
    const RawIndex index = ReadRawIndex(dir / "old.raw");
    EXPECT_EQ(index.serial, "SIM0001");
    EXPECT_EQ(index.truncated, cut > 0);
    ASSERT_EQ(index.records.size(), cut > 0 ? 2U : 3U);
    EXPECT_EQ(ReadRawImage(dir / "old.raw", index.records[1]).pixels, Pixels(2));
  }
}

TEST(RawFile, ATornTailLosesOnlyTheLastRecordWhereverItIsCut) {
  const TempDir dir;
  const std::string bytes = Record(dir / "a.raw", 3);
  for (std::size_t size = kBlock; size < bytes.size(); size += 97) {
    WriteStringAtomically(dir / "cut.raw", bytes.substr(0, size));
    const RawIndex index = ReadRawIndex(dir / "cut.raw");
    const std::size_t into = (size - kBlock) % kRecordSize;
    const bool padding = into >= kBlock + kWidth * kHeight;  // the pixels are all there
    EXPECT_EQ(index.records.size(), (size - kBlock) / kRecordSize + (padding ? 1 : 0)) << size;
    EXPECT_EQ(index.truncated, into != 0 && !padding) << size;
  }
}

TEST(RawFile, PixelsThatStartAtABlockAreWrittenWithoutACopyAndStayUnchanged) {
  const TempDir dir;
  // As a camera's buffer: aligned, and longer than the image.
  auto* memory = static_cast<std::uint8_t*>(std::aligned_alloc(kRawBlock, 3 * kRawBlock));
  std::memset(memory, 0xee, 3 * kRawBlock);
  std::memcpy(memory, Pixels(5).data(), kWidth * kHeight);
  {
    RawFileWriter writer(dir / "a.raw", "A");
    EXPECT_EQ(writer.Append(HeaderOf(1), memory), Crc32(memory, kWidth * kHeight));
    writer.Append(HeaderOf(2), memory + 1);
    writer.Append(HeaderOf(3), memory);
    writer.Close();
  }
  const RawIndex index = ReadRawIndex(dir / "a.raw");
  ASSERT_EQ(index.records.size(), 3U);
  EXPECT_EQ(ReadRawImage(dir / "a.raw", index.records[2]).pixels, Pixels(5));
  const ImageU8 shifted = ReadRawImage(dir / "a.raw", index.records[1]);
  EXPECT_EQ(std::memcmp(shifted.pixels.data(), memory + 1, shifted.pixels.size()), 0);
  EXPECT_EQ(std::filesystem::file_size(dir / "a.raw"), kBlock + 3 * kRecordSize);
  std::free(memory);
}

TEST(RawFile, ReservedRoomIsInvisibleAndGivenBack) {
  const TempDir dir;
  const auto blocks = [&](const std::filesystem::path& path) {
    struct stat status {};
    ::stat(path.c_str(), &status);
    return static_cast<std::size_t>(status.st_blocks) * 512;
  };
  RawFileWriter writer(dir / "a.raw", "A", {.reserve_bytes = 8 << 20});
  writer.Append(HeaderOf(1), Pixels(1).data());
  const auto partial = dir / "a.raw.partial";
  EXPECT_EQ(std::filesystem::file_size(partial), kBlock + kRecordSize);
  EXPECT_FALSE(ReadRawIndex(partial).truncated);
  EXPECT_EQ(ReadRawIndex(partial).skipped_bytes, 0U);
  if (blocks(partial) < (8U << 20)) GTEST_SKIP() << "this file system cannot set room aside";
  writer.Close();
  EXPECT_LT(blocks(dir / "a.raw"), 64U << 10);
}

TEST(RawFile, DiscardChecksumsAndMakesNoFile) {
  const TempDir dir;
  RawFileWriter writer(dir / "a.raw", "A", {.discard = true});
  const std::vector<std::uint8_t> pixels = Pixels(3);
  EXPECT_EQ(writer.Append(HeaderOf(1), pixels.data()), Crc32(pixels.data(), pixels.size()));
  writer.Close();
  EXPECT_THROW(writer.Append(HeaderOf(2), pixels.data()), Error);
  EXPECT_TRUE(std::filesystem::is_empty(dir.Path()));
}

TEST(RawFile, AZeroTailIsNoRecord) {
  const TempDir dir;
  const std::string bytes = Record(dir / "a.raw", 2) + std::string(5 * kBlock, '\0');
  WriteStringAtomically(dir / "b.raw", bytes);
  const RawIndex index = ReadRawIndex(dir / "b.raw");
  EXPECT_EQ(index.records.size(), 2U);
  EXPECT_EQ(index.end, kBlock + 2 * kRecordSize);
  EXPECT_TRUE(index.truncated);
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
  bytes[kBlock + kRecordSize + 20] ^= 1;  // header of the second record
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
  bytes[kBlock + kRecordSize + kBlock + 100] ^= 1;
  WriteStringAtomically(dir / "b.raw", bytes);
  const RawIndex index = ReadRawIndex(dir / "b.raw");
  ASSERT_EQ(index.records.size(), 2U);
  EXPECT_NO_THROW(ReadRawImage(dir / "b.raw", index.records[0]));
  EXPECT_TRUE(CheckRawRecord(dir / "b.raw", index.records[0]));
  EXPECT_FALSE(CheckRawRecord(dir / "b.raw", index.records[1]));
  EXPECT_THAT(ErrorOf([&] { ReadRawImage(dir / "b.raw", index.records[1]); }),
              HasSubstr("b.raw: record of trigger 2 fails its checksum"));
}

TEST(RawFile, RefusesOtherFilesAndVersions) {
  const TempDir dir;
  std::string bytes = Record(dir / "a.raw", 1);
  bytes[8] = 9;
  const std::uint32_t crc = Crc32(bytes.data(), 60);
  std::memcpy(&bytes[60], &crc, 4);
  WriteStringAtomically(dir / "b.raw", bytes);
  EXPECT_THAT(ErrorOf([&] { ReadRawIndex(dir / "b.raw"); }),
              HasSubstr("b.raw: format version 9 is unknown"));
  bytes[20] ^= 1;
  WriteStringAtomically(dir / "b.raw", bytes);
  EXPECT_THAT(ErrorOf([&] { ReadRawIndex(dir / "b.raw"); }),
              HasSubstr("the file header is damaged"));
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
    const FileSizeLimit limit(kBlock + kRecordSize + kRecordSize / 2 + 7);
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
