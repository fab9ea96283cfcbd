// Full-size scans of simulated people, as other scanners give them, against their true surfaces.
#include "app/fit_scan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/fit_scan_input.h"
#include "contact/flat_patches.h"
#include "io/atomic_file.h"
#include "io/mesh_file.h"
#include "io/take.h"
#include "model/forward.h"
#include "tests/app/shipped_models.h"
#include "tests/support/error_matcher.h"
#include "tests/support/foreign_scan.h"
#include "tests/support/meshes.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

using testing::HasSubstr;
using testing_support::DistanceAboveSole;
using testing_support::ErrorOf;
using testing_support::ForeignScan;
using testing_support::MakeForeignScan;
using testing_support::SurfaceDistance;
using testing_support::TempDir;

const model::FootModel& ModelOf(const FrameFit& frame) {
  return frame.side == Side::kRight ? Models().right : Models().left;
}

TEST(FitScan, FilledSoleInAnyPositionFromAnStlFile) {
  const TempDir dir;
  const ForeignScan scan = MakeForeignScan(311, "filled");
  TriangleMesh metres = scan.file.mesh;
  for (Eigen::Vector3d& v : metres.vertices) v /= 1000;
  io::WriteStl(dir / "foot.stl", metres);  // in millimetres
  const nlohmann::json account = RunFitScan(dir / "foot.stl", Models(), {}, dir / "out");
  EXPECT_EQ(account["side"], scan.side == Side::kLeft ? "left" : "right");
  EXPECT_EQ(account["units"], "mm");
  EXPECT_EQ(account["floor"], true);
  EXPECT_GT(account["flat_points_left_out"], 1000);
  const FitSequence fit = io::ReadFit(dir / "out" / "foot-fit.npz");
  ASSERT_EQ(fit.frames.size(), 1U);
  const FrameFit& frame = fit.frames[0];
  const TriangleMesh registered = model::MeshOf(ModelOf(frame), model::Variant::kFine, frame.registration_fine_m);
  EXPECT_LT(DistanceAboveSole(scan, registered).mean_mm, 1.0);
  // Pose and translation are those of the scan's frame, too.
  const model::ModelParameters parameters{frame.theta, fit.beta, frame.translation_m, {}};
  EXPECT_LT((model::Forward(ModelOf(frame), parameters).vertices_m - frame.vertices_m).cwiseAbs().maxCoeff(), 1e-7);
  // The mesh lies on the scan as it was given.
  const TriangleMesh mesh = io::ReadPlyMesh(dir / "out" / "foot-fit.ply");
  ASSERT_EQ(mesh.vertices.size(), registered.vertices.size());
  EXPECT_LT((mesh.vertices[0] / 1000 - registered.vertices[0]).norm(), 1e-5);
  EXPECT_TRUE(std::filesystem::exists(dir / "out" / "foot-fit.glb"));
  // Within a few millimetres of the survey's measure of this person.
  const double length = sim::DrawSubject(311).measures_mm.at("footlength");
  EXPECT_NEAR(account["measures"]["length_mm"].get<double>(), length, 5);
}

TEST(FitScan, StandsOnAFloorThatTheScannerSawAndHasALongLeg) {
  ForeignScan scan = MakeForeignScan(313, "stand");
  // Without the turn: what is added is easier to place.
  scan.scan_from_truth = {Eigen::Quaterniond::Identity(), {0.3, -0.2, 0.1}};
  TriangleMesh mesh = scan.truth;
  double top = 0;
  for (const Eigen::Vector3d& v : mesh.vertices) top = std::max(top, v.z());
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  double count = 0, radius = 0;
  for (const Eigen::Vector3d& v : scan.truth.vertices) {
    if (v.z() > top - 0.005) middle += v, ++count;
  }
  middle /= count;
  for (const Eigen::Vector3d& v : scan.truth.vertices) {
    if (v.z() > top - 0.005) radius = std::max(radius, (v - middle).head<2>().norm());
  }
  const auto add_grid = [&](int rows, int columns, const auto& place, bool round) {
    const int first = static_cast<int>(mesh.vertices.size());
    for (int i = 0; i < rows; ++i) {
      for (int j = 0; j < columns; ++j) mesh.vertices.push_back(place(i, j));
    }
    for (int i = 0; i + 1 < rows; ++i) {
      for (int j = 0; j < (round ? columns : columns - 1); ++j) {
        const int a = first + i * columns + j, b = first + i * columns + (j + 1) % columns;
        mesh.triangles.emplace_back(a, b, b + columns);
        mesh.triangles.emplace_back(a, b + columns, a + columns);
      }
    }
  };
  // A leg of another 250 mm that leans forward and grows wider, and half a metre of floor, which hides the sole.
  add_grid(26, 40, [&](int i, int j) {
    const double angle = 2 * M_PI * j / 40, r = radius * (1 + 0.02 * i);
    return Eigen::Vector3d(middle + Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle) + 0.002 * i, 0.01 * i));
  }, true);
  add_grid(26, 26, [&](int i, int j) {
    return Eigen::Vector3d(middle.x() + 0.02 * (j - 13), middle.y() + 0.02 * (i - 13) + 0.05, 0.0002);
  }, false);
  for (Eigen::Vector3d& v : mesh.vertices) v = 1000 * (scan.scan_from_truth * v);
  const ScanFit fit = FitScan({mesh, {}}, "floor.ply", Models(), {.unit_m = 0.001, .floor = true});
  EXPECT_TRUE(fit.floor);
  const FrameFit& frame = fit.fit.frames[0];
  EXPECT_EQ(frame.side, scan.side);
  EXPECT_EQ(frame.verdict, "good");
  const TriangleMesh registered = model::MeshOf(ModelOf(frame), model::Variant::kFine, frame.registration_fine_m);
  const SurfaceDistance distance = DistanceAboveSole(scan, registered);
  std::printf("  %.2f mm, worst %.2f mm: %s\n", distance.mean_mm, distance.worst_mm, frame.verdict.c_str());
  EXPECT_LT(distance.mean_mm, 1.0);
  // The floor is level and 0.2 mm above the foot's lowest point.
  EXPECT_NEAR((fit.level_from_scan * (scan.scan_from_truth * Eigen::Vector3d(0, 0, 0.0002))).z(), 0, 2e-4);
}

TEST(FitScan, HangingFootAsPointsInMetresWithTheAxisUpGiven) {
  ForeignScan scan = MakeForeignScan(312, "rest");
  // y up, as many programs have it.
  scan.scan_from_truth = {Eigen::Quaterniond(Eigen::AngleAxisd(-M_PI / 2, Eigen::Vector3d::UnitX())), {0, 0.4, 0}};
  io::ScanFile points;
  for (const Eigen::Vector3d& v : scan.truth.vertices) points.mesh.vertices.push_back(scan.scan_from_truth * v);
  points.mesh.vertices[5].x() = std::nan("");
  const ScanFit fit = FitScan(points, "points.ply", Models(), {.up = Eigen::Vector3d::UnitY()});
  EXPECT_EQ(fit.unit_m, 1);
  EXPECT_FALSE(fit.floor);
  const FrameFit& frame = fit.fit.frames[0];
  EXPECT_EQ(frame.side, scan.side);
  const TriangleMesh registered = model::MeshOf(ModelOf(frame), model::Variant::kFine, frame.registration_fine_m);
  EXPECT_LT(DistanceAboveSole(scan, registered).mean_mm, 1.0);
}

TEST(FitScan, SaysWhatIsNoFoot) {
  const auto fitting = [](const TriangleMesh& mesh, const ScanFitOptions& options = {}) {
    return ErrorOf([&] { FitScan({mesh, {}}, "thing.stl", Models(), options); });
  };
  const TriangleMesh ball = testing_support::Ellipsoid({0.08, 0.1, 0.08}, 20, 30);
  TriangleMesh tiny = ball;
  for (Eigen::Vector3d& v : tiny.vertices) v *= 20;
  EXPECT_THAT(fitting(tiny), HasSubstr("thing.stl: is 3.9"));
  EXPECT_THAT(fitting(tiny), HasSubstr("give --units mm or --units m"));
  EXPECT_THAT(fitting(tiny, {.unit_m = 1}), HasSubstr("check --units"));
  EXPECT_THAT(fitting({{{0, 0, 0}, {1, 0, 0}}, {}}), HasSubstr("has 2 usable points"));
  EXPECT_THAT(fitting(ball, {.floor = true}), HasSubstr("no floor is found"));
  EXPECT_THAT(fitting({std::vector<Eigen::Vector3d>(5000, Eigen::Vector3d::Constant(std::nan(""))), {}}),
              HasSubstr("5000 of them not numbers"));
}

TEST(PointsOfScan, TurnsASurfaceThatFacesInwards) {
  TriangleMesh ball = testing_support::Ellipsoid({60, 100, 60}, 20, 30);
  for (Eigen::Vector3i& t : ball.triangles) std::swap(t[1], t[2]);
  for (Eigen::Vector3d& v : ball.vertices) v.x() += 500;
  const ScanPoints points = PointsOfScan({ball, {}}, "ball", {});
  EXPECT_EQ(points.unit_m, 0.001);
  EXPECT_NEAR(points.middle_m.x(), 0.5, 0.002);
  ASSERT_EQ(points.cloud.Size(), 30000U);
  for (std::size_t i = 0; i < points.cloud.Size(); i += 100)
    EXPECT_GT(points.cloud.normals[i].dot(points.cloud.points_m[i].normalized()), 0.5);
}

TEST(FindFlatPatches, FindsACutAndHowMuchOfItsOutlineIsFilled) {
  // Half a ball of 80 mm on its cut, of which a quarter of the outline is missing.
  PointCloud scan;
  const TriangleMesh ball = testing_support::Ellipsoid({0.08, 0.08, 0.08}, 30, 40);
  const PointCloud points = testing_support::SampleMesh(ball, 20000, 1e-5, 4);
  for (std::size_t i = 0; i < points.Size(); ++i) {
    if (points.points_m[i].z() < 0) continue;
    scan.points_m.push_back(points.points_m[i]);
    scan.normals.push_back(points.normals[i]);
  }
  const std::size_t dome = scan.Size();
  std::mt19937_64 random(2);
  std::uniform_real_distribution<float> unit(-0.08F, 0.08F);
  for (int i = 0; i < 10000; ++i) {
    const Eigen::Vector3f p(unit(random), unit(random), 0);
    if (p.norm() > 0.079F || (p.x() > 0.02F && p.y() > 0.02F)) continue;
    scan.points_m.push_back(p);
    scan.normals.push_back(-Eigen::Vector3f::UnitZ());
  }
  const std::vector<contact::FlatPatch> patches = contact::FindFlatPatches(scan);
  ASSERT_EQ(patches.size(), 1U);
  EXPECT_GT(patches[0].normal.z(), 0.9999);
  EXPECT_GT(patches[0].points.size(), (scan.Size() - dome) * 99 / 100);
  EXPECT_NEAR(patches[0].area_m2, M_PI * 0.08 * 0.08 - 0.0028, 0.0015);
  EXPECT_LT(patches[0].filled, 0.95);
  EXPECT_GT(patches[0].filled, 0.7);
}

}  // namespace
}  // namespace sole::app
