// What the program says to input that it cannot use: one clear line, exit status 1, earlier files untouched.

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/atomic_file.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "tests/app/run_program.h"
#include "tests/app/small_take.h"
#include "tests/support/temp_dir.h"

namespace sole {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing_support::NominalCalibration;
using testing_support::ProgramResult;
using testing_support::RunSole;
using testing_support::SmallRig;
using testing_support::TempDir;
using testing_support::WriteDarkTake;

void ExpectOneLine(const ProgramResult& result, const std::vector<std::string>& parts) {
  EXPECT_EQ(result.status, 1) << result.output;
  EXPECT_EQ(result.ErrorLines(), 1) << result.output;
  for (const std::string& part : parts) EXPECT_THAT(result.output, HasSubstr(part));
}

class BadInput : public testing::Test {
 protected:
  BadInput() {
    WriteDarkTake(take, rig, 2);
    io::WriteCalibration(calibration, NominalCalibration(rig));
  }
  std::string Reconstruct() const {
    return "reconstruct " + take.string() + " --calibration " + calibration.string();
  }

  TempDir directory;
  RigConfig rig = SmallRig();
  fs::path take = directory / "take";
  fs::path calibration = directory / "calibration.json";
};

TEST_F(BadInput, WrongUsageIsStatusTwo) {
  EXPECT_EQ(RunSole("").status, 2);
  EXPECT_EQ(RunSole("frobnicate").status, 2);
  EXPECT_EQ(RunSole("reconstruct").status, 2);
  EXPECT_EQ(RunSole("--help").status, 0);
}

TEST_F(BadInput, EveryCommandHasHelpWithAnExample) {
  for (const char* command : {"demo", "sim serve", "sim render", "sim people", "sim scans", "rig check", "record", "calibrate", "calibrate check", "calibrate export", "calibrate ground", "calibrate import", "target print", "reconstruct", "contact",
                              "fit", "process", "measure", "export", "evaluate", "match", "model info",
                              "model convert", "model pose", "model separate"}) {
    const ProgramResult help = RunSole(std::string(command) + " --help");
    EXPECT_EQ(help.status, 0) << command;
    EXPECT_THAT(help.output, HasSubstr("Example: sole " + std::string(command)));
  }
}

TEST_F(BadInput, PicturesThatCannotBeCalibrated) {
  const std::string out = " --out " + (directory / "c.json").string();
  const auto calibrate = [&](const std::string& folder, const std::string& target) {
    return RunSole("calibrate --images " + (directory / folder).string() + " --target " + target + out);
  };
  EXPECT_EQ(RunSole("calibrate" + out).status, 2);
  ExpectOneLine(calibrate("none", "chessboard:9x6:25mm"), {"none", "is not a folder"});
  fs::create_directories(directory / "pictures" / "left");
  ExpectOneLine(calibrate("pictures", "chessboard:9x6:25mm"), {"holds no pictures"});
  ExpectOneLine(calibrate("pictures", "chessboard:9x6:25cm"), {"'25cm' is no length", "25mm"});
  ExpectOneLine(calibrate("pictures", "circles:4x5"), {"circles:4x5", "chessboard:COLUMNSxROWS:SQUARE"});
  io::WriteImage(directory / "pictures" / "left" / "1.png", ImageU8(320, 240, 90));
  io::WriteImage(directory / "pictures" / "left" / "2.png", ImageU8(640, 480, 90));
  ExpectOneLine(calibrate("pictures", "chessboard:9x6:25mm"), {"2.png: is 640x480, but 1.png of the same camera 320x240"});
  fs::remove(directory / "pictures" / "left" / "2.png");
  ExpectOneLine(calibrate("pictures", "chessboard:9x6:25mm"), {"camera left sees the whole chessboard in 0 of 1 pictures"});
  EXPECT_FALSE(fs::exists(directory / "c.json"));
}

TEST_F(BadInput, CrossCheckNeedsColmapAndCamerasInAir) {
  const std::string out = " --out " + (directory / "c.json").string(), calibrate = "calibrate " + take.string() + out + " --method ";
  EXPECT_EQ(RunSole(calibrate + "bundler").status, 2);
  EXPECT_EQ(RunSole("calibrate --images pictures --target chessboard:9x6:25mm --method both" + out).status, 2);
  ExpectOneLine(RunSole(calibrate + "both", "PATH=/nowhere"), {"the program colmap is not installed: run scripts/setup"});
  ExpectOneLine(RunSole(calibrate + "colmap"), {"2 of 4 cameras look through the glass", "--method both"});
  EXPECT_FALSE(fs::exists(directory / "c.json"));
}

TEST_F(BadInput, TakeWithoutTheCubeDoesNotCalibrate) {
  const fs::path out = directory / "cube.json";
  ExpectOneLine(RunSole("calibrate " + take.string() + " --out " + out.string()),
                {"camera SIM0001 sees the target in 0 of 2 frames", "check its aim, light and focus"});
  EXPECT_FALSE(fs::exists(out));
}

TEST_F(BadInput, GroundNeedsTheSheetAndTheSameRig) {
  const fs::path out = directory / "with-ground.json";
  const std::string ground = "calibrate ground " + take.string() + " --calibration " + calibration.string();
  EXPECT_EQ(RunSole(ground).status, 2);
  ExpectOneLine(RunSole(ground + " --out " + out.string()), {take.string(), "0 points of the contact sheet", "lay the speckled sheet"});
  EXPECT_FALSE(fs::exists(out));
}

TEST_F(BadInput, TargetsThatCannotBePrinted) {
  const std::string out = " --out " + (directory / "print").string();
  EXPECT_EQ(RunSole("target print" + out).status, 2);
  ExpectOneLine(RunSole("target print sphere" + out), {"'sphere'", "charuco:COLUMNSxROWS"});
  ExpectOneLine(RunSole("target print aprilgrid:40x40:30mm:0.3" + out), {"1600 markers"});
  ExpectOneLine(RunSole("target print cube --page A9" + out), {"'A9'", "A4"});
  ExpectOneLine(RunSole("target print cube --rig " + (directory / "none.toml").string() + out), {"none.toml"});
  EXPECT_FALSE(fs::exists(directory / "print"));
}

TEST_F(BadInput, DriftCheckNeedsMarksAndTheSameRig) {
  const std::string check = "calibrate check " + take.string() + " --calibration " + calibration.string();
  ExpectOneLine(RunSole(check), {"no camera sees enough fiducials"});
  EXPECT_EQ(RunSole(check + " --readjust").status, 2);
  RigConfig other = rig;
  other.cameras[0].serial = "OTHER01";
  other.pairs[0].left = "OTHER01";
  io::WriteCalibration(calibration, NominalCalibration(other));
  ExpectOneLine(RunSole(check), {"another rig"});
}

TEST_F(BadInput, RigFileWithUnknownKeyNamesLineAndColumn) {
  io::WriteStringAtomically(directory / "rig.toml", "name = \"x\"\n\n[[camera]]\nserial = \"A\"\nfokal_px = 3000\n");
  ExpectOneLine(RunSole("rig check " + (directory / "rig.toml").string()), {"rig.toml:5:", "fokal_px"});
}

TEST_F(BadInput, RigFileWithImpossibleValueNamesTheLine) {
  io::WriteStringAtomically(directory / "rig.toml", "name = \"x\"\n\n[[camera]]\nserial = \"A\"\nwidth = -4\n");
  ExpectOneLine(RunSole("rig check " + (directory / "rig.toml").string()), {"rig.toml", "width"});
}

TEST_F(BadInput, UnknownFaultNamesThePossibleOnes) {
  io::WriteRigFile(directory / "rig.toml", rig);
  ExpectOneLine(RunSole("sim render " + (directory / "rig.toml").string() + " --fault frog --out " + (directory / "t").string()),
                {"'frog'", "fog", "bumped-camera"});
  ExpectOneLine(RunSole("demo --out " + (directory / "d").string() + " --fault fog:NOBODY"), {"NOBODY"});
}

TEST_F(BadInput, CameraThatIsNotThereIsNamed) {
  io::WriteRigFile(directory / "rig.toml", rig);
  const fs::path target = directory / "new-take";
  ExpectOneLine(RunSole("record " + (directory / "rig.toml").string() + " --subject S1 --frames 2 --take " + target.string()),
                {"SIM0001", "127.0.91.1"});
  EXPECT_FALSE(fs::exists(target / "take.json"));
}

TEST_F(BadInput, TakeWithoutACameraFile) {
  fs::remove(take / "cameras" / "SIM0003.raw");
  ExpectOneLine(RunSole(Reconstruct()), {"SIM0003"});
  EXPECT_FALSE(fs::exists(take / "scans" / "stats.json"));
}

TEST_F(BadInput, TakeWithACutCameraFileIsReadAsFarAsItGoes) {
  const fs::path raw = take / "cameras" / "SIM0002.raw";
  fs::resize_file(raw, fs::file_size(raw) - 100);
  const ProgramResult result = RunSole(Reconstruct());
  EXPECT_EQ(result.status, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("trigger 2, pair below"));
}

TEST_F(BadInput, TakeOfAnotherVersion) {
  std::string info = io::ReadFile(take / "take.json");
  const std::size_t at = info.find("\"format_version\": 1");
  ASSERT_NE(at, std::string::npos) << info;
  info.replace(at, 19, "\"format_version\": 99");
  io::WriteStringAtomically(take / "take.json", info);
  ExpectOneLine(RunSole(Reconstruct()), {"take.json", "99"});
}

TEST_F(BadInput, CalibrationOfAnotherRig) {
  RigConfig other = rig;
  other.cameras[0].serial = "OTHER01";
  other.pairs[0].left = "OTHER01";
  io::WriteCalibration(calibration, NominalCalibration(other));
  ExpectOneLine(RunSole(Reconstruct()), {"calibration.json", "another rig"});
}

TEST_F(BadInput, DamagedCalibration) {
  io::WriteStringAtomically(calibration, "{\"format_version\": 1,");
  ExpectOneLine(RunSole(Reconstruct()), {"calibration.json"});
}

TEST_F(BadInput, FramesWithoutAFootAreReportedNotInvented) {
  ASSERT_EQ(RunSole(Reconstruct()).status, 0);
  EXPECT_EQ(io::ReadPlyCloud(take / "scans" / "000001.ply").Size(), 0u);
  ASSERT_EQ(RunSole("contact " + take.string()).status, 0);
  const ProgramResult fit = RunSole("fit " + take.string());
  EXPECT_EQ(fit.status, 0) << fit.output;
  EXPECT_THAT(fit.output, HasSubstr("trigger 1: no foot"));
  const FitSequence sequence = io::ReadFit(take / "fit.npz");
  ASSERT_EQ(sequence.frames.size(), 2u);
  EXPECT_FALSE(sequence.frames[0].found);
  ExpectOneLine(RunSole("export " + take.string() + " --to glb"), {"nothing to export"});
}

TEST_F(BadInput, StagesSayWhichStageIsMissing) {
  ExpectOneLine(RunSole("contact " + take.string()), {"sole reconstruct"});
  ExpectOneLine(RunSole("measure " + take.string()), {"sole fit"});
  ExpectOneLine(RunSole("evaluate " + take.string()), {"truth"});
  ExpectOneLine(RunSole("process " + take.string()), {"--calibration"});
}

TEST_F(BadInput, UnwritableOutputLeavesNothing) {
  std::ofstream(directory / "file") << "in the way";
  ExpectOneLine(RunSole("demo --out " + (directory / "file" / "demo").string()), {"cannot create folder"});
  EXPECT_EQ(io::ReadFile(directory / "file"), "in the way");
}

TEST_F(BadInput, FullDiskKeepsEarlierFiles) {
  ASSERT_EQ(RunSole(Reconstruct()).status, 0);
  const std::string before = io::ReadFile(take / "calibration.json");
  ASSERT_GT(before.size(), 2048u);
  // No file may grow beyond one block of 512 or 1024 bytes: writing fails as it does on a full disk.
  ExpectOneLine(RunSole(Reconstruct(), "ulimit -f 1"), {"cannot write"});
  EXPECT_EQ(io::ReadFile(take / "calibration.json"), before);
  EXPECT_EQ(std::distance(fs::directory_iterator(take), {}), 6);  // nothing half-written is left
}

TEST_F(BadInput, UnknownMotionModelAndFormatAreNamed) {
  io::WriteRigFile(directory / "rig.toml", rig);
  ExpectOneLine(RunSole("sim render " + (directory / "rig.toml").string() + " --motion moonwalk --out " + (directory / "t").string()),
                {"moonwalk", "stand"});
  ExpectOneLine(RunSole("model info " + (directory / "none.npz").string()), {"none.npz"});
  ExpectOneLine(RunSole("export " + take.string() + " --to fbx"), {"fbx", "glb"});
}

}  // namespace
}  // namespace sole
