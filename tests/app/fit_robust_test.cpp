// What the fit says to clouds that are no whole foot.
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/fit_sequences.h"
#include "app/truth.h"
#include "model/curation.h"
#include "model/mirror.h"
#include "model/model_file.h"
#include "tests/app/shipped_models.h"
#include "tests/support/feet.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

using testing::HasSubstr;
using testing::StartsWith;
using testing_support::Append;
using testing_support::CloudOf;
using testing_support::MakeStandingFoot;
using testing_support::StandingFoot;

std::vector<FootFit> FitOne(const std::vector<PointCloud>& clouds, std::vector<std::string>* log = nullptr) {
  TakeClouds take{clouds, {}};
  for (std::size_t f = 0; f < clouds.size(); ++f) take.triggers.push_back(static_cast<std::int64_t>(f) + 1);
  return FitTakes(std::span(&take, 1), Models(), {}, [&](const std::string& line) { if (log) log->push_back(line); })[0];
}

/// What curation sees, in the test's output.
void Show(const char* what, const FootFit& foot) {
  const FrameFit& f = foot.fit.frames[0];
  const model::FootModel& model = f.side == Side::kRight ? Models().right : Models().left;
  const model::RegistrationQuality q = model::AssessRegistration(model, foot.fit.beta, f, foot.clouds[0], nullptr);
  std::printf("  %s: %.2f mm from the scan, %.0f %% explained, %.0f %% covered, %.1f %% intersecting, stretch %.2f, departure %.2f mm: %s\n", what,
              1e3 * q.residual_m, 100 * q.explained, 100 * q.coverage, 100 * q.intersecting, q.stretch, 1e3 * q.departure_m, f.verdict.c_str());
}

/// A box on the plate, its faces seen from outside.
PointCloud Box(const Eigen::Vector3d& size, const Eigen::Vector3d& place) {
  TriangleMesh box;
  for (int i = 0; i < 8; ++i)
    box.vertices.emplace_back(place + size.cwiseProduct(Eigen::Vector3d(i & 1, i >> 1 & 1, i >> 2)));
  box.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4}, {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  PointCloud cloud = testing_support::SampleMesh(box, 9000, 5e-5, 3);
  // Normals of the faces, not of rounded corners.
  for (std::size_t i = 0; i < cloud.Size(); ++i) {
    const Eigen::Vector3d p = (cloud.points_m[i].cast<double>() - place).cwiseQuotient(size) * 2 - Eigen::Vector3d::Ones();
    int axis = 0;
    p.cwiseAbs().maxCoeff(&axis);
    cloud.normals[i] = Eigen::Vector3f::Unit(axis) * (p[axis] > 0 ? 1.F : -1.F);
  }
  return cloud;
}

/// A shoe: wide, thick at its front, no toes, an opening of 90 mm.
PointCloud Shoe() {
  TriangleMesh shoe = testing_support::Ellipsoid({0.055, 0.15, 0.06}, 24, 32);
  for (Eigen::Vector3d& v : shoe.vertices) {
    const double along = (v.y() + 0.15) / 0.3;  // heel to toes
    v.z() = std::max(v.z() + 0.05, 0.0) * (along < 0.45 ? 1.1 : 1.25 - 0.55 * along);
    v.x() *= 0.85 + 0.2 * along;
  }
  return testing_support::SampleMesh(shoe, 9000, 5e-5, 5);
}

TEST(FitTakes, EmptyCloudsAndNumbersThatAreNone) {
  PointCloud nan;
  nan.points_m.assign(5000, Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN()));
  nan.normals.assign(5000, Eigen::Vector3f::UnitZ());
  for (const PointCloud& cloud : {PointCloud{}, nan}) {
    const std::vector<FootFit> feet = FitOne({cloud, cloud});
    ASSERT_EQ(feet.size(), 1U);
    ASSERT_EQ(feet[0].fit.frames.size(), 2U);
    for (const FrameFit& frame : feet[0].fit.frames) {
      EXPECT_FALSE(frame.found);
      EXPECT_EQ(frame.verdict, "no foot: 0 scan points");
    }
  }
  EXPECT_EQ(FitOne({})[0].fit.frames.size(), 0U);
}

TEST(FitTakes, AFootAmongPointsThatAreNoneIsFittedAsWithoutThem) {
  const StandingFoot foot = MakeStandingFoot(44, Side::kLeft, {0, 0}, 0.3);
  PointCloud cloud = CloudOf(foot, 9000, 1);
  const FrameFit clean = FitOne({cloud})[0].fit.frames[0];
  for (int i = 0; i < 3000; ++i) {
    cloud.points_m.emplace_back(std::nanf(""), 0, 0);
    cloud.normals.emplace_back(0, 0, 1);
    cloud.sigma_m.push_back(1e-4F);
  }
  const FrameFit frame = FitOne({cloud})[0].fit.frames[0];
  EXPECT_EQ(frame.verdict, "good");
  EXPECT_EQ(frame.registration_m, clean.registration_m);
}

TEST(FitTakes, AShoeAndABoxAreNoGoodFoot) {
  const PointCloud things[] = {Shoe(), Box({0.085, 0.19, 0.03}, {0, 0, 0}), Box({0.1, 0.26, 0.09}, {0, 0, 0})};
  for (const PointCloud& thing : things) {
    const std::vector<FootFit> feet = FitOne({thing});
    ASSERT_EQ(feet.size(), 1U);
    EXPECT_NE(feet[0].fit.frames[0].verdict, "good");
    Show("thing", feet[0]);
  }
}

TEST(FitTakes, ABoxBesideAFootIsSaidToBeNone) {
  const StandingFoot foot = MakeStandingFoot(44, Side::kRight, {0, 0}, 0);
  PointCloud cloud = CloudOf(foot, 8000, 2);
  Append(Box({0.085, 0.19, 0.03}, {0.13, 0, 0}), cloud);
  std::vector<std::string> log;
  const std::vector<FootFit> feet = FitOne({cloud}, &log);
  for (const FootFit& f : feet) Show("foot or box", f);
  ASSERT_EQ(feet.size(), 1U);
  EXPECT_EQ(feet[0].fit.frames[0].verdict, "good");
  EXPECT_EQ(feet[0].fit.frames[0].side, Side::kRight);
  ASSERT_EQ(log.size(), 1U);
  EXPECT_THAT(log[0], HasSubstr("9000 scan points a frame is taken for no foot"));
}

TEST(FitTakes, ARuinedFrameIsSaidToBeNoneAndHurtsNoOther) {
  const StandingFoot foot = MakeStandingFoot(47, Side::kRight, {0, 0}, 0.2);
  std::vector<PointCloud> clouds;
  for (unsigned f = 0; f < 5; ++f) clouds.push_back(CloudOf(foot, 6000, f + 1));
  PointCloud& ruined = clouds[2];  // as of cameras that were pushed: half of the points elsewhere, and turned
  const Eigen::Matrix3f turn = Eigen::AngleAxisf(1.2F, Eigen::Vector3f(1, 1, 0).normalized()).toRotationMatrix();
  for (std::size_t i = 0; i < ruined.Size(); i += 2) {
    ruined.points_m[i] = turn * ruined.points_m[i] + Eigen::Vector3f(0.03F, -0.02F, 0.02F);
    ruined.normals[i] = turn * ruined.normals[i];
  }
  const FootFit fitted = FitOne(clouds)[0];
  const std::vector<Eigen::Vector3d> places = MaterialPositions(Models().right, foot.mesh, foot.side);
  ASSERT_EQ(fitted.fit.frames.size(), 5U);
  for (std::size_t f = 0; f < 5; ++f) {
    const FrameFit& frame = fitted.fit.frames[f];
    if (f == 2) {
      EXPECT_NE(frame.verdict, "good");
      continue;
    }
    EXPECT_EQ(frame.verdict, "good") << f;
    double sum = 0;
    for (std::size_t v = 0; v < places.size(); ++v)
      sum += (frame.registration_m.row(static_cast<Eigen::Index>(v)).transpose() - places[v]).norm();
    EXPECT_LT(1e3 * sum / static_cast<double>(places.size()), 1.5) << f;
  }
}

TEST(LoadModelPair, AModelOfTheOtherSideGivesTheSamePair) {
  const testing_support::TempDir dir;
  model::SaveModel(dir / "left.npz", Models().left);
  const ModelPair pair = LoadModelPair(dir / "left.npz");
  EXPECT_EQ(pair.right.side, Side::kRight);
  EXPECT_TRUE(pair.right.fine.template_m.isApprox(Models().right.fine.template_m, 1e-6));
  EXPECT_EQ(pair.left.coarse.triangles, Models().left.coarse.triangles);
}

/// Where the scan shows nothing, what is stated must cover what is wrong.
TEST(FitTakes, AFootWithAThirdMissingSaysWhereItIsUnsure) {
  double front = 0, worst_ratio = 0;
  for (const std::uint64_t person : {45U, 46U}) {
    for (const int missing : {0, 1}) {  // the toes' third, the heel's third
      const StandingFoot foot = MakeStandingFoot(person, Side::kRight, {0, 0}, 0);
      const PointCloud whole = CloudOf(foot, 12000, 7);
      Eigen::AlignedBox3d box;
      for (const Eigen::Vector3d& v : foot.mesh.vertices) box.extend(v);
      front = missing == 0 ? box.max().y() - box.sizes().y() / 3 : box.min().y() + box.sizes().y() / 3;
      const auto unseen = [&](double y) { return missing == 0 ? y > front : y < front; };
      PointCloud part;
      for (std::size_t i = 0; i < whole.Size(); ++i) {
        if (unseen(whole.points_m[i].y())) continue;
        part.points_m.push_back(whole.points_m[i]);
        part.normals.push_back(whole.normals[i]);
        part.sigma_m.push_back(whole.sigma_m[i]);
      }
      const FrameFit frame = FitOne({part})[0].fit.frames[0];
      ASSERT_TRUE(frame.found);
      EXPECT_EQ(frame.side, Side::kRight);
      const std::vector<Eigen::Vector3d> places = MaterialPositions(Models().right, foot.mesh, foot.side);
      double error2[2] = {0, 0}, variance[2] = {0, 0}, stated[2] = {0, 0};
      int count[2] = {0, 0};
      for (std::size_t v = 0; v < places.size(); ++v) {
        const auto row = static_cast<Eigen::Index>(v);
        const std::size_t k = unseen(places[v].y()) ? 1 : 0;
        error2[k] += (frame.vertices_m.row(row).transpose() - places[v]).squaredNorm() / 3;
        variance[k] += frame.vertex_sd_m[row] * frame.vertex_sd_m[row];
        stated[k] += frame.registration_sd_m[row];
        ++count[k];
      }
      for (int k : {0, 1}) error2[k] /= count[k], variance[k] /= count[k], stated[k] /= count[k];
      std::printf("  person %d, %s missing, %s: model seen %.2f mm (stated %.2f), unseen %.2f mm (stated %.2f); registration states %.2f and %.2f mm\n",
                  static_cast<int>(person), missing == 0 ? "toes" : "heel", frame.verdict.c_str(), 1e3 * std::sqrt(error2[0]), 1e3 * std::sqrt(variance[0]),
                  1e3 * std::sqrt(error2[1]), 1e3 * std::sqrt(variance[1]), 1e3 * stated[0], 1e3 * stated[1]);
      EXPECT_GT(variance[1], 4 * variance[0]);
      EXPECT_GT(stated[1], 10 * stated[0]);
      worst_ratio = std::max(worst_ratio, std::sqrt(error2[1] / variance[1]));
    }
  }
  EXPECT_LT(worst_ratio, 2);
}

}  // namespace
}  // namespace sole::app
