// Faults of the rig file, from rendering to the recorder's verdict.
#include "app/simulation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/atomic_file.h"
#include "io/take.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing_support::TempDir;

RigConfig SmallRig() {
  RigConfig config = MakeDefaultRig(4, 160, 120);
  for (std::size_t i = 0; i < 4; ++i) {
    config.cameras[i].address = "127.0.112." + std::to_string(i + 1);
    config.cameras[i].serial = "FLT" + std::to_string(i + 1);
  }
  config.pairs = {{"below", "FLT1", "FLT2"}, {"dorsum", "FLT3", "FLT4"}};
  config.trigger.bus_port = 17941;
  return config;
}

std::string TruthRigText(const Simulation& simulation) {
  const TempDir directory;
  simulation.WriteTruth(directory.Path());
  return io::ReadFile(io::TakePaths{directory.Path()}.TruthRig());
}

TEST(SimulationFaults, ImagesChangeFromTheirTriggerOnAndHealWithoutThem) {
  const RigConfig healthy = SmallRig();
  RigConfig config = healthy;
  config.simulation.faults = {MakeFault("bumped-camera", "FLT2", 20, "mm", 2), MakeFault("hot-pixels", "FLT1", 0.01, "", 3)};
  Simulation good(healthy, 5), faulty(config, 5);
  const RenderedTake expected = good.RenderCalibration(3), rendered = faulty.RenderCalibration(3);
  for (std::size_t set = 0; set < 3; ++set) {
    for (std::size_t camera = 0; camera < 4; ++camera) {
      const bool changed = (camera == 1 && set >= 1) || (camera == 0 && set >= 2);
      EXPECT_EQ(rendered.sets[set][camera].pixels != expected.sets[set][camera].pixels, changed) << set << " " << camera;
    }
  }
  EXPECT_NE(TruthRigText(faulty), TruthRigText(good)) << "truth has the moved camera";
  faulty.SetFaults({});
  const RenderedTake healed = faulty.RenderCalibration(1);
  EXPECT_EQ(healed.sets[0][1].pixels, expected.sets[0][1].pixels);
  EXPECT_EQ(TruthRigText(faulty), TruthRigText(good));
}

TEST(SimulationFaults, RecorderMeetsThemOnTheWire) {
  RigConfig config = SmallRig();
  config.simulation.faults = {MakeFault("missing-trigger", "FLT3", 2, "", 3)};
  RenderedTake rendered;
  rendered.sets.resize(6, std::vector<ImageU8>(4, ImageU8(160, 120, 40)));
  const TempDir directory;
  capture::RecordOptions options;
  options.directory = directory / "take";
  options.subject = "S1";
  RecordRendered(config, rendered, options);
  const io::TakeInfo info = io::ReadTakeInfo(io::TakePaths{directory / "take"});
  EXPECT_EQ(info.verdict, "repeat");
  EXPECT_THAT(info.reasons, Contains(HasSubstr("camera FLT3: 2 of 6 frames lost (triggers 3, 4)")));
}

}  // namespace
}  // namespace sole::app
