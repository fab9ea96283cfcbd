// Training of the contact-conditioned network on functions whose answer is known.
#include "model/train_network.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "model/network_gradient.h"
#include "model/train_checkpoint.h"
#include "random_model.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::model {
namespace {

using ::testing::HasSubstr;
using testing::RandomMatrix;
using testing_support::ErrorOf;

constexpr Eigen::Index kJoints = 3, kVertices = 6;

/// Contact presses vertices 0 to 2 up by 3 mm where they touch; joint 1's bend moves vertex 4 and
/// the first shape coefficient vertex 5. Poses of feet on the ground differ from those in the air, as
/// in life, so that pose alone tells much of the contact.
NetworkSamples MakeSamples(unsigned seed, Eigen::Index size) {
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<float> uniform(0, 1);
  NetworkSamples samples;
  samples.given = RandomMatrix(engine, 4 * kJoints + kNetworkBetas, size, 0.2).cast<float>();
  samples.given.bottomRows(kNetworkBetas) *= 5;
  samples.contact = samples.probability = Eigen::MatrixXf::Zero(kVertices, size);
  samples.offsets_m = Eigen::MatrixXf::Zero(3 * kVertices, size);
  samples.weights = Eigen::MatrixXf::Ones(kVertices, size);
  for (Eigen::Index s = 0; s < size; ++s) {
    const bool ground = s % 2 == 0;
    samples.given(8, s) += ground ? 0.3F : -0.3F;
    for (Eigen::Index i = 0; i < 3; ++i) {
      const bool touches = ground && uniform(engine) < 0.7F;
      samples.contact(i, s) = touches ? 1 : 0;
      samples.probability(i, s) = touches ? 0.95F : 0.05F;
      samples.offsets_m(3 * i + 2, s) = touches ? 0.003F : 0;
    }
    samples.offsets_m(12, s) = 0.01F * samples.given(4, s);
    samples.offsets_m(15, s) = 0.001F * samples.given(4 * kJoints, s);
  }
  return samples;
}

NetworkTrainingOptions SmallOptions(NetworkKind kind = NetworkKind::kPoseShapeContact) {
  NetworkTrainingOptions options;
  options.kind = kind;
  options.hidden = {24, 16, 8, 16};
  options.epochs = 120;
  options.patience = 40;
  options.rate = 3e-3;
  options.pose_noise_rad = 0;
  return options;
}

NetworkTraining Train(const NetworkSamples& samples, const NetworkSamples& validation,
                      const NetworkTrainingOptions& options) {
  NetworkTraining training = StartNetworkTraining(samples, options);
  while (!training.finished) TrainEpoch(samples, validation, options, training);
  return training;
}

TEST(FloatNetwork, HasTheGradientOfTheDoubleOne) {
  std::mt19937_64 engine(5);
  FloatNetwork network{{7, 5, 4, 9}, {}};
  network.parameters = RandomMatrix(engine, NumParameters(network.widths), 1, 0.5).cast<float>();
  const Eigen::MatrixXf inputs = RandomMatrix(engine, 7, 11, 1).cast<float>();
  const Eigen::MatrixXf by_values = RandomMatrix(engine, 9, 11, 1).cast<float>();
  const ForwardPass pass = RunForward(network, inputs);
  const Eigen::VectorXf gradient = RunBackward(network, pass, by_values);
  const std::vector<NetworkLayer> layers = LayersOf(network);
  for (Eigen::Index c = 0; c < inputs.cols(); ++c) {
    const Eigen::VectorXd wanted = EvaluateNetwork(layers, inputs.col(c).cast<double>());
    EXPECT_LT((pass.values.col(c).cast<double>() - wanted).cwiseAbs().maxCoeff(), 1e-5);
  }
  const NetworkGradient wanted =
      BackPropagate(layers, inputs.cast<double>(), by_values.cast<double>());
  const std::vector<NetworkLayer> got = LayersOf({network.widths, gradient});
  for (std::size_t l = 0; l < got.size(); ++l) {
    EXPECT_LT((got[l].weight - wanted.layers[l].weight).cwiseAbs().maxCoeff(), 1e-4);
    EXPECT_LT((got[l].bias - wanted.layers[l].bias).cwiseAbs().maxCoeff(), 1e-4);
  }
}

TEST(TrainNetwork, LearnsContactPoseAndShapeEachWhereTold) {
  const NetworkSamples samples = MakeSamples(1, 2000), validation = MakeSamples(2, 300);
  double loss[3] = {};
  for (const NetworkKind kind :
       {NetworkKind::kPose, NetworkKind::kPoseShape, NetworkKind::kPoseShapeContact}) {
    const NetworkTraining training = Train(samples, validation, SmallOptions(kind));
    loss[static_cast<int>(kind)] = training.best_mm;
    EXPECT_DOUBLE_EQ(training.best_mm, *std::min_element(training.validation_mm.begin(),
                                                         training.validation_mm.end()));
  }
  // Vertex 5 moves by 1 mm a unit of beta_1, mean |offset| 0.8 mm in one of 18 coordinates.
  EXPECT_LT(loss[1], loss[0] - 0.025);
  // What pose cannot tell of three vertices that touch in 70 % of the frames.
  EXPECT_LT(loss[2], 0.5 * loss[1]);
  EXPECT_LT(loss[2], 0.06);
}

TEST(TrainNetwork, SoleMovesWithContactNotWithTheStandingPose) {
  const NetworkSamples samples = MakeSamples(3, 2000), validation = MakeSamples(4, 300);
  const NetworkTraining training = Train(samples, validation, SmallOptions());
  const std::vector<NetworkLayer> layers = TrainedLayers(training);
  double moved[5] = {}, counted = 0;
  for (Eigen::Index s = 0; s < validation.Size(); s += 2) {
    if (validation.contact(1, s) == 0) continue;
    ++counted;
    for (int step = 0; step < 5; ++step) {
      Eigen::VectorXd input(validation.given.rows() + kVertices);
      input << validation.given.col(s).cast<double>(),
          0.25 * step * validation.contact.col(s).cast<double>();
      moved[step] += 1e3 * EvaluateNetwork(layers, input)[5];
    }
  }
  for (double& mm : moved) mm /= counted;
  EXPECT_LT(std::abs(moved[0]), 0.2);  // mm
  EXPECT_NEAR(moved[4], 3, 0.2);
  for (int step = 1; step < 5; ++step) EXPECT_GT(moved[step], moved[step - 1] + 0.3);
  EXPECT_NEAR(moved[2], 1.5, 0.5);
}

TEST(TrainNetwork, PoseNoiseKeepsSmallDifferencesFromCounting) {
  // Contact leaves a trace of 0.01 in one pose feature, too small to be anything but the fit's habit.
  const auto leaky = [](unsigned seed, Eigen::Index size) {
    NetworkSamples samples = MakeSamples(seed, size);
    samples.given.row(8).setZero();
    for (Eigen::Index s = 0; s < size; ++s)
      samples.given(9, s) = samples.contact.col(s).any() ? 0.01F : -0.01F;
    return samples;
  };
  const NetworkSamples samples = leaky(21, 1000), validation = leaky(22, 300);
  NetworkTrainingOptions options = SmallOptions(NetworkKind::kPose);
  options.pose_noise_rad = 0;
  const double without = Train(samples, validation, options).best_mm;
  options.pose_noise_rad = 0.2;
  EXPECT_GT(Train(samples, validation, options).best_mm, without + 0.03);
}

TEST(TrainNetwork, UnseenVerticesTeachNothing) {
  NetworkSamples samples = MakeSamples(5, 600);
  const NetworkSamples validation = MakeSamples(6, 200);
  const NetworkTrainingOptions options = SmallOptions();
  NetworkSamples spoilt = samples;
  samples.weights.row(0).setZero();
  spoilt.weights.row(0).setZero();
  spoilt.offsets_m.topRows(3).setConstant(0.5F);
  EXPECT_EQ(Train(samples, validation, options).best, Train(spoilt, validation, options).best);
}

TEST(TrainNetwork, EndsWhenValidationGetsNoBetterAndKeepsTheBest) {
  const NetworkSamples samples = MakeSamples(7, 64);
  NetworkSamples noise = MakeSamples(8, 64);
  std::mt19937_64 engine(9);
  noise.offsets_m = RandomMatrix(engine, 3 * kVertices, 64, 0.01).cast<float>();
  NetworkTrainingOptions options = SmallOptions();
  options.epochs = 1000;
  options.patience = 12;
  options.plateau = 5;
  const NetworkTraining training = Train(samples, noise, options);
  ASSERT_LT(training.epoch, 1000);
  const auto best =
      std::min_element(training.validation_mm.begin(), training.validation_mm.end());
  EXPECT_EQ(training.validation_mm.end() - best, 13);
  EXPECT_NEAR(training.rate, options.rate * 0.25, 1e-12);
  NetworkTraining kept = training;
  kept.network.parameters = training.best;
  EXPECT_DOUBLE_EQ(NetworkLoss(noise, options, kept), *best);
}

TEST(TrainNetwork, SameBytesWhateverTheThreadsAndAfterAnInterruption) {
  const NetworkSamples samples = MakeSamples(10, 300), validation = MakeSamples(11, 100);
  NetworkTrainingOptions options = SmallOptions();
  options.epochs = 8;
  options.pose_noise_rad = 0.02;
  const NetworkTraining whole = Train(samples, validation, options);
  {
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(Train(samples, validation, options).network.parameters, whole.network.parameters);
  }
  const testing_support::TempDir dir;
  NetworkTraining training = StartNetworkTraining(samples, options);
  for (int epoch = 0; epoch < 3; ++epoch) TrainEpoch(samples, validation, options, training);
  SaveNetworkTraining(dir / "t.npz", training, "a");
  training = LoadNetworkTraining(dir / "t.npz", "a");
  EXPECT_EQ(training.epoch, 3);
  while (!training.finished) TrainEpoch(samples, validation, options, training);
  EXPECT_EQ(training.network.parameters, whole.network.parameters);
  EXPECT_EQ(training.best, whole.best);
  EXPECT_EQ(training.validation_mm, whole.validation_mm);
  options.seed = 2;
  EXPECT_NE(Train(samples, validation, options).best, whole.best);
  EXPECT_THAT(ErrorOf([&] { LoadNetworkTraining(dir / "t.npz", "b"); }),
              HasSubstr("another configuration"));
}

TEST(TrainedLayers, TakePlainInputsAndAreExactInSinglePrecision) {
  const NetworkSamples samples = MakeSamples(12, 300), validation = MakeSamples(13, 50);
  NetworkTrainingOptions options = SmallOptions();
  options.epochs = 5;
  NetworkTraining training = Train(samples, validation, options);
  training.network.parameters = training.best;
  const std::vector<NetworkLayer> layers = TrainedLayers(training);
  double sum = 0;
  for (Eigen::Index s = 0; s < validation.Size(); ++s) {
    Eigen::VectorXd input(validation.given.rows() + kVertices);
    input << validation.given.col(s).cast<double>(), validation.contact.col(s).cast<double>();
    sum += (EvaluateNetwork(layers, input) - validation.offsets_m.col(s).cast<double>())
               .cwiseAbs()
               .mean();
  }
  EXPECT_NEAR(1e3 * sum / static_cast<double>(validation.Size()),
              NetworkLoss(validation, options, training), 1e-4);
  for (const NetworkLayer& layer : layers) {
    EXPECT_EQ(layer.weight.cast<float>().cast<double>(), layer.weight);
    EXPECT_EQ(layer.bias.cast<float>().cast<double>(), layer.bias);
  }
  EXPECT_TRUE((layers[0].weight.leftCols(4).array() == 0).all());  // the root does not count
}

TEST(TrainNetwork, RefusesSamplesThatDoNotFit) {
  NetworkSamples samples = MakeSamples(14, 10);
  samples.weights.conservativeResize(kVertices - 1, Eigen::NoChange);
  EXPECT_THAT(ErrorOf([&] { StartNetworkTraining(samples, SmallOptions()); }),
              HasSubstr("do not fit"));
}

}  // namespace
}  // namespace sole::model
