// Options of `sole record` and `sole rig init` that are refused or kept, through the program.
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/simulation.h"
#include "io/rig_file.h"
#include "io/take.h"
#include "tests/app/run_program.h"
#include "tests/support/temp_dir.h"

namespace sole {
namespace {

using testing::HasSubstr;
using testing_support::ProgramResult;
using testing_support::RunSole;
using testing_support::TempDir;

/// Two cameras that show grey.
RigConfig SmallRig() {
  RigConfig config = MakeDefaultRig(4, 160, 120);
  config.cameras.resize(2);
  config.pairs.resize(1);
  for (std::size_t i = 0; i < 2; ++i) {
    config.cameras[i].address = "127.0.216." + std::to_string(i + 1);
    config.cameras[i].serial = "OPT" + std::to_string(i + 1);
  }
  config.pairs[0] = {"below", "OPT1", "OPT2"};
  config.trigger.bus_port = 17971;
  config.trigger.rate_hz = 20;
  return config;
}

TEST(Record, NamesAreRefusedUnlessAllowedAndConsentIsKept) {
  const TempDir directory;
  const std::string rig = (directory / "rig.toml").string();
  const RigConfig config = SmallRig();
  io::WriteRigFile(rig, config);
  app::RenderedTake rendered;
  rendered.sets.resize(1, std::vector<ImageU8>(2, ImageU8(160, 120, 40)));
  const sim::CameraServer server = app::ServeRendered(config, rendered);
  const auto record = [&](const std::string& arguments, const std::string& before = ":") {
    return RunSole("record " + rig + " --frames 4 --no-image-check " + arguments, before);
  };

  const ProgramResult refused = record("--subject 'Anna Meier' --take " + (directory / "a").string());
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.output, HasSubstr("looks like a person's name"));
  EXPECT_FALSE(std::filesystem::exists(directory / "a"));

  const ProgramResult allowed = record("--allow-name --subject 'Blue Heron' --consent 'research, no pictures' --notes n1 --take " +
                                       (directory / "b").string());
  EXPECT_EQ(allowed.status, 0) << allowed.output;
  EXPECT_THAT(allowed.output, HasSubstr("done 4 of 4 triggers, 8 frames stored")) << "plain lines where there is no terminal";
  EXPECT_EQ(allowed.output.find('\x1b'), std::string::npos);
  const io::TakeInfo info = io::ReadTakeInfo(io::TakePaths{directory / "b"});
  EXPECT_EQ(info.subject, "Blue Heron");
  EXPECT_EQ(info.consent, "research, no pictures");
  EXPECT_EQ(info.notes, "n1");

  // The images are grey: looked at, they have no dots, and the exit status says so.
  const ProgramResult looked = RunSole("record " + rig + " --frames 4 --subject S1 --take " + (directory / "c").string());
  EXPECT_EQ(looked.status, 3) << looked.output;
  EXPECT_THAT(looked.output, HasSubstr("camera OPT1 sees no dots"));
}

TEST(RigInit, WritesAFileOnceAndNamesWhatIsMissing) {
  const TempDir directory;
  const RigConfig config = SmallRig();
  app::RenderedTake rendered;
  rendered.sets.resize(1, std::vector<ImageU8>(2, ImageU8(160, 120, 40)));
  const sim::CameraServer server = app::ServeRendered(config, rendered);
  const std::string out = (directory / "new.toml").string();
  const ProgramResult made = RunSole("rig init --serial OPT1 --serial OPT2 --out " + out);
  EXPECT_EQ(made.status, 0) << made.output;
  EXPECT_THAT(made.output, HasSubstr("edit position_m"));
  const RigConfig read = io::ReadRigFile(out);
  ASSERT_EQ(read.cameras.size(), 2u);
  EXPECT_EQ(read.cameras[1].serial, "OPT2");
  EXPECT_EQ(read.cameras[1].width, 160);
  EXPECT_EQ(RunSole("rig init --serial OPT1 --out " + out).status, 1) << "nothing is overwritten";
  const ProgramResult missing = RunSole("rig init --serial OPT7 --out " + (directory / "x.toml").string());
  EXPECT_EQ(missing.status, 1);
  EXPECT_THAT(missing.output, HasSubstr("OPT7"));
  EXPECT_FALSE(std::filesystem::exists(directory / "x.toml"));
}

}  // namespace
}  // namespace sole
