#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "io/npz.h"
#include "io/take.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

FrameFit MakeFit(std::int64_t trigger) {
  FrameFit fit;
  fit.trigger = trigger;
  fit.found = true;
  fit.side = Side::kLeft;
  fit.theta = Eigen::MatrixX3d::Random(4, 3);
  fit.theta_sd = Eigen::MatrixX3d::Random(4, 3);
  fit.translation_m = Eigen::Vector3d::Random();
  fit.vertices_m = Eigen::MatrixX3d::Random(7, 3);
  fit.registration_m = Eigen::MatrixX3d::Random(7, 3);
  fit.registration_fine_m = Eigen::MatrixX3d::Random(11, 3);
  fit.vertex_sd_m = Eigen::VectorXd::Random(7);
  fit.registration_sd_m = Eigen::VectorXd::Random(7);
  fit.residual_m = 1.25e-4;
  fit.verdict = "good";
  return fit;
}

TEST(Fit, RoundTripsAndFillsFramesWithoutAFootWithNan) {
  const TempDir dir;
  FitSequence written;
  written.beta = Eigen::VectorXd::Random(5);
  written.beta_sd = Eigen::VectorXd::Random(5);
  FrameFit none;
  none.trigger = 8;
  none.verdict = "no foot above the plate";
  written.frames = {MakeFit(7), none, MakeFit(12)};
  WriteFit(dir / "fit.npz", written);
  const FitSequence read = ReadFit(dir / "fit.npz");
  EXPECT_EQ(read.beta, written.beta);
  EXPECT_EQ(read.beta_sd, written.beta_sd);
  ASSERT_EQ(read.frames.size(), 3U);
  for (const std::size_t f : {0U, 2U}) {
    const FrameFit &a = written.frames[f], &b = read.frames[f];
    EXPECT_EQ(b.trigger, a.trigger);
    EXPECT_TRUE(b.found);
    EXPECT_EQ(b.side, Side::kLeft);
    EXPECT_EQ(b.theta, a.theta);
    EXPECT_EQ(b.theta_sd, a.theta_sd);
    EXPECT_EQ(b.translation_m, a.translation_m);
    EXPECT_EQ(b.vertices_m, a.vertices_m);
    EXPECT_EQ(b.registration_m, a.registration_m);
    EXPECT_EQ(b.registration_fine_m, a.registration_fine_m);
    EXPECT_EQ(b.vertex_sd_m, a.vertex_sd_m);
    EXPECT_EQ(b.registration_sd_m, a.registration_sd_m);
    EXPECT_EQ(b.residual_m, a.residual_m);
    EXPECT_EQ(b.verdict, "good");
  }
  const FrameFit& empty = read.frames[1];
  EXPECT_FALSE(empty.found);
  EXPECT_EQ(empty.trigger, 8);
  EXPECT_EQ(empty.verdict, none.verdict);
  ASSERT_EQ(empty.vertices_m.rows(), 7);
  EXPECT_TRUE(empty.vertices_m.array().isNaN().all());
  EXPECT_TRUE(empty.translation_m.array().isNaN().all());
  EXPECT_TRUE(std::isnan(empty.residual_m));
}

TEST(Fit, KeepsTheContactThatTheModelWasTold) {
  const TempDir dir;
  FitSequence written;
  written.frames = {MakeFit(1), MakeFit(2)};
  written.frames[1].contact = Eigen::VectorXd::LinSpaced(7, 0, 1);
  WriteFit(dir / "fit.npz", written);
  const FitSequence read = ReadFit(dir / "fit.npz");
  EXPECT_EQ(read.frames[0].contact.size(), 0);
  EXPECT_EQ(read.frames[1].contact, written.frames[1].contact);
}

TEST(Fit, HasTheDocumentedNamesAndShapes) {
  const TempDir dir;
  FitSequence fit;
  fit.beta = fit.beta_sd = Eigen::VectorXd::Random(5);
  fit.frames = {MakeFit(1), MakeFit(2)};
  WriteFit(dir / "fit.npz", fit);
  const Npz npz = ReadNpz(dir / "fit.npz");
  using Shape = std::vector<std::size_t>;
  EXPECT_EQ(ShapeOf(npz, "frames"), (Shape{2}));
  EXPECT_EQ(npz.at("frames").dtype, "<i8");
  EXPECT_EQ(ShapeOf(npz, "theta"), (Shape{2, 4, 3}));
  EXPECT_EQ(ShapeOf(npz, "beta"), (Shape{5}));
  EXPECT_EQ(ShapeOf(npz, "translation_m"), (Shape{2, 3}));
  EXPECT_EQ(ShapeOf(npz, "vertices_m"), (Shape{2, 7, 3}));
  EXPECT_EQ(ShapeOf(npz, "registration_fine_m"), (Shape{2, 11, 3}));
  EXPECT_EQ(ShapeOf(npz, "vertex_sd_m"), (Shape{2, 7}));
  EXPECT_FALSE(npz.contains("contact"));  // without a network that is told contact
  EXPECT_EQ(StringFrom(npz, "format"), "sole-fit");
}

TEST(Fit, AnEmptySequenceRoundTrips) {
  const TempDir dir;
  WriteFit(dir / "fit.npz", {});
  EXPECT_TRUE(ReadFit(dir / "fit.npz").frames.empty());
}

TEST(Fit, RefusesFramesOfDifferentSize) {
  const TempDir dir;
  FitSequence fit;
  fit.frames = {MakeFit(1), MakeFit(2)};
  fit.frames[1].vertices_m.conservativeResize(6, 3);
  EXPECT_THAT(ErrorOf([&] { WriteFit(dir / "fit.npz", fit); }),
              HasSubstr("fit.npz: frames differ in the size of vertices_m"));
}

TEST(Fit, NamesTheArrayThatIsWrong) {
  const TempDir dir;
  FitSequence fit;
  fit.frames = {MakeFit(1)};
  WriteFit(dir / "fit.npz", fit);
  Npz npz = ReadNpz(dir / "fit.npz");
  npz.erase("theta");
  WriteNpz(dir / "a.npz", npz);
  EXPECT_THAT(ErrorOf([&] { ReadFit(dir / "a.npz"); }),
              HasSubstr("a.npz: array 'theta' is missing"));
  npz["theta"] = NpyFrom(std::vector<double>{1, 2});
  WriteNpz(dir / "b.npz", npz);
  EXPECT_THAT(ErrorOf([&] { ReadFit(dir / "b.npz"); }),
              HasSubstr("b.npz: array 'theta' has the wrong shape"));
}

TEST(Contact, RoundTripsBeforeAndAfterFitting) {
  const TempDir dir;
  ContactFile file;
  file.triggers = {5, 6};
  file.ground = {{1e-5, 2e-4, -3e-4, 4e-6, 1234}, {kNan, 0, 0, kNan, 0}};
  WriteContact(dir / "c.npz", file);
  EXPECT_TRUE(ReadContact(dir / "c.npz").contact.empty());
  file.contact = {{{1, 0, 1}, Eigen::Vector3d(0.9, 0.1, 0.8), Eigen::Vector3d(1e-5, 2e-3, kNan)},
                  {{0, 0, 0}, Eigen::Vector3d::Zero(), Eigen::Vector3d(1, 2, 3)}};
  WriteContact(dir / "c.npz", file);
  EXPECT_TRUE(ReadContact(dir / "c.npz").contact[0].state.empty());
  file.contact[0].state = {ContactState::kContact, ContactState::kFree, ContactState::kUncertain};
  file.contact[1].state.assign(3, ContactState::kFree);
  file.contact[0].slip_m = 2e-4;
  file.contact[1].penetration_m = 3e-5;
  WriteContact(dir / "c.npz", file);
  const ContactFile read = ReadContact(dir / "c.npz");
  EXPECT_EQ(read.triggers, file.triggers);
  EXPECT_EQ(read.ground[0].slope_y, -3e-4);
  EXPECT_EQ(read.ground[0].points, 1234);
  EXPECT_EQ(read.ground[0].sigma_m, 4e-6);
  EXPECT_TRUE(std::isnan(read.ground[1].offset_m));
  ASSERT_EQ(read.contact.size(), 2U);
  EXPECT_EQ(read.contact[0].contact, (std::vector<std::uint8_t>{1, 0, 1}));
  EXPECT_EQ(read.contact[0].probability, file.contact[0].probability);
  EXPECT_EQ(read.contact[0].gap_m[1], 2e-3);
  EXPECT_TRUE(std::isnan(read.contact[0].gap_m[2]));
  EXPECT_EQ(read.contact[1].gap_m, file.contact[1].gap_m);
  EXPECT_EQ(read.contact[0].state, file.contact[0].state);
  EXPECT_EQ(read.contact[0].slip_m, 2e-4);
  EXPECT_TRUE(std::isnan(read.contact[1].slip_m));
  EXPECT_EQ(read.contact[1].penetration_m, 3e-5);
}

TEST(Contact, RefusesAnUnknownState) {
  const TempDir dir;
  ContactFile file;
  file.triggers = {5};
  file.ground = {{}};
  file.contact = {{{1}, Eigen::VectorXd::Zero(1), Eigen::VectorXd::Zero(1)}};
  file.contact[0].state = {static_cast<ContactState>(3)};
  WriteContact(dir / "c.npz", file);
  EXPECT_THAT(ErrorOf([&] { ReadContact(dir / "c.npz"); }), HasSubstr("c.npz: array 'state' must hold 0, 1 or 2"));
}

TEST(Contact, RefusesAFitFile) {
  const TempDir dir;
  WriteFit(dir / "fit.npz", {});
  EXPECT_THAT(ErrorOf([&] { ReadContact(dir / "fit.npz"); }),
              HasSubstr("fit.npz: is a 'sole-fit' file, expected 'sole-contact'"));
}

}  // namespace
}  // namespace sole::io
