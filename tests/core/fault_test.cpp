#include "core/fault.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/rig_config.h"
#include "tests/support/error_matcher.h"

namespace sole {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;

std::string ParseError(const std::string& text) {
  return ErrorOf([&] { ParseFault(text); });
}

TEST(ParseFault, EveryKindIsReadByItsName) {
  for (const FaultKind& kind : FaultKinds()) {
    const FaultConfig fault = ParseFault(kind.name);
    EXPECT_EQ(fault.name, kind.name);
    EXPECT_GE(fault.trigger, 1);
    const std::string amount = "1" + std::string(kind.unit);
    if (kind.low <= 1 && kind.high >= 1) {
      EXPECT_EQ(ParseFault(fault.name + "::" + amount).unit, kind.unit) << amount;
    }
  }
}

TEST(ParseFault, CameraAmountUnitAndTriggerAreRead) {
  const FaultConfig dead = ParseFault("dead-link:CAM-2:1.5s@40");
  EXPECT_EQ(dead.camera, "CAM-2");
  EXPECT_EQ(dead.amount, 1.5);
  EXPECT_EQ(dead.trigger, 40);
  const FaultConfig turned = ParseFault("bumped-camera:C3:0.25deg");
  EXPECT_EQ(turned.amount, 0.25);
  EXPECT_EQ(turned.unit, "deg");
  EXPECT_EQ(ParseFault("bumped-camera").unit, "mm");
  EXPECT_EQ(ParseFault("bumped-camera").amount, 1);
  EXPECT_EQ(ParseFault("projector-off::2").amount, 2);
  EXPECT_EQ(ParseFault("clock-drift:C1:-20").amount, -20);
}

TEST(ParseFault, MistakesSayWhatIsPossible) {
  const std::string unknown = ParseError("frog:C1");
  for (const FaultKind& kind : FaultKinds()) EXPECT_THAT(unknown, HasSubstr(kind.name));
  EXPECT_THAT(ParseError(""), HasSubstr("lost-packets"));
  EXPECT_THAT(ParseError("fog:C1:much"), HasSubstr("'much' is no number"));
  EXPECT_THAT(ParseError("fog:C1:1.5"), HasSubstr("must be 0 to 1"));
  EXPECT_THAT(ParseError("fog:C1:nan"), HasSubstr("must be 0 to 1"));
  EXPECT_THAT(ParseError("fog:C1:0.5mm"), HasSubstr("give a plain number"));
  EXPECT_THAT(ParseError("bumped-camera:C1:1rad"), HasSubstr("use mm or deg"));
  EXPECT_THAT(ParseError("lights-on:C1"), HasSubstr("whole rig"));
  EXPECT_THAT(ParseError("fog:C1:0.5:2"), HasSubstr("NAME[:CAMERA"));
  EXPECT_THAT(ParseError("fog@0"), HasSubstr("from 1"));
  EXPECT_THAT(ParseError("fog@2.5"), HasSubstr("whole number"));
}

TEST(Validate, FaultsMustFitTheRig) {
  RigConfig config = MakeDefaultRig(4);
  config.simulation.faults = {MakeFault("fog", config.cameras[1].serial)};
  Validate(config);
  config.simulation.faults = {MakeFault("fog", "NOBODY")};
  EXPECT_THAT(ErrorOf([&] { Validate(config); }), HasSubstr("no camera 'NOBODY'"));
  config.simulation.faults = {MakeFault("projector-off", "", 60)};
  EXPECT_THAT(ErrorOf([&] { Validate(config); }), HasSubstr("projectors"));
}

}  // namespace
}  // namespace sole
