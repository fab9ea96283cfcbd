// Every fault of the simulated rig, from the camera's image or the wire to the verdict and its reason
// (the table in docs/faults.md), and a fault-free take, which is good. Images are rendered once.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/epipolar.h"
#include "app/simulation.h"
#include "io/take.h"
#include "sim/true_rig.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

using capture::RecordResult;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing_support::TempDir;

constexpr std::uint64_t kSeed = 5;
constexpr int kFrames = 12;

RigConfig HealthyRig() {
  RigConfig config = MakeDefaultRig(4, 640, 488);
  for (std::size_t i = 0; i < 4; ++i) {
    config.cameras[i].address = "127.0.217." + std::to_string(i + 1);
    config.cameras[i].serial = "CAM" + std::to_string(i + 1);
  }
  config.pairs = {{"below", "CAM1", "CAM2"}, {"dorsum", "CAM3", "CAM4"}};
  config.trigger.bus_port = 17981;
  return config;
}

/// What a perfect calibration would say of the healthy rig.
Rig PerfectCalibration(const RigConfig& config) {
  const sim::TrueRig truth = sim::DrawTrueRig(config, kSeed);
  Rig rig;
  for (const sim::TrueCamera& c : truth.cameras) {
    Camera camera{c.serial, c.width, c.height, Intrinsics::Zero(), c.cam_from_world};
    camera.intrinsics << c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, 0;
    rig.cameras.push_back(camera);
  }
  for (const PairConfig& p : config.pairs)
    rig.pairs.push_back({p.name, CameraIndex(config, p.left), CameraIndex(config, p.right)});
  rig.plate = {truth.plate.thickness_m, truth.plate.index};
  rig.rig_hash = RigIdentityHash(config);
  return rig;
}

/// Rendered once for all tests: a foot that rocks, and a good take of it for reference.
class FaultVerdict : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    simulation_ = new Simulation(HealthyRig(), kSeed);
    healthy_ = new RenderedTake(simulation_->RenderMotion("rock", kFrames));
    directory_ = new TempDir;
    Record({}, *healthy_, kFrames, "reference");
  }
  static void TearDownTestSuite() {
    delete directory_;
    delete healthy_;
    delete simulation_;
  }

  static RecordResult Record(const std::vector<FaultConfig>& faults, const RenderedTake& rendered,
                             std::int64_t triggers, const std::string& name = "") {
    static int number = 0;
    RigConfig config = HealthyRig();
    config.simulation.faults = faults;
    const sim::CameraServer server = ServeRendered(config, rendered);
    capture::RecordOptions options;
    options.directory = *directory_ / (name.empty() ? "take" + std::to_string(++number) : name);
    options.subject = "S1";
    options.triggers = triggers;
    if (name.empty()) options.reference = *directory_ / "reference";
    options.check = [rig = PerfectCalibration(HealthyRig())](const std::filesystem::path& take) {
      return CheckCalibration(take.string(), rig);
    };
    const RecordResult result = capture::Record(config, options);
    const io::TakeInfo info = io::ReadTakeInfo(io::TakePaths{options.directory});
    EXPECT_EQ(info.verdict, result.verdict);
    EXPECT_EQ(info.reasons, result.reasons);
    return result;
  }
  /// A fault on the wire, met with healthy images.
  static RecordResult OnTheWire(const char* fault, const char* camera, std::int64_t triggers = kFrames) {
    return Record({MakeFault(fault, camera)}, *healthy_, triggers);
  }
  /// A fault that is in the images; few are enough.
  static RecordResult InTheImages(const char* fault, const char* camera) {
    simulation_->SetFaults({MakeFault(fault, camera)});
    const RenderedTake rendered = simulation_->RenderMotion("rock", 2);
    simulation_->SetFaults({});
    return Record({}, rendered, 2);
  }

  /// `words` stand in the reasons, of which there are `count`: nothing else is blamed.
  static void Expect(const RecordResult& result, const char* verdict, std::size_t count,
                     const std::vector<const char*>& words) {
    EXPECT_EQ(result.verdict, verdict) << testing::PrintToString(result.reasons);
    EXPECT_EQ(result.reasons.size(), count) << testing::PrintToString(result.reasons);
    for (const char* word : words) EXPECT_THAT(result.reasons, Contains(HasSubstr(word)));
  }

  static Simulation* simulation_;
  static RenderedTake* healthy_;
  static TempDir* directory_;
};
Simulation* FaultVerdict::simulation_ = nullptr;
RenderedTake* FaultVerdict::healthy_ = nullptr;
TempDir* FaultVerdict::directory_ = nullptr;

TEST_F(FaultVerdict, NoFaultIsGood) {
  const RecordResult result = Record({}, *healthy_, kFrames);
  EXPECT_EQ(result.verdict, "good");
  EXPECT_THAT(result.reasons, IsEmpty());
}

TEST_F(FaultVerdict, LostPackets) {
  Expect(OnTheWire("lost-packets", "CAM2", 30), "usable", 1, {"camera CAM2: ", "packets had to be sent again"});
}
TEST_F(FaultVerdict, LateFrames) { Expect(OnTheWire("late-frames", "CAM3"), "usable", 1, {"camera CAM3: frames arrive late"}); }
TEST_F(FaultVerdict, SkippedId) { Expect(OnTheWire("skipped-id", "CAM1"), "usable", 1, {"camera CAM1: skipped a frame id 1 time"}); }
TEST_F(FaultVerdict, RepeatedId) {
  Expect(OnTheWire("repeated-id", "CAM4"), "repeat", 2, {"camera CAM4: 1 of 12 frames lost (triggers 3)", "repeated a frame id"});
}
TEST_F(FaultVerdict, DeadLink) {
  Expect(OnTheWire("dead-link", "CAM2", 30), "repeat", 2, {"camera CAM2: silent for 1.", "after trigger 2, then back by itself"});
}
TEST_F(FaultVerdict, Reboot) {
  Expect(OnTheWire("reboot", "CAM3", 80), "repeat", 2, {"camera CAM3: silent for", "connected again with all settings"});
}
TEST_F(FaultVerdict, Desync) { Expect(OnTheWire("desync", "CAM4"), "repeat", 1, {"camera CAM4: its images lag behind", "by 1 triggers"}); }
TEST_F(FaultVerdict, ClockDrift) { Expect(OnTheWire("clock-drift", "CAM1"), "usable", 1, {"camera CAM1: its clock runs 100 ppm fast"}); }
TEST_F(FaultVerdict, HotPixels) { Expect(InTheImages("hot-pixels", "CAM3"), "usable", 1, {"camera CAM3: ", "stuck bright"}); }
TEST_F(FaultVerdict, Fog) { Expect(InTheImages("fog", "CAM2"), "repeat", 1, {"camera CAM2 is blurred or fogged"}); }
TEST_F(FaultVerdict, BumpedCamera) {
  Expect(InTheImages("bumped-camera", "CAM2"), "repeat", 1, {"pair below (CAM1, CAM2) has left its calibration"});
}
TEST_F(FaultVerdict, ProjectorOff) { Expect(InTheImages("projector-off", ""), "repeat", 1, {"a projector is dark or weak"}); }
TEST_F(FaultVerdict, MissingTrigger) {
  Expect(OnTheWire("missing-trigger", "CAM2"), "repeat", 2, {"camera CAM2: 1 of 12 frames lost (triggers 3)", "missed a trigger pulse"});
  Expect(OnTheWire("missing-trigger", ""), "repeat", 1, {"no camera has a frame of triggers 3: the trigger line missed pulses"});
}
TEST_F(FaultVerdict, DoubleTrigger) { Expect(OnTheWire("double-trigger", "CAM1"), "usable", 1, {"camera CAM1: exposed twice for one trigger 1 time"}); }
TEST_F(FaultVerdict, LightsOn) { Expect(InTheImages("lights-on", ""), "usable", 1, {"the lights are on"}); }

TEST_F(FaultVerdict, EmptyPlateIsTold) {
  RenderedTake empty = *healthy_;
  for (auto& set : empty.sets) {
    for (ImageU8& image : set) {  // what is left without the foot: the marks at the rim
      for (int y = 80; y < image.height - 80; ++y)
        for (int x = 0; x < image.width; ++x) image.At(x, y) = 5;
    }
  }
  const RecordResult result = Record({}, empty, 4);
  EXPECT_EQ(result.verdict, "repeat");
  EXPECT_THAT(result.reasons, Contains(HasSubstr("no foot on the plate")));
}

TEST_F(FaultVerdict, FootStartsAndEndsATake) {
  // Empty plate, then the foot, then empty again.
  RenderedTake visit;
  for (int i = 0; i < 90; ++i) {
    std::vector<ImageU8> set = healthy_->sets[static_cast<std::size_t>(i % kFrames)];
    if (i < 20 || i >= 50) {
      for (ImageU8& image : set) {
        for (int y = 80; y < image.height - 80; ++y)
          for (int x = 0; x < image.width; ++x) image.At(x, y) = 5;
      }
    }
    visit.sets.push_back(std::move(set));
  }
  RigConfig config = HealthyRig();
  config.trigger.pre_roll_s = 0.5;
  config.trigger.post_roll_s = 0.3;
  const sim::CameraServer server = ServeRendered(config, visit);
  capture::RecordOptions options;
  options.directory = *directory_ / "visit";
  options.subject = "S1";
  options.triggers = 0;
  options.start = capture::StartOn::kFoot;
  options.stop_on_foot_off = true;
  const RecordResult result = capture::Record(config, options);
  EXPECT_EQ(result.verdict, "good") << testing::PrintToString(result.reasons);
  const io::TakeReader take(options.directory);
  const auto foot = [&](std::size_t index) {
    const ImageU8 image = *take.Read(index).images[0];
    return capture::FootInView(capture::SampleImage(image.width, image.height, image.pixels));
  };
  // Five frames of pre-roll, the visit's 30, then the settling and post-roll time.
  ASSERT_GT(take.Triggers().size(), 35u);
  EXPECT_LT(take.Triggers().size(), 60u);
  int with_foot = 0;
  for (std::size_t i = 0; i < take.Triggers().size(); ++i) with_foot += foot(i) ? 1 : 0;
  EXPECT_EQ(with_foot, 30) << "not a frame of the visit is missing";
  EXPECT_FALSE(foot(0));
}

}  // namespace
}  // namespace sole::app
