// The way to COLMAP and back without the program: its model is made from the truth.

#include "calib/agreement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "calib/calibrate.h"
#include "calib/colmap_calibration.h"
#include "tests/calib/synthetic_rig.h"
#include "tests/support/error_matcher.h"

namespace sole::calib {
namespace {

using sole::testing_support::ErrorOf;
using testing::HasSubstr;
using testing_support::MakeSyntheticRig;
using testing_support::ObserveSynthetic;
using testing_support::SyntheticRig;

Camera TrueCamera(const SyntheticRig& truth, std::size_t c) {
  const CameraConfig& nominal = truth.config.cameras[c];
  Camera camera{nominal.serial, nominal.width, nominal.height, Intrinsics::Zero(), truth.cam_from_world[c]};
  camera.intrinsics.head<8>() = truth.lens[c];
  return camera;
}

Rig TrueRig(const SyntheticRig& truth) {
  Rig rig;
  rig.plate = {truth.thickness_m, truth.index};
  for (std::size_t c = 0; c < truth.config.cameras.size(); ++c) rig.cameras.push_back(TrueCamera(truth, c));
  return rig;
}

int FrameOfImage(const io::ColmapImage& image) { return std::stoi(image.name.substr(image.name.find('/') + 1)) - 1; }

/// The problem solved without error, in COLMAP's manner: any frame, any scale, points in any order and
/// one of them twice, an image missing.
io::ColmapModel TrueSolution(const SyntheticRig& truth, const io::ColmapModel& problem) {
  constexpr double kScale = 7.5;  // of COLMAP's length to a metre
  const Rigid3 solved_from_body{Eigen::Quaterniond(0.5, -0.1, 0.7, 0.3).normalized(), {3, -1, 2}};  // after scaling
  io::ColmapModel solved;
  std::map<std::string, std::size_t> index;
  for (std::size_t c = 0; c < truth.config.cameras.size(); ++c) index[truth.config.cameras[c].serial] = c;
  for (const Camera& camera : problem.cameras) {
    solved.cameras.push_back(TrueCamera(truth, index[camera.serial]));
    solved.cameras.back().cam_from_world = {};
  }
  int fiducial_frame = 0;
  const int corners = static_cast<int>(problem.points.size() - 4 * truth.config.plate.fiducials.size());
  for (const io::ColmapImage& image : problem.images) {
    if (image.pixels.back().point >= corners) fiducial_frame = FrameOfImage(image);
  }
  std::vector<int> order(problem.points.size()), place(problem.points.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
  std::mt19937_64 random(5);
  std::shuffle(order.begin(), order.end(), random);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const auto p = static_cast<std::size_t>(order[i]);
    place[p] = static_cast<int>(i);
    Eigen::Vector3d in_body = problem.points[p].point_m;
    if (order[i] >= corners)  // a fiducial, given in the world
      in_body = truth.world_from_body[static_cast<std::size_t>(fiducial_frame)].Inverse() * in_body;
    solved.points.push_back({solved_from_body * (kScale * in_body)});
  }
  solved.points.push_back({{100, 100, 100}});  // what the first image takes for its first corner
  for (std::size_t i = 0; i < problem.images.size(); ++i) {
    if (i == 3) continue;
    const io::ColmapImage& given = problem.images[i];
    const std::size_t c = index[problem.cameras[static_cast<std::size_t>(given.camera)].serial];
    Rigid3 cam_from_body = truth.cam_from_world[c] * truth.world_from_body[static_cast<std::size_t>(FrameOfImage(given))];
    cam_from_body.translation *= kScale;
    io::ColmapImage image = given;
    image.cam_from_world = cam_from_body * solved_from_body.Inverse();
    for (io::ColmapPixel& seen : image.pixels) seen.point = place[static_cast<std::size_t>(seen.point)];
    if (i == 0) image.pixels[0].point = static_cast<int>(solved.points.size()) - 1;
    solved.images.push_back(image);
  }
  return solved;
}

TEST(MakeColmapProblem, GivesCamerasInAirNominalLensesAndPixels) {
  const SyntheticRig truth = MakeSyntheticRig(8, 10, 1);
  const TakeObservations take = ObserveSynthetic(truth, 0, 1);
  const io::ColmapModel problem = MakeColmapProblem(truth.config, take, {.max_frames = 4});
  ASSERT_EQ(problem.cameras.size(), 6U);
  EXPECT_EQ(problem.cameras[0].serial, "SIM0003");
  EXPECT_EQ(problem.cameras[0].intrinsics[0], 3250);
  EXPECT_TRUE(problem.cameras[0].intrinsics.tail<5>().isZero(0));
  std::set<std::string> poses, fiducial_poses;
  for (const io::ColmapImage& image : problem.images) {
    poses.insert(image.name.substr(10));
    EXPECT_TRUE(image.cam_from_world.translation.isZero(0));
    EXPECT_EQ(image.name.substr(0, 10), ColmapImagePrefix(static_cast<std::size_t>(image.camera)));
    const auto& target = take.frames[static_cast<std::size_t>(FrameOfImage(image))][static_cast<std::size_t>(image.camera) + 2].target;
    ASSERT_GE(target.size(), 12U);
    EXPECT_EQ(image.pixels[0].pixel, target[0].pixel);
    EXPECT_EQ(image.pixels[0].point, target[0].point);
    EXPECT_EQ(image.pixels.size() > target.size(), image.pixels.back().point >= 80);
    if (image.pixels.size() > target.size()) fiducial_poses.insert(image.name.substr(10));
  }
  EXPECT_EQ(poses.size(), 4U);
  EXPECT_EQ(fiducial_poses.size(), 1U);
  RigConfig one = truth.config;
  for (std::size_t c = 3; c < 8; ++c) one.cameras[c].position_m.z() = -0.5;
  EXPECT_THAT(ErrorOf([&] { MakeColmapProblem(one, take); }), HasSubstr("1 camera(s) above the plate, needs 2"));
  TakeObservations blind = take;
  for (auto& frame : blind.frames) frame[4].target.clear();
  EXPECT_THAT(ErrorOf([&] { MakeColmapProblem(truth.config, blind); }), HasSubstr("camera SIM0005 shows the target together"));
}

TEST(ReadColmapRig, FindsMetresAndWorldAgain) {
  const SyntheticRig truth = MakeSyntheticRig(8, 10, 2);
  const io::ColmapModel problem = MakeColmapProblem(truth.config, ObserveSynthetic(truth, 0, 2));
  io::ColmapModel solved = TrueSolution(truth, problem);
  const ColmapRig rig = ReadColmapRig(problem, solved, truth.config);
  EXPECT_TRUE(rig.in_world);
  EXPECT_EQ(rig.images, rig.images_placed + 1);
  EXPECT_LT(rig.target_rms_mm, 1e-9);
  EXPECT_LT(rig.fiducial_rms_mm, 1e-9);
  ASSERT_EQ(rig.cameras.size(), 6U);
  for (std::size_t c = 0; c < 6; ++c) {
    EXPECT_EQ(rig.cameras[c].serial, truth.config.cameras[c + 2].serial);
    EXPECT_LT((rig.cameras[c].CentreInWorld() - truth.Centre(c + 2)).norm(), 1e-9);
    EXPECT_LT(rig.cameras[c].cam_from_world.rotation.angularDistance(truth.cam_from_world[c + 2].rotation), 1e-7);
    EXPECT_TRUE(c == 0 || rig.camera_rms_px[c] < 1e-6) << rig.camera_rms_px[c];
    EXPECT_GT(rig.camera_points[c], 100);
    for (const Eigen::Vector3d& p : rig.seen_m[c]) EXPECT_TRUE(p.z() > 0 && p.z() < 0.25) << p;
  }
  EXPECT_GT(rig.camera_rms_px[0], 1);  // the point that only the first image sees

  EXPECT_NEAR(OutlierLimitPx(solved).value_or(0), 0.1, 1e-9);  // that point
  std::erase_if(solved.images, [](const io::ColmapImage& image) { return image.camera == 0; });
  EXPECT_FALSE(OutlierLimitPx(solved).has_value());
  solved = TrueSolution(truth, problem);
  io::ColmapModel strange = solved;
  strange.images[0].name = "other.png";
  EXPECT_THAT(ErrorOf([&] { ReadColmapRig(problem, strange, truth.config); }), HasSubstr("other.png that it was not given"));
  strange = solved;
  std::erase_if(strange.images, [](const io::ColmapImage& image) { return image.camera == 4; });
  EXPECT_THAT(ErrorOf([&] { ReadColmapRig(problem, strange, truth.config); }), HasSubstr("could not place camera SIM0007"));
  strange.images.resize(1);
  for (io::ColmapPixel& seen : strange.images[0].pixels) seen.point = -1;
  EXPECT_THAT(ErrorOf([&] { ReadColmapRig(problem, strange, truth.config); }), HasSubstr("found 0 corners"));
}

TEST(CompareWithColmap, NamesTheCameraThatStandsElsewhere) {
  const SyntheticRig truth = MakeSyntheticRig(8, 10, 3);
  const io::ColmapModel problem = MakeColmapProblem(truth.config, ObserveSynthetic(truth, 0, 3));
  ColmapRig colmap = ReadColmapRig(problem, TrueSolution(truth, problem), truth.config);
  const Rigid3 elsewhere{Eigen::Quaterniond(0.9, 0.2, -0.1, 0.3).normalized(), {1, 2, 3}};  // COLMAP's frame
  for (Camera& camera : colmap.cameras) camera.cam_from_world = camera.cam_from_world * elsewhere.Inverse();
  for (auto& points : colmap.seen_m) {
    for (Eigen::Vector3d& p : points) p = elsewhere * p;
  }
  Rig ours = TrueRig(truth);
  const Agreement same = CompareWithColmap(ours, colmap);
  EXPECT_LT(same.centre_rms_mm, 1e-6);
  EXPECT_LT(same.view_rms_px, 1e-6);
  EXPECT_NEAR(same.scale, 1, 1e-9);
  for (const CameraAgreement& c : same.cameras) EXPECT_TRUE(c.agrees);

  // One millimetre aside and 0.1 degrees, a longer lens; told of that camera alone, and nearly to the truth.
  const Eigen::Vector3d aside = ours.cameras[4].cam_from_world.Inverse().rotation * Eigen::Vector3d(0.001, 0, 0);
  const Rigid3 turn{Eigen::Quaterniond(Eigen::AngleAxisd(0.1 * M_PI / 180, Eigen::Vector3d::UnitX())), {0, 0, 0}};
  Rigid3& pose = ours.cameras[4].cam_from_world;
  pose = turn * (pose * Rigid3{Eigen::Quaterniond::Identity(), -aside});
  ours.cameras[4].intrinsics[0] -= 2;
  ours.cameras[4].intrinsics[1] -= 2;
  const Agreement moved = CompareWithColmap(ours, colmap);
  for (const CameraAgreement& c : moved.cameras) {
    const bool it = c.serial == "SIM0005";
    EXPECT_EQ(c.agrees, !it) << c.serial;
    EXPECT_NEAR(c.centre_mm, it ? 1 : 0, 0.01) << c.serial;
    EXPECT_NEAR(c.direction_deg, it ? 0.1 : 0, 0.001) << c.serial;
    EXPECT_NEAR(c.focal_px, it ? 2 : 0, 1e-9) << c.serial;
    EXPECT_TRUE(!it || c.view_px > 4) << c.view_px;
  }
}

TEST(CompareWithColmap, TellsScaleAndTwoCamerasApart) {
  const SyntheticRig truth = MakeSyntheticRig(4, 10, 4);
  const io::ColmapModel problem = MakeColmapProblem(truth.config, ObserveSynthetic(truth, 0, 4));
  const ColmapRig colmap = ReadColmapRig(problem, TrueSolution(truth, problem), truth.config);
  Rig ours = TrueRig(truth);
  EXPECT_LT(CompareWithColmap(ours, colmap).centre_rms_mm, 1e-6);
  for (Camera& camera : ours.cameras) camera.cam_from_world.translation *= 1.01;  // a target thought 1 % too large
  const Agreement agreement = CompareWithColmap(ours, colmap);
  EXPECT_NEAR(agreement.scale, 1.01, 0.0005);
  EXPECT_GT(agreement.centre_rms_mm, 1);
  EXPECT_FALSE(agreement.cameras[0].agrees);
}

TEST(CalibrationFromColmap, JudgesLikeAnyOtherAndRefusesGlass) {
  SyntheticRig truth = MakeSyntheticRig(8, 12, 5);
  const RigConfig with_glass = truth.config;
  EXPECT_THAT(ErrorOf([&] { RequireAllInAir(with_glass); }), HasSubstr("2 of 8 cameras look through the glass"));
  truth.config.cameras.erase(truth.config.cameras.begin(), truth.config.cameras.begin() + 2);
  truth.config.pairs.erase(truth.config.pairs.begin());
  truth.cam_from_world.erase(truth.cam_from_world.begin(), truth.cam_from_world.begin() + 2);
  truth.lens.erase(truth.lens.begin(), truth.lens.begin() + 2);
  const DividedTake take = DivideTake(truth.config, ObserveSynthetic(truth, 0, 5));
  EXPECT_EQ(take.heldout.frames.size(), 2U);
  const io::ColmapModel problem = MakeColmapProblem(truth.config, take.adjust);
  SyntheticRig adjusted = truth;  // frames count anew
  adjusted.world_from_body.erase(adjusted.world_from_body.begin() + 9);
  adjusted.world_from_body.erase(adjusted.world_from_body.begin() + 4);
  ColmapRig colmap = ReadColmapRig(problem, TrueSolution(adjusted, problem), truth.config);
  const Calibration calibration = CalibrationFromColmap(truth.config, colmap, take);
  EXPECT_THAT(calibration.stats.failures, testing::IsEmpty());
  EXPECT_EQ(calibration.stats.poses_heldout, 2);
  EXPECT_LT(calibration.stats.heldout_rms_air_mm, 1e-6);
  EXPECT_TRUE(std::isnan(calibration.stats.heldout_rms_glass_mm));
  EXPECT_LT(calibration.stats.ground_rms_mm, 1e-6);
  EXPECT_EQ(calibration.rig.rig_hash, RigIdentityHash(truth.config));
  EXPECT_EQ(calibration.rig.pairs.size(), 3U);
  colmap.cameras[2].cam_from_world.translation.x() += 0.001;
  EXPECT_THAT(CalibrationFromColmap(truth.config, colmap, take).stats.failures, testing::Not(testing::IsEmpty()));
  colmap.in_world = false;
  EXPECT_THAT(ErrorOf([&] { CalibrationFromColmap(truth.config, colmap, take); }), HasSubstr("fewer than two fiducials"));
}

}  // namespace
}  // namespace sole::calib
