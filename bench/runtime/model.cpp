// The foot model beside a plain Eigen transcription of its formulas, on a random model of the
// paper's size: 266 vertices, 13 joints, 10 shapes, at most four influences a vertex, dense
// correctives, values of single precision as in its file. A third of the contact values is one.
// usage: bench_model [--benchmark_filter=REGEX]; single evaluations run on one thread.
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include <random>
#include <vector>

#include "model/constraints.h"
#include "model/contact_network.h"
#include "model/forward_batch.h"
#include "model/jacobian.h"
#include "model/skeleton.h"

namespace sole::model {
namespace {

constexpr Eigen::Index kVertices = 266, kJoints = 13, kShapes = 10;

Eigen::MatrixXd Random(std::mt19937_64& engine, Eigen::Index rows, Eigen::Index cols,
                       double scale) {
  std::normal_distribution<double> normal(0, scale);
  return Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return normal(engine); });
}

/// As a model's file holds them.
Eigen::MatrixXd RandomSingle(std::mt19937_64& engine, Eigen::Index rows, Eigen::Index cols,
                             double scale) {
  return Random(engine, rows, cols, scale).cast<float>().cast<double>();
}

FootModel MakeModel(bool network) {
  std::mt19937_64 engine(1);
  FootModel model;
  model.parents = {-1, 0, 1, 2, 3, 2, 5, 2, 7, 2, 9, 2, 11};
  model.coarse.template_m = Random(engine, kVertices, 3, 0.1);
  model.coarse.triangles = Eigen::MatrixX3i::Zero(1, 3);
  model.coarse.weights = Eigen::MatrixXd::Zero(kVertices, kJoints);
  for (Eigen::Index i = 0; i < kVertices; ++i)
    for (Eigen::Index e = 0; e < 4; ++e) model.coarse.weights(i, (i + 3 * e) % kJoints) = 0.25;
  model.coarse.shapedirs = RandomSingle(engine, 3 * kVertices, kShapes, 0.002);
  model.coarse.posedirs = RandomSingle(engine, 3 * kVertices, 4 * kJoints, 0.002);
  model.joint_regressor = Eigen::MatrixXd::Constant(kJoints, kVertices, 1.0 / kVertices);
  const Eigen::Index sizes[] = {
      4 * kJoints + 2 + kVertices, 256, 128, 64, 32, 16, 32, 64, 128, 3 * kVertices};
  for (int l = 0; network && l < 9; ++l)
    model.network.push_back({RandomSingle(engine, sizes[l + 1], sizes[l], 0.1),
                             Random(engine, sizes[l + 1], 1, 0.1)});
  Prepare(model);
  return model;
}

std::vector<ModelParameters> MakeFeet(std::size_t count) {
  std::mt19937_64 engine(2);
  std::vector<ModelParameters> feet(count);
  for (ModelParameters& foot : feet) {
    foot.theta = Random(engine, kJoints, 3, 0.3);
    foot.beta = Random(engine, kShapes, 1, 1);
    foot.translation_m = Random(engine, 3, 1, 0.1);
    foot.contact = (Random(engine, kVertices, 1, 1).array() > 0.43).cast<double>();
  }
  return feet;
}

const FootModel& TheModel(bool network) {
  static const FootModel with = MakeModel(true), without = MakeModel(false);
  return network ? with : without;
}

/// The formulas as they stand in the paper.
PosedFoot PlainForward(const FootModel& model, const ModelParameters& foot) {
  const ModelSurface& surface = model.coarse;
  Eigen::Matrix3Xd rest = surface.template_m.transpose();
  rest.reshaped() += surface.shapedirs * foot.beta +
                     surface.posedirs * ConstrainedPoseFeatures(model, foot.theta, foot.beta);
  Eigen::VectorXd value = NetworkInput(foot.theta, foot.beta, foot.contact, kVertices);
  for (std::size_t l = 0; l < model.network.size(); ++l) {
    value = (model.network[l].weight * value + model.network[l].bias).eval();
    if (l + 1 < model.network.size()) value = value.cwiseMax(kNetworkSlope * value).eval();
  }
  if (!model.network.empty()) rest.reshaped() += value;
  const Skeleton skeleton = PoseSkeleton(model, foot.theta, foot.beta);
  Eigen::Matrix3Xd posed = foot.translation_m.replicate(1, kVertices);
  for (Eigen::Index j = 0; j < kJoints; ++j) {
    const Eigen::Matrix3Xd moved =
        (skeleton.rotations[static_cast<std::size_t>(j)] * rest).colwise() +
        skeleton.offsets.col(j);
    posed += moved * surface.weights.col(j).asDiagonal();
  }
  return {posed.transpose(),
          skeleton.joints.transpose().rowwise() + foot.translation_m.transpose()};
}

void BM_Plain(benchmark::State& state) {
  const ModelParameters foot = MakeFeet(1)[0];
  for (auto _ : state) benchmark::DoNotOptimize(PlainForward(TheModel(state.range(0) != 0), foot));
}
BENCHMARK(BM_Plain)->ArgName("network")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

void BM_Forward(benchmark::State& state) {
  const ModelParameters foot = MakeFeet(1)[0];
  for (auto _ : state) benchmark::DoNotOptimize(Forward(TheModel(state.range(0) != 0), foot));
}
BENCHMARK(BM_Forward)->ArgName("network")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

/// Soft contact: no input of the network is zero.
void BM_ForwardSoftContact(benchmark::State& state) {
  ModelParameters foot = MakeFeet(1)[0];
  foot.contact.array() = 0.1 + 0.8 * foot.contact.array();
  for (auto _ : state) benchmark::DoNotOptimize(Forward(TheModel(true), foot));
}
BENCHMARK(BM_ForwardSoftContact)->Unit(benchmark::kMicrosecond);

/// Central differences of the plain forward, what needs no derivation.
void BM_PlainJacobian(benchmark::State& state) {
  const FootModel& model = TheModel(state.range(0) != 0);
  const ModelParameters foot = MakeFeet(1)[0];
  const Eigen::Index columns = 3 * kJoints + kShapes + 3;
  RowMatrix jacobian(3 * kVertices, columns);
  for (auto _ : state) {
    for (Eigen::Index c = 0; c < columns; ++c) {
      ModelParameters sides[2] = {foot, foot};
      for (int s = 0; s < 2; ++s) {
        double& value = c < 3 * kJoints             ? sides[s].theta(c / 3, c % 3)
                        : c < 3 * kJoints + kShapes ? sides[s].beta[c - 3 * kJoints]
                                                    : sides[s].translation_m[c - columns + 3];
        value += s == 0 ? 1e-6 : -1e-6;
      }
      const Eigen::Matrix3Xd change =
          (PlainForward(model, sides[0]).vertices_m - PlainForward(model, sides[1]).vertices_m)
              .transpose();
      jacobian.col(c) = change.reshaped() / 2e-6;
    }
    benchmark::DoNotOptimize(jacobian.data());
  }
}
BENCHMARK(BM_PlainJacobian)->ArgName("network")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

void BM_Jacobian(benchmark::State& state) {
  const ModelParameters foot = MakeFeet(1)[0];
  for (auto _ : state) {
    benchmark::DoNotOptimize(VertexJacobian(TheModel(state.range(0) != 0), foot, Variant::kCoarse));
  }
}
BENCHMARK(BM_Jacobian)->ArgName("network")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

void BM_ContactJacobian(benchmark::State& state) {
  const ModelParameters foot = MakeFeet(1)[0];
  for (auto _ : state)
    benchmark::DoNotOptimize(VertexContactJacobian(TheModel(true), foot, Variant::kCoarse));
}
BENCHMARK(BM_ContactJacobian)->Unit(benchmark::kMicrosecond);

constexpr std::size_t kFeet = 1024;

void CountFeet(benchmark::State& state) {
  state.counters["us_a_foot"] =
      benchmark::Counter(static_cast<double>(state.iterations() * kFeet) * 1e-6,
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

/// On one thread, so that it compares with a matrix product on one thread.
template <class Scalar>
void BM_Batch(benchmark::State& state) {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const auto batch = PrepareBatch<Scalar>(TheModel(state.range(0) != 0));
  const std::vector<ModelParameters> feet = MakeFeet(kFeet);
  for (auto _ : state) benchmark::DoNotOptimize(ForwardBatch(batch, feet));
  CountFeet(state);
}
BENCHMARK(BM_Batch<float>)->ArgName("network")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_Batch<double>)->ArgName("network")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

/// Eigen's float matrix product for the same arithmetic.
void BM_FloatProducts(benchmark::State& state) {
  std::vector<Eigen::MatrixXf> factors = {
      Eigen::MatrixXf::Random(3 * kVertices, kShapes + 4 * kJoints)};
  for (const NetworkLayer& layer : TheModel(state.range(0) != 0).network)
    factors.emplace_back(layer.weight.cast<float>());
  std::vector<Eigen::MatrixXf> inputs, outputs;
  for (const Eigen::MatrixXf& factor : factors) {
    inputs.emplace_back(Eigen::MatrixXf::Random(factor.cols(), kFeet));
    outputs.emplace_back(factor.rows(), kFeet);
  }
  for (auto _ : state) {
    for (std::size_t f = 0; f < factors.size(); ++f) {
      outputs[f].noalias() = factors[f] * inputs[f];
      benchmark::DoNotOptimize(outputs[f].data());
    }
  }
  CountFeet(state);
}
BENCHMARK(BM_FloatProducts)->ArgName("network")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace sole::model

BENCHMARK_MAIN();
