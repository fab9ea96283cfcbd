// `sole take ...` through the program.
#include <csignal>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/atomic_file.h"
#include "io/image_file.h"
#include "tests/app/run_program.h"
#include "tests/support/recorded_take.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using namespace testing_support;

/// Standard output alone.
nlohmann::json JsonOf(const std::string& arguments) {
  const ProgramResult result = RunSole(arguments + " --json");
  const std::size_t begin = result.output.find("{\n");
  return begin == std::string::npos ? nlohmann::json() : nlohmann::json::parse(result.output.substr(begin), nullptr, false);
}

void FlipByte(const fs::path& file, std::size_t at) {
  std::string bytes = io::ReadFile(file);
  bytes[at] = static_cast<char>(bytes[at] ^ 1);
  io::WriteStringAtomically(file, bytes);
}

TEST(TakeVerify, TellsSoundFromDamagedOneLineAFault) {
  const TempDir dir;
  const RigConfig config = TinyRig(2);
  const io::TakePaths take = WriteTinyTake(dir / "take", config, 4);
  const ProgramResult sound = RunSole("take verify " + take.root.string());
  EXPECT_EQ(sound.status, 0);
  EXPECT_THAT(sound.output, HasSubstr("sound: 8 records of 2 cameras and 4 triggers"));
  FlipByte(take.Raw(config.cameras[1].serial), 4 * io::kRawBlock + 5);  // pixels of trigger 2
  fs::remove(take.Raw(config.cameras[0].serial));
  const ProgramResult damaged = RunSole("take verify " + take.root.string());
  EXPECT_EQ(damaged.status, 1);
  EXPECT_THAT(damaged.output, HasSubstr(config.cameras[0].serial + ".raw: is missing: run sole take recover\n"));
  EXPECT_THAT(damaged.output, HasSubstr(config.cameras[1].serial + ".raw: record of trigger 2 does not match its checksum"));
  const nlohmann::json json = JsonOf("take verify " + take.root.string());
  EXPECT_FALSE(json["ok"]);
  EXPECT_EQ(json["faults"].size(), 2U);
  EXPECT_EQ(json["cameras"][1]["records"], 4);
  EXPECT_EQ(RunSole("take verify " + (dir / "none").string()).ErrorLines(), 1);
}

TEST(TakeRecover, MendsWhatVerifyFindsAndSaysWhenThereIsNothing) {
  const TempDir dir;
  const RigConfig config = TinyRig(2);
  const io::TakePaths take = WriteTinyTake(dir / "take", config, 60);
  EXPECT_THAT(RunSole("take recover " + take.root.string()).output, HasSubstr("nothing to recover: closed as complete, verdict good"));
  const fs::path raw = take.Raw(config.cameras[0].serial);
  fs::resize_file(raw, fs::file_size(raw) - 1);
  EXPECT_EQ(RunSole("take verify " + take.root.string()).status, 1);
  const ProgramResult again = RunSole("take recover " + take.root.string());
  EXPECT_THAT(again.output, HasSubstr(config.cameras[0].serial + ": 59 of 60 records, one torn record cut off, missing triggers: 60"));
  EXPECT_THAT(again.output, HasSubstr("verdict usable"));
  EXPECT_THAT(again.output, HasSubstr("reason: recovered: files of the take were damaged"));
  EXPECT_EQ(RunSole("take verify " + take.root.string()).status, 0);
  EXPECT_EQ(JsonOf("take recover " + take.root.string())["changed"], false);
}

TEST(TakeArchive, ArchivesRestoresAndExtractsFromWhatWasRestored) {
  const TempDir dir;
  const RigConfig config = TinyRig(2);
  const io::TakePaths take = WriteTinyTake(dir / "take", config, 5);
  const std::string before = io::ReadFile(take.Raw(config.cameras[0].serial));
  const ProgramResult archived = RunSole("take archive --delete-source " + take.root.string());
  EXPECT_EQ(archived.status, 0) << archived.output;
  EXPECT_THAT(archived.output, HasSubstr("10 frames archived"));
  EXPECT_THAT(archived.output, HasSubstr("2 source files deleted"));
  EXPECT_EQ(JsonOf("take info " + take.root.string())["cameras"][0]["storage"], "archive");
  EXPECT_THAT(RunSole("take extract " + take.root.string() + " --out " + (dir / "x").string()).output, HasSubstr("is archived: run sole take archive --restore"));
  EXPECT_EQ(JsonOf("take archive --restore " + take.root.string())["records"], 10);
  EXPECT_EQ(io::ReadFile(take.Raw(config.cameras[0].serial)), before);
}

TEST(TakeExtract, WritesTheWantedImagesUnderSerialAndTrigger) {
  const TempDir dir;
  const RigConfig config = TinyRig(3);
  const io::TakePaths take = WriteTinyTake(dir / "take", config, 5);
  FlipByte(take.Raw(config.cameras[2].serial), 6 * io::kRawBlock + 5);  // pixels of trigger 3
  const std::string serial = config.cameras[2].serial;
  const ProgramResult result = RunSole("take extract " + take.root.string() + " --to tiff --camera " + serial + " --trigger 2-4 --out " + (dir / "x").string());
  EXPECT_EQ(result.status, 0);
  EXPECT_THAT(result.output, HasSubstr("warning: "));
  EXPECT_THAT(result.output, HasSubstr("2 images, 1 frames of the take are absent"));
  EXPECT_EQ(std::distance(fs::recursive_directory_iterator(dir / "x"), {}), 3);  // with the folder
  EXPECT_EQ(io::ReadImage(dir / "x" / serial / "000002.tiff").pixels, TinyImage(config, 2, 2).pixels);
  EXPECT_EQ(JsonOf("take extract " + take.root.string() + " --out " + (dir / "all").string())["images"], 14);
  EXPECT_EQ(io::ReadImage(dir / "all" / config.cameras[0].serial / "000005.png").pixels, TinyImage(config, 0, 5).pixels);
  const auto fails = [&](const std::string& arguments, int status, const std::string& text) {
    const ProgramResult bad = RunSole("take extract " + take.root.string() + " --out " + (dir / "y").string() + " " + arguments);
    EXPECT_EQ(bad.status, status) << arguments;
    EXPECT_THAT(bad.output, HasSubstr(text));
  };
  fails("--camera NONE", 1, "has no camera 'NONE': its cameras are SIM0001");
  fails("--trigger 4-2", 1, "the range ends before it begins");
  fails("--trigger x", 1, "give a trigger from 1 on");
  fails("--trigger 9", 1, "no trigger in that range");
  fails("--to jpg", 2, "--to");
}

}  // namespace
}  // namespace sole::app
