#include "io/rig_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/atomic_file.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;
using testing_support::ErrorOf;
using testing_support::TempDir;

/// A minimal rig; `more` goes into its [[camera]], which ends in line 5.
std::string Minimal(const std::string& more = "") {
  return "name = \"small\"\n\n[[camera]]\nserial = \"A\"\nlook_at_m = [1, 0, 0]\n" + more;
}

std::string ErrorIn(const std::string& toml) {
  return ErrorOf([&] { ParseRig(toml, "rig.toml"); });
}

TEST(FormatRig, RoundTripsEveryFieldExactly) {
  RigConfig config = MakeDefaultRig(8, 812, 618);
  config.name = "a \"quoted\" \\ name\twith\nlines ü";
  for (std::size_t i = 0; i < config.cameras.size(); ++i) {
    CameraConfig& camera = config.cameras[i];
    const double x = static_cast<double>(i) / 7;
    camera.focal_px = 1000 + x;
    camera.exposure_us = 1e-7 + x;
    camera.gain_db = -x;
    camera.packet_size = 1500 + static_cast<int>(i);
    camera.packet_delay_ns = static_cast<int>(i) * 1000;
  }
  config.cameras[1].role = "sole \"left\"";
  config.cameras[2].offset_x = 16;
  config.cameras[3].offset_y = 4;
  config.trigger.source = "action";
  config.trigger.rate_hz = 29.97;
  config.trigger.exposures = {ExposureKind::kSpeckle, ExposureKind::kTexture};
  config.trigger.exposure_gap_s = 1.0 / 300;
  config.trigger.warmup = 0;
  config.trigger.pre_roll_s = 1.5;
  config.trigger.post_roll_s = 0.5;
  config.trigger.gpio_chip = "gpiochip4";
  config.trigger.gpio_line = "0";
  config.trigger.readback_line = "EXPOSURE";
  config.trigger.pulse_us = 150;
  config.trigger.strobes = {{"dots", "3", {ExposureKind::kSpeckle}},
                            {"panels", "LIGHT", {ExposureKind::kSpeckle, ExposureKind::kTexture}}};
  config.trigger.action_address = "10.0.0.255";
  config.trigger.action_device_key = 4294967295U;
  config.trigger.action_group_key = 7;
  config.trigger.action_group_mask = 3;
  config.trigger.bus_port = 17999;
  config.disk = {1000, 0.7, 0};
  config.plate.size_x_m = 1.0 / 3;
  config.plate.size_y_m = 1e22;
  config.plate.thickness_m = 0.0151;
  config.plate.index = 1.5203;
  config.target = {0.2, 7, 0.025, 0.01875};
  config.sheet = {0.2, 0.1 + 0.2, 0.000125};
  config.simulation.noise = 0.1;
  config.simulation.faults = {MakeFault("fog", config.cameras[2].serial, 0.3, "", 4),
                              MakeFault("bumped-camera", "", 0.1, "deg"), MakeFault("reboot")};
  const RigConfig read = ParseRig(FormatRig(config), "rig.toml");
  EXPECT_EQ(FormatRig(read), FormatRig(config));  // every field is printed, and printed exactly
  EXPECT_EQ(read.name, config.name);
  ASSERT_EQ(read.cameras.size(), 8U);
  EXPECT_EQ(read.cameras[3].focal_px, config.cameras[3].focal_px);
  EXPECT_EQ(read.cameras[3].position_m, config.cameras[3].position_m);
  EXPECT_EQ(read.cameras[3].up, config.cameras[3].up);
  EXPECT_EQ(read.cameras[3].packet_delay_ns, 3000);
  EXPECT_EQ(read.cameras[3].address, config.cameras[3].address);
  EXPECT_EQ(read.pairs[2].name, config.pairs[2].name);
  EXPECT_EQ(read.cameras[1].role, config.cameras[1].role);
  EXPECT_EQ(read.cameras[2].offset_x, 16);
  EXPECT_EQ(read.cameras[3].offset_y, 4);
  EXPECT_EQ(read.trigger.gpio_line, "0");
  EXPECT_EQ(read.trigger.readback_line, "EXPOSURE");
  EXPECT_EQ(read.trigger.exposures, config.trigger.exposures);
  EXPECT_EQ(read.trigger.exposure_gap_s, config.trigger.exposure_gap_s);
  ASSERT_EQ(read.trigger.strobes.size(), 2U);
  EXPECT_EQ(read.trigger.strobes[1].line, "LIGHT");
  EXPECT_EQ(read.trigger.strobes[1].exposures, config.trigger.strobes[1].exposures);
  EXPECT_EQ(read.trigger.action_device_key, 4294967295U);
  EXPECT_EQ(read.disk.reserve_mb, 1000);
  EXPECT_EQ(read.disk.write_test_mb, 0);
  EXPECT_EQ(read.trigger.bus_port, 17999);
  EXPECT_EQ(read.plate.size_y_m, 1e22);
  EXPECT_EQ(read.plate.fiducials.size(), config.plate.fiducials.size());
  EXPECT_EQ(read.plate.fiducials[4].centre_m, config.plate.fiducials[4].centre_m);
  EXPECT_EQ(read.target.marker_m, config.target.marker_m);
  EXPECT_EQ(read.sheet.size_y_m, config.sheet.size_y_m);
  EXPECT_EQ(read.sheet.thickness_m, 0.000125);
  EXPECT_EQ(read.simulation.projectors.size(), config.simulation.projectors.size());
  ASSERT_EQ(read.simulation.faults.size(), 3U);
  EXPECT_EQ(read.simulation.faults[0].camera, config.cameras[2].serial);
  EXPECT_EQ(read.simulation.faults[0].trigger, 4);
  EXPECT_EQ(read.simulation.faults[1].amount, 0.1);
  EXPECT_EQ(read.simulation.faults[1].unit, "deg");
  EXPECT_EQ(RigIdentityHash(read), RigIdentityHash(config));
}

TEST(ParseRig, FaultsTakeTheDefaultsOfTheirKindAndAreChecked) {
  const auto with = [](const std::string& keys) { return Minimal("[[simulation.fault]]\n" + keys); };
  const RigConfig read = ParseRig(with("name = \"dead-link\"\ncamera = \"A\"\n"), "rig.toml");
  ASSERT_EQ(read.simulation.faults.size(), 1U);
  EXPECT_EQ(read.simulation.faults[0].trigger, 3);
  EXPECT_EQ(read.simulation.faults[0].amount, 1);
  EXPECT_EQ(read.simulation.faults[0].unit, "s");
  EXPECT_THAT(ErrorIn(with("name = \"frog\"\n")),
              AllOf(StartsWith("rig.toml:7:8: there is no fault 'frog'"), HasSubstr("fog")));
  EXPECT_THAT(ErrorIn(with("name = \"fog\"\namount = 2\n")), HasSubstr("must be 0 to 1"));
  EXPECT_THAT(ErrorIn(with("name = \"fog\"\ncamera = \"B\"\n")), HasSubstr("no camera 'B'"));
  EXPECT_THAT(ErrorIn(with("name = \"fog\"\ntriger = 2\n")), HasSubstr("did you mean trigger"));
}

TEST(ParseRig, LinesAreNumbersOrNames) {
  const RigConfig read = ParseRig(
      Minimal("[trigger]\ngpio_line = 4\nreadback_line = \"GPIO22\"\n[[trigger.strobe]]\nline = 5\n"), "rig.toml");
  EXPECT_EQ(read.trigger.gpio_line, "4");
  EXPECT_EQ(read.trigger.readback_line, "GPIO22");
  EXPECT_EQ(read.trigger.strobes.at(0).line, "5");
  EXPECT_THAT(ErrorIn(Minimal("[trigger]\ngpio_line = -4\n")), HasSubstr("a number from 0 or a name"));
  EXPECT_THAT(ErrorIn(Minimal("[trigger]\n[[trigger.strobe]]\nname = \"dots\"\n")), HasSubstr("needs a GPIO line"));
}

TEST(ParseRig, ExposuresOfACycleMustFit) {
  const auto trigger = [](const std::string& keys) { return Minimal("[trigger]\n" + keys); };
  EXPECT_THAT(ErrorIn(trigger("exposures = [\"speckle\", \"dark\"]\n")), HasSubstr("rig.toml:7:13: key 'exposures'"));
  EXPECT_THAT(ErrorIn(trigger("exposures = []\n")), HasSubstr("is empty"));
  EXPECT_THAT(ErrorIn(trigger("exposures = 1\n")), HasSubstr("list of texts"));
  EXPECT_THAT(ErrorIn(trigger("rate_hz = 50\nexposures = [\"speckle\", \"texture\"]\nexposure_gap_s = 0.02\n")),
              HasSubstr("do not fit"));
}

TEST(ParseRig, MissingKeysTakeTheDefaults) {
  const RigConfig read = ParseRig(Minimal(), "rig.toml");
  EXPECT_EQ(read.cameras[0].width, CameraConfig{}.width);
  EXPECT_EQ(read.cameras[0].packet_size, CameraConfig{}.packet_size);
  EXPECT_EQ(read.trigger.rate_hz, TriggerConfig{}.rate_hz);
  EXPECT_EQ(read.plate.index, PlateConfig{}.index);
  EXPECT_TRUE(read.plate.fiducials.empty());
}

TEST(ParseRig, UnknownKeysSayWhereAndWhatWasMeant) {
  EXPECT_EQ(ErrorIn(Minimal("  fokal_px = 3\n")),
            "rig.toml:6:3: unknown key 'fokal_px' in [[camera]]: did you mean focal_px?");
  EXPECT_EQ(ErrorIn("nane = 1\n" + Minimal()),
            "rig.toml:1:1: unknown key 'nane': did you mean name?");
  EXPECT_THAT(ErrorIn(Minimal("[plate]\nrefraction = 1.5\n")),
              HasSubstr("rig.toml:7:1: unknown key 'refraction' in [plate]: known are"));
  EXPECT_EQ(
      ErrorIn(Minimal("[[simulation.projector]]\nposition = [0, 0, 0]\nlook_at_m = [0, 0, 1]\n")),
      "rig.toml:7:1: unknown key 'position' in [[simulation.projector]]: did you mean position_m?");
}

TEST(ParseRig, WrongTypesSayWhere) {
  EXPECT_EQ(ErrorIn(Minimal("focal_px = \"3\"\n")),
            "rig.toml:6:12: key 'focal_px' in [[camera]] must be a number");
  EXPECT_EQ(ErrorIn(Minimal("width = 640.5\n")),
            "rig.toml:6:9: key 'width' in [[camera]] must be an integer");
  EXPECT_EQ(ErrorIn(Minimal("up = [0, 1]\n")),
            "rig.toml:6:6: key 'up' in [[camera]] must be a list of 3 numbers");
  EXPECT_EQ(ErrorIn(Minimal("gain_db = nan\n")),
            "rig.toml:6:11: key 'gain_db' in [[camera]] must be finite");
  EXPECT_EQ(ErrorIn("plate = 3\n" + Minimal()),
            "rig.toml:1:9: key 'plate' must be a table: write [plate]");
  EXPECT_EQ(ErrorIn("camera = 3\n"),
            "rig.toml:1:10: key 'camera' must be a list of tables: write [[camera]]");
  EXPECT_EQ(ErrorIn("camera = [3]\n"),
            "rig.toml:1:10: key 'camera' must be a list of tables: write [[camera]]");
}

TEST(ParseRig, ImpossibleValuesSayWhere) {
  EXPECT_EQ(ErrorIn(Minimal("width = 20\n")),
            "rig.toml:6:9: key 'width' in [[camera]] is 20, allowed are 64 to 16384");
  EXPECT_THAT(ErrorIn(Minimal("exposure_us = 0\n")),
              StartsWith("rig.toml:6:15: key 'exposure_us' in [[camera]] is 0"));
  EXPECT_THAT(ErrorIn(Minimal("[plate]\nindex = 0.9\n")),
              StartsWith("rig.toml:7:9: key 'index' in [plate] is 0.9"));
  EXPECT_EQ(ErrorIn(Minimal("up = [-2, 0, 0]\n")),
            "rig.toml:6:6: key 'up' in [[camera]] is parallel to the viewing direction");
  EXPECT_EQ(ErrorIn(Minimal("[trigger]\nsource = \"usb\"\n")),
            "rig.toml:7:10: key 'source' in [trigger] is 'usb': use simulated, gpio, action or software");
  EXPECT_EQ(ErrorIn(Minimal("[[camera]]\nserial = \"A\"\nlook_at_m = [1, 0, 0]\n")),
            "rig.toml:7:10: key 'serial' in [[camera]] appears twice");
  EXPECT_EQ(ErrorIn(Minimal("[[pair]]\nleft = \"A\"\nright = \"B\"\n")),
            "rig.toml:8:9: key 'right' in [[pair]] names no camera: there is no serial 'B'");
  EXPECT_EQ(ErrorIn("[[camera]]\nserial = \"../A\"\nlook_at_m = [0, 0, 1]\n"),
            "rig.toml:2:10: key 'serial' in [[camera]] names files: at most 43 characters, no "
            "slash and no leading dot");
  EXPECT_THAT(ErrorIn(Minimal("[[plate.fiducial]]\nid = 3\nsize_m = 0.01\n")),
              StartsWith("rig.toml:6:1: key 'centre_m' in [[plate.fiducial]] is missing"));
  EXPECT_THAT(ErrorIn(Minimal("[target]\nsquares = 9\n")), HasSubstr("longer than edge_m"));
  EXPECT_EQ(ErrorIn("format_version = 2\n" + Minimal()),
            "rig.toml:1:18: key 'format_version' is 2, allowed are 1 to 1");
  EXPECT_THAT(ErrorIn("name = \"empty\"\n"), HasSubstr("a rig needs at least one [[camera]]"));
}

TEST(ParseRig, SyntaxErrorsSayWhere) {
  EXPECT_THAT(ErrorIn(Minimal("width = = 3\n")), StartsWith("rig.toml:6:"));
  EXPECT_THAT(ErrorIn("name = \"open\n"), StartsWith("rig.toml:1:"));
}

TEST(ReadRigFile, PutsThePathInFrontOfErrors) {
  const TempDir dir;
  EXPECT_THAT(ErrorOf([&] { ReadRigFile(dir / "none.toml"); }),
              HasSubstr("none.toml: No such file"));
  WriteStringAtomically(dir / "r.toml", Minimal("x = 1\n"));
  EXPECT_THAT(ErrorOf([&] { ReadRigFile(dir / "r.toml"); }),
              StartsWith((dir / "r.toml").string() + ":6:1: "));
}

}  // namespace
}  // namespace sole::io
