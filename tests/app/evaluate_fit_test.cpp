// Scores of labels, fitted and registered points against truth that is known exactly.
#include "app/evaluate_fit.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "model/model_file.h"
#include "sim/reference_foot.h"

namespace sole::app {
namespace {

const model::FootModel& Model() {
  static const model::FootModel model = model::LoadModel(SOLE_MODEL_FILE);
  return model;
}

/// The reference foot, its lowest material point `height_m` above z = 0.
FrameTruth FootAt(std::int64_t trigger, double height_m) {
  FrameTruth frame;
  frame.trigger = trigger;
  frame.mesh = sim::ReferenceFoot();
  double lowest = 1;
  for (const Eigen::Vector3d& p : MaterialPositions(Model(), frame.mesh, Side::kRight)) lowest = std::min(lowest, p.z());
  for (Eigen::Vector3d& v : frame.mesh.vertices) v.z() += height_m - lowest;
  return frame;
}

Eigen::MatrixX3d Places(const FrameTruth& frame) {
  const std::vector<Eigen::Vector3d> places = MaterialPositions(Model(), frame.mesh, Side::kRight);
  Eigen::MatrixX3d rows(static_cast<Eigen::Index>(places.size()), 3);
  for (std::size_t v = 0; v < places.size(); ++v) rows.row(static_cast<Eigen::Index>(v)) = places[v];
  return rows;
}

FrameFit FitOf(const FrameTruth& truth, double fitted_off_m, double registered_off_m) {
  FrameFit frame;
  frame.trigger = truth.trigger;
  frame.found = true;
  frame.vertices_m = Places(truth).rowwise() + Eigen::RowVector3d(0, fitted_off_m, 0);
  frame.registration_m = Places(truth).rowwise() + Eigen::RowVector3d(registered_off_m, 0, 0);
  return frame;
}

TEST(ScoreFit, TellsRegisteredFromFittedPointsAndContactFromAir) {
  TakeTruth truth;
  truth.frames = {FootAt(1, 0.00005), FootAt(2, 0.03), FootAt(3, 0.00005), FootAt(4, 0.03)};
  FitSequence fit;
  fit.frames = {FitOf(truth.frames[0], 0.002, 0.001), FitOf(truth.frames[1], 0.0005, 0.0003),
                FitOf(truth.frames[2], 0.004, 0.003), FitOf(truth.frames[3], 1, 1)};
  fit.frames[3].found = false;
  const nlohmann::json score = ScoreFit(fit, Model(), truth);
  EXPECT_NEAR(score["v2v_contact_mm"].get<double>(), 3, 1e-9);
  EXPECT_NEAR(score["v2v_noncontact_mm"].get<double>(), 0.5, 1e-9);
  EXPECT_NEAR(score["v2v_frames_p95_mm"].get<double>(), 4, 1e-9);
  EXPECT_NEAR(score["registered_contact_mm"].get<double>(), 2, 1e-9);
  EXPECT_NEAR(score["registered_noncontact_mm"].get<double>(), 0.3, 1e-9);
}

TEST(ScoreFit, IsNullWithoutAFitOrMaterialPoints) {
  TakeTruth truth;
  truth.frames = {FootAt(1, 0.03)};
  EXPECT_TRUE(ScoreFit({}, Model(), truth)["registered_noncontact_mm"].is_null());
  FitSequence fit;
  fit.frames = {FitOf(truth.frames[0], 0.001, 0.001)};
  const nlohmann::json score = ScoreFit(fit, {}, truth);
  EXPECT_TRUE(score["registered_noncontact_mm"].is_null());
  EXPECT_LE(score["surface_mean_mm"].get<double>(), 1);
}

TEST(ScoreContact, CountsLabelsByTheTrueGap) {
  TakeTruth truth;
  truth.frames = {FootAt(1, 0.00005)};
  const Eigen::MatrixX3d places = Places(truth.frames[0]);
  io::ContactFile file{{1}, {GroundPlane{}}, {FrameContact{}}};
  file.contact[0].contact.assign(static_cast<std::size_t>(places.rows()), 0);
  int touching = 0;
  for (Eigen::Index v = 0; v < places.rows(); ++v) {
    touching += places(v, 2) < 0.0001;
    file.contact[0].contact[static_cast<std::size_t>(v)] = places(v, 2) < 0.0001;
  }
  ASSERT_GT(touching, 0);
  EXPECT_EQ(ScoreContact(file, Model(), truth)["f1"].get<double>(), 1);
  EXPECT_EQ(ScoreContact(file, Model(), truth)["near_free"].get<double>(), 1);
  // A wrong label where the gap is neither one nor the other costs f1 alone.
  FrameTruth& frame = truth.frames[0];
  for (Eigen::Vector3d& v : frame.mesh.vertices) v.z() += 0.00002;  // the lowest is now 0.07 mm up
  const Eigen::MatrixX3d raised = Places(frame);
  for (Eigen::Index v = 0; v < raised.rows(); ++v) file.contact[0].contact[static_cast<std::size_t>(v)] = raised(v, 2) < 0.00005;
  EXPECT_EQ(ScoreContact(file, Model(), truth)["f1"].get<double>(), 0);
  EXPECT_TRUE(ScoreContact(file, Model(), truth)["f1_clear"].is_null());
  std::fill(file.contact[0].contact.begin(), file.contact[0].contact.end(), 1);
  EXPECT_NEAR(ScoreContact(file, Model(), truth)["precision"].get<double>(),
              static_cast<double>(touching) / static_cast<double>(places.rows()), 1e-12);
}

}  // namespace
}  // namespace sole::app
