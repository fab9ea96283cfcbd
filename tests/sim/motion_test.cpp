#include "sim/motion.h"

#include <algorithm>
#include <numeric>

#include <gtest/gtest.h>

#include "core/error.h"
#include "sim/reference_foot.h"

namespace sole::sim {
namespace {

TEST(MakeMotion, UnknownMotionListsTheKnownOnes) {
  try {
    MakeMotion(MeanSubject(), {.motion = "fly"});
    FAIL() << "accepted";
  } catch (const Error& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("fly"), std::string::npos);
    for (const std::string& name : MotionNames()) EXPECT_NE(text.find(name), std::string::npos) << name;
  }
}

TEST(MakeMotion, StandingSwaysALittleAndRepeatsForASeed) {
  const MotionOptions options{.motion = "stand", .frames = 3, .rate_hz = 2, .seed = 4};
  const FootMotion motion = MakeMotion(MeanSubject(), options), again = MakeMotion(MeanSubject(), options);
  ASSERT_EQ(motion.frames.size(), 3U);
  EXPECT_EQ(motion.triangles.size(), ReferenceFoot().triangles.size());
  EXPECT_EQ(motion.frames[1].time_s, 0.5);
  double moved = 0;
  for (std::size_t f = 0; f < 3; ++f) {
    const LoadedFoot& foot = motion.frames[f].foot;
    EXPECT_TRUE(foot.balanced);
    EXPECT_TRUE(foot.foot.vertices_m == again.frames[f].foot.foot.vertices_m);
    EXPECT_GT(std::accumulate(foot.contact.begin(), foot.contact.end(), 0), 1000);
    for (std::size_t v = 0; v < foot.contact.size(); ++v) {
      moved = std::max(moved, (foot.foot.vertices_m[v] - motion.frames[0].foot.foot.vertices_m[v]).norm());
    }
  }
  EXPECT_GT(moved, 1e-4);
  EXPECT_LT(moved, 0.012);
}

TEST(MakeMotion, RockingMovesTheLoadForwardAndBack) {
  const FootMotion motion = MakeMotion(MeanSubject(), {.motion = "rock", .frames = 3, .rate_hz = 1, .seed = 2});
  const auto centre = [&](std::size_t f) { return motion.frames[f].foot.pressure_centre_m.y(); };
  EXPECT_GT(centre(1), centre(0) + 0.09);
  EXPECT_NEAR(centre(2), centre(0), 0.01);
  for (const MotionFrame& frame : motion.frames) {
    EXPECT_TRUE(frame.foot.balanced);
    for (const Eigen::Vector3d& v : frame.foot.foot.vertices_m) ASSERT_GE(v.z(), 0);
  }
}

TEST(MakeMotion, AirKeepsTwoToSixCentimetresAndMovesTheToes) {
  const FootMotion motion = MakeMotion(MeanSubject(), {.motion = "air", .frames = 4, .rate_hz = 2, .seed = 3});
  for (const MotionFrame& frame : motion.frames) {
    double lowest = 1;
    for (const Eigen::Vector3d& v : frame.foot.foot.vertices_m) lowest = std::min(lowest, v.z());
    EXPECT_GE(lowest, 0.0199);
    EXPECT_LE(lowest, 0.0601);
    EXPECT_EQ(std::accumulate(frame.foot.contact.begin(), frame.foot.contact.end(), 0), 0);
  }
  EXPECT_NE(motion.frames[0].angles_rad.at("mtp_1.dorsiflexion"), motion.frames[1].angles_rad.at("mtp_1.dorsiflexion"));
}

}  // namespace
}  // namespace sole::sim
