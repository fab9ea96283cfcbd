#include "contact/temporal.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/error.h"

namespace sole::contact {
namespace {

/// Frames whose errors have nothing to do with each other.
const TemporalOptions kIndependent{.neighbours = 1};

/// One vertex over time; NaN: not registered.
std::vector<FrameContact> Frames(const std::vector<double>& probabilities) {
  std::vector<FrameContact> frames;
  for (const double p : probabilities) {
    FrameContact frame;
    frame.contact = {p > 0.5};
    frame.probability = Eigen::VectorXd::Constant(1, std::isnan(p) ? 0 : p);
    frame.gap_m = Eigen::VectorXd::Constant(1, std::isnan(p) ? p : 1e-4 * (1 - p));
    frames.push_back(frame);
  }
  return frames;
}

/// P(touching in `frame` | all) by summing over every sequence of states; `change` from each frame to the next, other frames'
/// probabilities to the power `neighbours`.
double BruteForce(const std::vector<double>& probabilities, std::size_t frame, const std::vector<double>& change, double neighbours) {
  double all = 0, touching = 0;
  for (unsigned states = 0; states < (1u << probabilities.size()); ++states) {
    double weight = 1;
    for (std::size_t f = 0; f < probabilities.size(); ++f) {
      const bool on = states >> f & 1u;
      weight *= std::pow(on ? probabilities[f] : 1 - probabilities[f], f == frame ? 1 : neighbours);
      if (f > 0) weight *= on == bool(states >> (f - 1) & 1u) ? 1 - change[f - 1] : change[f - 1];
    }
    all += weight;
    if (states >> frame & 1u) touching += weight;
  }
  return touching / all;
}

TEST(SmoothLabels, GivesTheProbabilityOverAllSequencesOfStates) {
  const std::vector<double> said{0.3, 0.6, 0.45, 0.9, 0.2, 0.5};
  std::vector<double> change;
  for (std::size_t f = 0; f + 1 < said.size(); ++f)
    change.push_back((10 * 0.1 + std::abs(said[f] - said[f + 1])) / (10 + std::max(said[f], said[f + 1])));
  for (const double neighbours : {1.0, 0.1}) {
    std::vector<FrameContact> frames = Frames(said);
    SmoothLabels(frames, {.neighbours = neighbours});
    for (std::size_t f = 0; f < said.size(); ++f) {
      const double expected = BruteForce(said, f, change, neighbours);
      EXPECT_NEAR(frames[f].probability[0], expected, 1e-6) << f;
      EXPECT_EQ(frames[f].contact[0], expected > 0.5) << f;
    }
  }
}

TEST(SmoothLabels, FillsADoubtfulFrameButNeverMovesAConfidentOne) {
  std::vector<FrameContact> frames = Frames({0.99, 0.99, 0.4, 0.99, 0.99, 0.02, 0.99, 0.99, std::nan("")});
  SmoothLabels(frames, kIndependent);
  EXPECT_EQ(frames[2].contact[0], 1);
  EXPECT_EQ(frames[2].state[0], ContactState::kContact);
  EXPECT_EQ(frames[5].contact[0], 0);  // alone between touching ones, but sure
  EXPECT_EQ(frames[5].probability[0], 0.02);
  EXPECT_EQ(frames[5].state[0], ContactState::kFree);
  EXPECT_EQ(frames[0].probability[0], 0.99);
  EXPECT_EQ(frames[8].contact[0], 0);  // not registered
  EXPECT_EQ(frames[8].state[0], ContactState::kFree);
}

TEST(SmoothLabels, BelievesFramesOfAMovingFootLess) {
  // Vertex 0 is doubtful between two touching frames; 60 others stay on the glass, or all land in one frame and leave in the next.
  const auto doubtful = [](bool moving) {
    std::vector<FrameContact> frames(3);
    for (std::size_t f = 0; f < 3; ++f) {
      frames[f].probability = Eigen::VectorXd::Constant(61, moving && f != 1 ? 0.01 : 0.99);
      frames[f].probability[0] = f == 1 ? 0.4 : 0.97;
      frames[f].gap_m = Eigen::VectorXd::Zero(61);
      frames[f].contact.assign(61, 0);
    }
    SmoothLabels(frames, kIndependent);
    return frames[1].probability[0];
  };
  EXPECT_GT(doubtful(false), 0.95);
  EXPECT_NEAR(doubtful(true), 0.4, 0.01);
}

TEST(SmoothLabels, KeepsUncertainAsAThirdState) {
  std::vector<FrameContact> frames = Frames({0.99, 0.5, 0.01});
  SmoothLabels(frames, kIndependent);
  EXPECT_NEAR(frames[1].probability[0], 0.5, 0.02);
  EXPECT_EQ(frames[1].state[0], ContactState::kUncertain);
  frames = Frames({0.9});
  SmoothLabels(frames, kIndependent);
  EXPECT_EQ(frames[0].state[0], ContactState::kContact);
  EXPECT_NEAR(frames[0].probability[0], 0.9, 1e-6);
}

TEST(SmoothLabels, DoesNotTakeTheSameErrorInManyFramesForManyWitnesses) {
  std::vector<FrameContact> frames = Frames(std::vector<double>(20, 0.7)), independent = frames;
  SmoothLabels(frames);
  SmoothLabels(independent, kIndependent);
  EXPECT_GT(frames[10].probability[0], 0.7);
  EXPECT_LT(frames[10].probability[0], 0.85);
  EXPECT_GT(independent[10].probability[0], 0.95);
}

TEST(SmoothLabels, RefusesFramesOfDifferentSize) {
  std::vector<FrameContact> frames = Frames({0.5, 0.5});
  frames[1].probability = frames[1].gap_m = Eigen::VectorXd::Zero(2);
  EXPECT_THROW(SmoothLabels(frames), Error);
}

TEST(MeasureSlip, IsTheMeanMotionAlongTheGlassOfWhatStaysOnIt) {
  FrameContact labels;
  labels.probability = Eigen::Vector4d::Zero();
  labels.contact = {1, 1, 0, 1};
  labels.gap_m = Eigen::Vector4d(-3e-5, 5e-5, -0.01, -1e-5);
  std::vector<FrameContact> frames{labels, labels};
  frames[1].contact = {1, 1, 1, 0};
  Eigen::MatrixX3d first = Eigen::MatrixX3d::Zero(4, 3), second = first;
  second.row(0) << 0.003, 0.004, 0.1;  // height does not count
  second.row(1) << 0.001, 0, 0;
  second.row(2) << 1, 0, 0;  // was free
  second.row(3) << 1, 0, 0;  // has left
  MeasureSlip({first, second}, frames);
  EXPECT_TRUE(std::isnan(frames[0].slip_m));
  EXPECT_NEAR(frames[1].slip_m, 0.003, 1e-12);
  EXPECT_NEAR(frames[0].penetration_m, 4e-5 / 3, 1e-12);
  EXPECT_NEAR(frames[1].penetration_m, (3e-5 + 0.01) / 3, 1e-12);
  frames[1].contact.assign(4, 0);
  MeasureSlip({first, second}, frames);
  EXPECT_TRUE(std::isnan(frames[1].penetration_m));
}

}  // namespace
}  // namespace sole::contact
