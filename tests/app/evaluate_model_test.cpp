// `sole evaluate MODEL DATASET` on registrations that are made by known models, so that the right
// figures are known.
#include "app/evaluate_model.h"

#include <cmath>
#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/line_plot.h"
#include "app/model_scores.h"
#include "app/registrations.h"
#include "app/stages.h"
#include "io/atomic_file.h"
#include "model/contact_network.h"
#include "model/forward.h"
#include "model/mirror.h"
#include "model/model_file.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using Eigen::Index;
using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

/// A name that falls into the split.
std::string NameIn(const std::string& split, int from) {
  while (SplitOfSubject("P" + std::to_string(from)) != split) ++from;
  return "P" + std::to_string(from);
}

/// The shipped model with a network that lifts every vertex by a millimetre times its contact.
model::FootModel LiftingModel() {
  model::FootModel foot = model::LoadModel(DefaultTemplatePath());
  const Index n = foot.NumVertices(), inputs = model::NumNetworkInputs(foot.NumJoints(), n);
  model::NetworkLayer layer{Eigen::MatrixXd::Zero(3 * n, inputs), Eigen::VectorXd::Zero(3 * n)};
  for (Index v = 0; v < n; ++v) layer.weight(3 * v + 2, inputs - n + v) = 0.001;
  foot.network = {layer};
  Prepare(foot);
  return foot;
}

/// Registrations that the model explains exactly: one frame in the air, one that touches.
void WriteFeet(const fs::path& set, const model::FootModel& right, const std::string& name,
               Side side, unsigned seed) {
  const model::FootModel foot = side == Side::kLeft ? MirrorModel(right) : right;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  SubjectRegistrations r;
  r.subject = name;
  r.split = SplitOfSubject(name);
  r.side = side;
  r.motion = {"air", "stand"};
  r.sequence = {0, 1};
  r.time_s = {0, 0};
  r.verdict = {"good", "good"};
  const Index n = foot.NumVertices();
  r.sd_m = Eigen::MatrixXf::Constant(2, n, 1e-5F);
  r.contact.setZero(2, n);
  for (Index v = 0; v < n; v += 3) r.contact(1, v) = 1;
  r.probability = r.contact.cast<float>();
  r.gap_m = Eigen::MatrixXf::Zero(2, n);
  model::ModelParameters p = RestParameters(foot);
  for (Index b = 0; b < 4; ++b) p.beta[b] = normal(random);
  r.beta = p.beta;
  r.translation_m.setZero(2, 3);
  for (int f = 0; f < 2; ++f) {
    for (Index j = 1; j < p.theta.rows(); ++j)
      for (int axis = 0; axis < 3; ++axis) p.theta(j, axis) = 0.25 * normal(random);
    p.translation_m << 0.1 * f, 0.02, 0.01;
    p.contact = r.contact.row(f).cast<double>().transpose();
    r.theta.push_back(p.theta);
    r.translation_m.row(f) = p.translation_m.transpose();
    r.fine_m.push_back(Forward(foot, p, model::Variant::kFine).vertices_m.cast<float>());
    Eigen::MatrixX3f truth = Forward(foot, p).vertices_m.cast<float>();
    truth.col(1).array() += 0.002F;
    r.true_m.push_back(truth);
  }
  // What was not seen must not count.
  r.sd_m(0, 5) = 0.001F;
  r.fine_m[0].row(5).array() += 0.05F;
  io::MakeDirectory(set / "registrations");
  WriteRegistrations(RegistrationsFile(set, name + (side == Side::kLeft ? "-left" : "-right")), r);
}

class EvaluateModelTest : public testing::Test {
 protected:
  void SetUp() override {
    model_ = LiftingModel();
    model::SaveModel(directory_ / "foot.npz", model_);
    const std::string first = NameIn("test", 0), second = NameIn("test", 100);
    WriteFeet(directory_ / "set", model_, first, Side::kLeft, 1);
    WriteFeet(directory_ / "set", model_, first, Side::kRight, 2);
    WriteFeet(directory_ / "set", model_, second, Side::kRight, 3);
    model::FootModel other = model_;
    other.coarse.template_m.array() *= 1.5;  // would spoil every figure
    other.fine.template_m.array() *= 1.5;
    Prepare(other);
    WriteFeet(directory_ / "set", other, NameIn("train", 0), Side::kRight, 4);
  }
  TempDir directory_;
  model::FootModel model_;
};

TEST_F(EvaluateModelTest, AModelExplainsWhatItMadeAndItsPartsExplainLess) {
  const nlohmann::json e = EvaluateModel(directory_ / "foot.npz", directory_ / "set",
                                         {.plots = directory_ / "plots.html"});
  EXPECT_EQ(e["subjects"], 2);
  EXPECT_EQ(e["registrations"], 6);
  const nlohmann::json& a = e["ablation"];
  EXPECT_LT(a["full"]["contact_mm"], 0.05);
  EXPECT_LT(a["full"]["noncontact_mm"], 0.05);
  EXPECT_NEAR(a["linear"]["noncontact_mm"], a["full"]["noncontact_mm"], 1e-6);
  EXPECT_GT(a["linear"]["contact_mm"], 0.3);  // a third of the vertices is lifted by 1 mm
  EXPECT_GT(a["linear"]["touching_mm"], a["linear"]["contact_mm"]);
  EXPECT_GT(a["lbs"]["noncontact_mm"], 2 * a["linear"]["noncontact_mm"].get<double>());
  EXPECT_TRUE(a["f_theta"].is_null());
  // The step before the full model is the linear one where the others are missing.
  EXPECT_NEAR(a["full"]["contact_gain_mm"].get<double>(),
              a["linear"]["contact_mm"].get<double>() - a["full"]["contact_mm"].get<double>(), 1e-9);
  EXPECT_GT(a["linear"]["noncontact_gain_interval_mm"][0], 0);
  EXPECT_NEAR(a["full"]["contact_truth_mm"], 2, 0.05);
  EXPECT_LE(a["full"]["contact_interval_mm"][0], a["full"]["contact_mm"]);
  EXPECT_GE(a["full"]["contact_interval_mm"][1], a["full"]["contact_mm"]);
  EXPECT_NEAR(e["contact_response"]["free_mm"], 0, 1e-9);
  EXPECT_GT(e["contact_response"]["flattening_share"], 0.9);
  EXPECT_EQ(e["contact_response"]["monotonic_share"], 1);
  // Four coefficients differ from zero.
  const nlohmann::json& components = e["components"];
  EXPECT_EQ(components[0]["explained"], 0);
  EXPECT_LT(components[3]["explained"], 0.999);
  EXPECT_GT(components[4]["explained"], 0.999);
  EXPECT_LT(components[4]["v2v_mm"], 0.05);
  EXPECT_THAT(FormatModelEvaluation(e), HasSubstr("6 registrations of 2 subjects"));
  EXPECT_THAT(io::ReadFile(directory_ / "plots.html"), HasSubstr("<polyline"));
}

TEST_F(EvaluateModelTest, ModelsBesideItAndABaselineAreScored) {
  model::SaveModel(directory_ / "foot-f_theta.npz", model_);
  model::FootModel worse = model_;
  worse.coarse.weights.setZero();
  worse.fine.weights.setZero();
  worse.coarse.weights.col(1).setOnes();
  worse.fine.weights.col(1).setOnes();
  Prepare(worse);
  model::SaveModel(directory_ / "stiff.npz", worse);
  const nlohmann::json e = EvaluateModel(directory_ / "foot.npz", directory_ / "set",
                                         {.baseline = directory_ / "stiff.npz"});
  EXPECT_EQ(e["ablation"]["f_theta"]["contact_mm"], e["ablation"]["full"]["contact_mm"]);
  EXPECT_EQ(e["ablation"]["full"]["contact_gain_mm"], 0);
  EXPECT_GT(e["baseline"]["noncontact_mm"], 1);
}

TEST_F(EvaluateModelTest, WhatDoesNotFitIsSaidInALine) {
  EXPECT_THAT(ErrorOf([&] {
                EvaluateModel(directory_ / "foot.npz", directory_ / "set", {.split = "validation"});
              }),
              HasSubstr("no good registration of the split 'validation'"));
  EXPECT_EQ(ReadSpecimens(directory_ / "set", "all", 1).all.size(), 4U);
  model::FootModel small = model_;
  small.fine = {};
  small.upsampling.clear();
  const Index n = 200;
  small.coarse.template_m.conservativeResize(n, 3);
  small.coarse.weights.conservativeResize(n, Eigen::NoChange);
  small.coarse.shapedirs.conservativeResize(3 * n, Eigen::NoChange);
  small.coarse.posedirs.conservativeResize(3 * n, Eigen::NoChange);
  small.coarse.triangles = Eigen::RowVector3i(0, 1, 2);
  small.joint_regressor = small.joint_regressor.leftCols(n).eval();
  small.network.clear();
  small.activations.resize(0, 0);
  small.landmarks.clear();
  small.material.clear();
  Prepare(small);
  model::SaveModel(directory_ / "small.npz", small);
  EXPECT_THAT(ErrorOf([&] { EvaluateModel(directory_ / "small.npz", directory_ / "set"); }),
              HasSubstr("have 266 vertices, the model 200"));
}

TEST(SpreadOf, IntervalsAreThoseOfSubjects) {
  Specimens specimens;
  specimens.subjects = {"a", "b", "c", "d"};
  std::vector<double> values;
  for (std::size_t i = 0; i < 40; ++i) {
    Specimen s;
    s.subject = i % 4;
    specimens.all.push_back(s);
    values.push_back(static_cast<double>(i % 4));
  }
  const Spread spread = SpreadOf(specimens, values);
  EXPECT_DOUBLE_EQ(spread.mean, 1.5);
  EXPECT_NEAR(spread.sd, std::sqrt(1.25), 1e-12);
  // The mean of 4 subjects drawn with replacement: SD sqrt(1.25 / 4), not sqrt(1.25 / 40).
  EXPECT_NEAR(spread.high - spread.low, 2 * 1.96 * std::sqrt(1.25 / 4), 0.3);
  std::vector<double> some(40, std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(std::isnan(SpreadOf(specimens, some).mean));
  some[3] = 7;
  EXPECT_EQ(SpreadOf(specimens, some).mean, 7);
  EXPECT_EQ(SpreadOf(specimens, some).count, 1);
}

TEST(DrawLinePlot, LeavesOutWhatIsNotFiniteAndEscapesNames) {
  const std::string svg = DrawLinePlot(
      {"a<b", "x", "y", {{"n&m", {0, 1, 2}, {1, std::nan(""), 3}}, {"", {}, {}}}});
  EXPECT_THAT(svg, HasSubstr("a&lt;b"));
  EXPECT_THAT(svg, HasSubstr("n&amp;m"));
  EXPECT_THAT(svg, testing::Not(HasSubstr("nan")));
}

}  // namespace
}  // namespace sole::app
