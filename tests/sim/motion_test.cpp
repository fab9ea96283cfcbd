#include "sim/motion.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Geometry>
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

double VolumeOf(const std::vector<Eigen::Vector3d>& v, const std::vector<Eigen::Vector3i>& triangles) {
  double volume = 0;
  for (const Eigen::Vector3i& t : triangles) {
    const auto at = [&](int i) { return v[static_cast<std::size_t>(t[i])]; };
    volume += at(0).dot(at(1).cross(at(2))) / 6;
  }
  return volume;
}

/// What must hold in every frame of every motion on a plate that bends.
void ExpectPhysical(const Subject& subject, const FootMotion& motion, const MotionFrame& frame) {
  const LoadedFoot& foot = frame.foot;
  EXPECT_TRUE(foot.balanced);
  EXPECT_NEAR(std::accumulate(foot.load_n.begin(), foot.load_n.end(), 0.0), foot.total_load_n, 1e-6);
  double lowest_gap = 1;
  for (const Eigen::Vector3d& v : foot.foot.vertices_m) {
    lowest_gap = std::min(lowest_gap, v.z() + foot.sag.At(v.x(), v.y()));
  }
  EXPECT_GE(lowest_gap, -1e-12);
  EXPECT_EQ(lowest_gap < 1e-4, foot.total_load_n > 0);
  FootPose pose;
  pose.angles_rad = frame.angles_rad;
  const double unloaded = VolumeOf(PoseFoot(subject, pose).vertices_m, motion.triangles);
  EXPECT_NEAR(VolumeOf(foot.foot.vertices_m, motion.triangles) / unloaded, 1, 0.02);
  for (const JointAxis& joint : JointAxes(subject)) {
    const auto angle = frame.angles_rad.find(joint.name);
    if (angle == frame.angles_rad.end()) continue;
    EXPECT_GE(angle->second, joint.min_rad) << joint.name;
    EXPECT_LE(angle->second, joint.max_rad) << joint.name;
  }
}

TEST(MakeMotion, EveryMotionOfAWomanAndAManIsPhysicalOnABendingPlate) {
  for (const std::uint64_t seed : {33U, 87U}) {
    const Subject subject = DrawSubject(seed);
    for (const std::string& name : MotionNames()) {
      SCOPED_TRACE(name + " of " + std::to_string(seed));
      const double rate_hz = name == "run" || name == "jump" ? 12.5 : name == "walk" ? 4.2 : 1.3;
      const FootMotion motion =
          MakeMotion(subject, {.motion = name, .frames = 4, .rate_hz = rate_hz, .seed = seed, .plate = PlateModel{}});
      for (const MotionFrame& frame : motion.frames) ExpectPhysical(subject, motion, frame);
    }
  }
}

/// Share of the touched skin behind the middle of the foot.
double HeelShare(const LoadedFoot& foot) {
  double heel = 0, all = 0;
  for (std::size_t v = 0; v < foot.contact.size(); ++v) {
    if (foot.contact[v] == 0) continue;
    all += 1;
    if (ReferenceFoot().vertices[v].y() < 0.11) heel += 1;
  }
  return heel / all;
}

TEST(MakeMotion, RockingMovesTheContactFromHeelToForefootAndItGrowsWithTheLoad) {
  const Subject subject = DrawSubject(87);
  const auto rock = [&](double load) {
    return MakeMotion(subject, {.motion = "rock", .frames = 5, .rate_hz = 2, .seed = 3, .mean_load = load, .plate = PlateModel{}});
  };
  const FootMotion light = rock(0.3), heavy = rock(0.8);
  for (std::size_t f = 1; f <= 2; ++f) {
    EXPECT_LT(HeelShare(heavy.frames[f].foot), HeelShare(heavy.frames[f - 1].foot));
    EXPECT_GT(HeelShare(heavy.frames[f + 2].foot), HeelShare(heavy.frames[f + 1].foot));
  }
  for (std::size_t f = 0; f < 5; ++f) {
    EXPECT_GT(heavy.frames[f].foot.contact_area_m2, light.frames[f].foot.contact_area_m2);
    EXPECT_GT(heavy.frames[f].foot.sag.At(0, 0), light.frames[f].foot.sag.At(0, 0));
  }
}

TEST(MakeMotion, PressingShowsOnePoseInTheAirAndUnderLoadsOfAnySizeAndPlace) {
  const Subject subject = DrawSubject(87);
  const FootMotion motion = MakeMotion(
      subject, {.motion = "press", .frames = 24, .rate_hz = 5, .seed = 4, .mean_load = 0.8});
  std::vector<const MotionFrame*> frames;
  for (const MotionFrame& frame : motion.frames) frames.push_back(&frame);
  std::ranges::sort(frames, {}, [](const MotionFrame* f) { return f->foot.total_load_n; });
  EXPECT_EQ(frames.front()->foot.total_load_n, 0);
  EXPECT_NEAR(frames.back()->foot.total_load_n, 0.8 * subject.weight_kg * 9.81,
              0.2 * subject.weight_kg * 9.81);
  int touching = 0;
  double hindmost = 1, foremost = -1, light_area = 0, heavy_area = 0;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const LoadedFoot& foot = frames[f]->foot;
    double lowest = 1;
    for (const Eigen::Vector3d& v : foot.foot.vertices_m) lowest = std::min(lowest, v.z());
    if (foot.total_load_n == 0) {
      EXPECT_GT(lowest, 1e-4);
      EXPECT_LT(lowest, 0.009);
    } else {
      ++touching;
      EXPECT_TRUE(foot.balanced) << frames[f]->time_s;
      hindmost = std::min(hindmost, foot.pressure_centre_m.y());
      foremost = std::max(foremost, foot.pressure_centre_m.y());
      (2 * f < frames.size() ? light_area : heavy_area) += foot.contact_area_m2;
    }
    for (const auto& [name, angle] : frames[f]->angles_rad)
      EXPECT_NEAR(angle, frames[0]->angles_rad.at(name), 0.03) << name;
    // The held foot tilts only as far as its soft sole lets it.
    EXPECT_LT(foot.foot.world_from_rest[3].rotation.angularDistance(
                  frames[0]->foot.foot.world_from_rest[3].rotation), 0.1);
  }
  EXPECT_GT(touching, 12);
  EXPECT_LT(touching, 22);
  EXPECT_GT(foremost - hindmost, 0.04);
  EXPECT_GT(heavy_area, light_area);
}

TEST(MakeMotion, OffsetAndHeadingPlaceTheFoot) {
  const Subject subject = MeanSubject();
  const MotionOptions middle{.motion = "stand", .frames = 1, .seed = 4};
  MotionOptions aside = middle;
  aside.offset_m = {0.2, -0.05};
  aside.heading_rad = 1;
  const LoadedFoot here = MakeMotion(subject, middle).frames[0].foot, there = MakeMotion(subject, aside).frames[0].foot;
  EXPECT_TRUE(there.balanced);
  const Rigid3 way = there.foot.world_from_rest[5] * here.foot.world_from_rest[5].Inverse();
  EXPECT_NEAR(Eigen::AngleAxisd(way.rotation).angle(), 1, 1e-3);
  int beyond = 0;
  for (std::size_t v = 0; v < there.contact.size(); ++v) {
    const Eigen::Vector3d& p = there.foot.vertices_m[v];
    beyond += p.x() > 0.2;
    EXPECT_LT(((p - Eigen::Vector3d(0.2, -0.05, p.z())).norm()), 0.17);
  }
  EXPECT_GT(beyond, 5000);
  EXPECT_NEAR(there.contact_area_m2, here.contact_area_m2, 0.02 * here.contact_area_m2);
  EXPECT_THROW(MakeMotion(subject, {.motion = "stand", .heading_rad = NAN}), Error);
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

int ContactsIn(const LoadedFoot& foot, double from_m, double to_m) {
  int count = 0;
  for (std::size_t v = 0; v < foot.contact.size(); ++v) {
    const double y = ReferenceFoot().vertices[v].y();
    if (foot.contact[v] != 0 && y >= from_m && y < to_m) ++count;
  }
  return count;
}

/// Nothing below the plate, a sound surface and joints within their ranges.
void ExpectValid(const Subject& subject, const FootMotion& motion, const MotionFrame& frame) {
  const std::vector<Eigen::Vector3d>& vertices = frame.foot.foot.vertices_m;
  const auto at = [&](int v) { return vertices[static_cast<std::size_t>(v)]; };
  for (const Eigen::Vector3d& v : vertices) {
    ASSERT_TRUE(v.allFinite());
    ASSERT_GE(v.z(), 0);
  }
  const std::vector<Eigen::Vector3d> normals = VertexNormals({vertices, motion.triangles});
  double area = 0, folded = 0, volume = 0, rest_volume = 0;
  const std::vector<Eigen::Vector3d> rest = SubjectRestMesh(subject).vertices;
  for (const Eigen::Vector3i& t : motion.triangles) {
    const auto a = static_cast<std::size_t>(t[0]), b = static_cast<std::size_t>(t[1]), c = static_cast<std::size_t>(t[2]);
    const Eigen::Vector3d cross = (at(t[1]) - at(t[0])).cross(at(t[2]) - at(t[0]));
    area += cross.norm();
    if (cross.dot(normals[a] + normals[b] + normals[c]) < 0) folded += cross.norm();
    volume += at(t[0]).dot(at(t[1]).cross(at(t[2])));
    rest_volume += rest[a].dot(rest[b].cross(rest[c]));
  }
  EXPECT_LT(folded, 0.001 * area);
  EXPECT_NEAR(volume / rest_volume, 1, 0.05);
  for (const JointAxis& joint : JointAxes(subject)) {
    const auto angle = frame.angles_rad.find(joint.name);
    if (angle == frame.angles_rad.end()) continue;
    EXPECT_GE(angle->second, joint.min_rad) << joint.name;
    EXPECT_LE(angle->second, joint.max_rad) << joint.name;
  }
}

double LowestOf(const MotionFrame& frame) {
  double lowest = 1;
  for (const Eigen::Vector3d& v : frame.foot.foot.vertices_m) lowest = std::min(lowest, v.z());
  return lowest;
}

TEST(MakeMotion, WalkingStrikesStandsRaisesTheHeelAndLeavesInThatOrder) {
  const Subject subject = MeanSubject();
  const FootMotion motion = MakeMotion(subject, {.motion = "walk", .frames = 14, .rate_hz = 15, .seed = 5});
  std::string phases;
  double strike_centre = 0, push_centre = 0, push_off = 0;
  for (const MotionFrame& frame : motion.frames) {
    SCOPED_TRACE(frame.time_s);
    ExpectValid(subject, motion, frame);
    const int heel = ContactsIn(frame.foot, -1, 0.09), fore = ContactsIn(frame.foot, 0.14, 1);
    const char phase = heel == 0 && fore == 0 ? 'a' : fore == 0 ? 's' : heel > 0 ? 'f' : 'h';
    if (phases.empty() || phases.back() != phase) phases += phase;
    if (phase == 's') strike_centre = frame.foot.pressure_centre_m.y();
    if (phase == 'h') push_centre = frame.foot.pressure_centre_m.y();
    if (phase == 'h') push_off = std::max(push_off, frame.angles_rad.at("mtp_1.dorsiflexion"));
    if (phase == 'a') {
      EXPECT_GT(LowestOf(frame), 1.5e-4);
    }
  }
  EXPECT_EQ(phases, "asfha");
  EXPECT_GT(push_centre, strike_centre + 0.12);
  EXPECT_GT(push_off, 40 * M_PI / 180);
  EXPECT_LT(push_off, 60 * M_PI / 180);
}

TEST(MakeMotion, RunningTouchesBrieflyAndHarderThanWalking) {
  const Subject subject = MeanSubject();
  const FootMotion motion = MakeMotion(subject, {.motion = "run", .frames = 7, .rate_hz = 20, .seed = 5});
  double largest = 0;
  int touching = 0;
  for (const MotionFrame& frame : motion.frames) {
    ExpectValid(subject, motion, frame);
    largest = std::max(largest, frame.foot.total_load_n);
    if (frame.foot.total_load_n > 0) ++touching;
  }
  EXPECT_GT(largest, 1.9 * 9.81 * subject.weight_kg);
  EXPECT_GE(touching, 4);
  EXPECT_LE(touching, 5);
}

TEST(MakeMotion, LandingStartsOnTheForefootAndEndsStanding) {
  const Subject subject = MeanSubject();
  const FootMotion motion = MakeMotion(subject, {.motion = "jump", .frames = 15, .rate_hz = 50, .seed = 5});
  EXPECT_GT(LowestOf(motion.frames.front()), 0.05);
  const auto first = std::find_if(motion.frames.begin(), motion.frames.end(),
                                  [](const MotionFrame& frame) { return frame.foot.total_load_n > 0; });
  ASSERT_NE(first, motion.frames.end());
  EXPECT_EQ(ContactsIn(first->foot, -1, 0.09), 0);
  EXPECT_GT(ContactsIn(first->foot, 0.14, 1), 100);
  EXPECT_GT(ContactsIn(motion.frames.back().foot, -1, 0.09), 300);
  for (auto frame = first; frame != motion.frames.end(); frame += 2) {
    ExpectValid(subject, motion, *frame);
    if (motion.frames.end() - frame < 2) break;
  }
}

TEST(MakeMotion, ToesMovesTheToesOnly) {
  const Subject subject = MeanSubject(Side::kLeft);
  const FootMotion motion = MakeMotion(subject, {.motion = "toes", .frames = 4, .rate_hz = 1.6, .seed = 5});
  const auto& rest = motion.frames[0].foot.foot.vertices_m;
  for (const MotionFrame& frame : motion.frames) {
    ExpectValid(subject, motion, frame);
    double toes = 0, others = 0;
    for (std::size_t v = 0; v < rest.size(); ++v) {
      const double moved = (frame.foot.foot.vertices_m[v] - rest[v]).norm();
      const double y = ReferenceFoot().vertices[v].y();
      (y > 0.215 ? toes : others) = std::max(y > 0.215 ? toes : others, y > 0.215 || y < 0.14 ? moved : 0);
    }
    EXPECT_LT(others, 1e-6);
    if (&frame != &motion.frames[0]) {
      EXPECT_GT(toes, 5e-4);
    }
    EXPECT_GT(LowestOf(frame), 0.01);
  }
}

}  // namespace
}  // namespace sole::sim
