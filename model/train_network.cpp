#include "model/train_network.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <random>
#include <span>

#include "core/error.h"

namespace sole::model {
namespace {

/// A batch is worked on in this many parts side by side; fixed, so that sums have one order.
constexpr Eigen::Index kParts = 2;

void CheckSamples(const NetworkSamples& samples) {
  const Eigen::Index n = samples.contact.rows(), size = samples.Size();
  Require(size > 0 && samples.contact.cols() == size && samples.probability.cols() == size &&
              samples.offsets_m.cols() == size && samples.weights.cols() == size &&
              samples.probability.rows() == n && samples.offsets_m.rows() == 3 * n &&
              samples.weights.rows() == n && samples.given.rows() > kNetworkBetas,
          "network training: the samples' sizes do not fit together");
}

Eigen::Index NumInputs(const NetworkSamples& samples, NetworkKind kind) {
  return NumNetworkInputs((samples.given.rows() - kNetworkBetas) / 4, samples.contact.rows(), kind);
}

void CheckOptions(const NetworkTrainingOptions& o) {
  Require(o.batch >= 1 && o.epochs >= 1 && o.patience >= 1 && o.plateau >= 1 && o.rate > 0 &&
              o.rate_decay > 0 && o.rate_decay <= 1 && o.weight_decay >= 0 && o.soft_share >= 0 &&
              o.scaled_share >= 0 && o.pose_noise_rad >= 0 && o.soft_share + o.scaled_share <= 1,
          "network training: an option is out of its range");
  for (const int width : o.hidden) Require(width >= 1, "network training: a layer has no width");
}

/// How one sample is shown.
struct View {
  Eigen::Index sample = 0;
  bool soft = false;
  float share = 1;  ///< of contact and offsets
  std::uint64_t noise = 0;  ///< seed of the pose's noise, 0: none
};

double Uniform(std::mt19937_64& engine) { return static_cast<double>(engine() >> 11) * 0x1p-53; }

/// Turns of independent joints, small: half of each shows in the vector part of its quaternion.
void AddPoseNoise(std::uint64_t seed, double sd_rad, Eigen::Ref<Eigen::VectorXf> features) {
  std::mt19937_64 engine(seed);
  for (Eigen::Index joint = 0; joint + 4 <= features.size(); joint += 4) {
    for (Eigen::Index axis = joint; axis < joint + 3; ++axis) {
      // Sum of four uniform values: near enough to a Gaussian, of deviation sqrt(1/3).
      double sum = -2;
      for (int i = 0; i < 4; ++i) sum += Uniform(engine);
      features[axis] += static_cast<float>(0.5 * sd_rad * std::sqrt(3.0) * sum);
    }
  }
}

/// Plain inputs, one column a view.
Eigen::MatrixXf Inputs(const NetworkSamples& samples, std::span<const View> views,
                       Eigen::Index inputs, double pose_noise_rad) {
  Eigen::MatrixXf columns(inputs, static_cast<Eigen::Index>(views.size()));
  const Eigen::Index given = std::min(inputs, samples.given.rows());
  for (std::size_t v = 0; v < views.size(); ++v) {
    const View& view = views[v];
    auto column = columns.col(static_cast<Eigen::Index>(v));
    column.head(given) = samples.given.col(view.sample).head(given);
    if (view.noise != 0)
      AddPoseNoise(view.noise, pose_noise_rad, column.head(samples.given.rows() - kNetworkBetas));
    if (inputs > given) {
      column.tail(inputs - given) =
          view.share *
          (view.soft ? samples.probability : samples.contact).col(view.sample);
    }
  }
  return columns;
}

void Scale(const NetworkTraining& training, Eigen::MatrixXf& inputs) {
  inputs.colwise() -= training.input_mean.cast<float>();
  inputs = training.input_scale.cast<float>().asDiagonal() * inputs;
}

/// Sums over a batch.
struct Loss {
  double absolute = 0;  ///< weighted, in units of the network's values
  double weight = 0;    ///< of coordinates
};

/// Loss of the views, and where asked its derivative times the weights' sum.
Loss LossOf(const NetworkSamples& samples, std::span<const View> views,
            const NetworkTraining& training, const Eigen::MatrixXf& values,
            Eigen::MatrixXf* by_values) {
  Loss loss;
  const float unit = static_cast<float>(1 / training.value_scale_m);
  if (by_values) by_values->resize(values.rows(), values.cols());
  for (std::size_t v = 0; v < views.size(); ++v) {
    const auto column = static_cast<Eigen::Index>(v);
    const View& view = views[v];
    const float factor = unit * view.share;
    for (Eigen::Index i = 0; i < samples.weights.rows(); ++i) {
      const float weight = samples.weights(i, view.sample);
      for (Eigen::Index axis = 3 * i; axis < 3 * i + 3; ++axis) {
        const float difference =
            values(axis, column) - factor * samples.offsets_m(axis, view.sample);
        loss.absolute += static_cast<double>(weight * std::abs(difference));
        if (by_values) {
          (*by_values)(axis, column) =
              difference > 0 ? weight : (difference < 0 ? -weight : 0.0F);
        }
      }
      loss.weight += 3 * static_cast<double>(weight);
    }
  }
  return loss;
}

/// Order and views of an epoch.
std::vector<View> DrawViews(const NetworkSamples& samples, const NetworkTrainingOptions& options,
                            int epoch) {
  std::mt19937_64 engine(options.seed * 1000003 + static_cast<std::uint64_t>(epoch) + 1);
  std::vector<View> views(static_cast<std::size_t>(samples.Size()));
  for (std::size_t v = 0; v < views.size(); ++v)
    views[v].sample = static_cast<Eigen::Index>(v);
  // Own shuffle and numbers: those of the standard library differ between its makers.
  for (std::size_t v = views.size(); v > 1; --v)
    std::swap(views[v - 1],
              views[static_cast<std::size_t>(Uniform(engine) * static_cast<double>(v))]);
  if (options.pose_noise_rad > 0) {
    for (View& view : views) view.noise = engine() | 1;
  }
  if (options.kind != NetworkKind::kPoseShapeContact) return views;
  for (View& view : views) {
    const double draw = Uniform(engine), share = Uniform(engine);
    if (draw < options.soft_share) {
      view.soft = true;
    } else if (draw < options.soft_share + options.scaled_share &&
               samples.contact.col(view.sample).any()) {
      view.share = static_cast<float>(std::max(0.0, 2 * share - 1));
    }
  }
  return views;
}

/// One step of Adam with the weights' decay apart from the gradient (AdamW).
void Step(const Eigen::VectorXf& gradient, const NetworkTrainingOptions& options,
          NetworkTraining& training) {
  constexpr float kFirst = 0.9F, kSecond = 0.999F, kSmall = 1e-8F;
  ++training.steps;
  const double steps = static_cast<double>(training.steps);
  const auto rate = static_cast<float>(training.rate / (1 - std::pow(0.9, steps)));
  const auto spread = static_cast<float>(1 / std::sqrt(1 - std::pow(0.999, steps)));
  training.first_moment = kFirst * training.first_moment + (1 - kFirst) * gradient;
  training.second_moment =
      kSecond * training.second_moment + (1 - kSecond) * gradient.cwiseAbs2();
  Eigen::VectorXf& parameters = training.network.parameters;
  parameters *= static_cast<float>(1 - training.rate * options.weight_decay);
  parameters.array() -= rate * training.first_moment.array() /
                        (spread * training.second_moment.array().sqrt() + kSmall);
}

/// Loss of a batch; a step downhill.
Loss LearnBatch(const NetworkSamples& samples, std::span<const View> views,
                const NetworkTrainingOptions& options, NetworkTraining& training) {
  const Eigen::Index size = static_cast<Eigen::Index>(views.size()),
                     inputs = training.network.widths.front();
  Loss losses[kParts];
  Eigen::VectorXf gradients[kParts];
  tbb::parallel_for(Eigen::Index{0}, kParts, [&](Eigen::Index part) {
    const Eigen::Index begin = size * part / kParts, end = size * (part + 1) / kParts;
    const auto some = views.subspan(static_cast<std::size_t>(begin),
                                    static_cast<std::size_t>(end - begin));
    Eigen::MatrixXf columns = Inputs(samples, some, inputs, options.pose_noise_rad);
    Scale(training, columns);
    const ForwardPass pass = RunForward(training.network, columns);
    Eigen::MatrixXf by_values;
    losses[part] = LossOf(samples, some, training, pass.values, &by_values);
    gradients[part] = RunBackward(training.network, pass, std::move(by_values));
  });
  Loss loss;
  Eigen::VectorXf gradient = Eigen::VectorXf::Zero(training.network.parameters.size());
  for (Eigen::Index part = 0; part < kParts; ++part) {
    loss.absolute += losses[part].absolute;
    loss.weight += losses[part].weight;
    gradient += gradients[part];
  }
  if (loss.weight > 0) Step(gradient / static_cast<float>(loss.weight), options, training);
  return loss;
}

double Millimetres(const Loss& loss, const NetworkTraining& training) {
  return loss.weight > 0 ? 1e3 * training.value_scale_m * loss.absolute / loss.weight : 0;
}

}  // namespace

NetworkTraining StartNetworkTraining(const NetworkSamples& samples,
                                     const NetworkTrainingOptions& options) {
  CheckSamples(samples);
  CheckOptions(options);
  NetworkTraining training;
  training.rate = options.rate;
  std::vector<Eigen::Index>& widths = training.network.widths;
  widths.push_back(NumInputs(samples, options.kind));
  widths.insert(widths.end(), options.hidden.begin(), options.hidden.end());
  widths.push_back(samples.offsets_m.rows());

  // Inputs of mean 0 and deviation 1. A contact bit that hardly ever changes must not count for
  // more than it says, and an input that never does is left out.
  const Eigen::Index inputs = widths.front(), given = samples.given.rows();
  training.input_mean.resize(inputs);
  training.input_scale.resize(inputs);
  for (Eigen::Index i = 0; i < inputs; ++i) {
    const Eigen::RowVectorXd row =
        (i < given ? samples.given.row(i) : samples.contact.row(i - given)).cast<double>();
    training.input_mean[i] = row.mean();
    const double deviation = std::sqrt((row.array() - row.mean()).square().mean());
    training.input_scale[i] =
        deviation < 1e-6 ? 0 : 1 / std::max(deviation, i < given ? 1e-3 : 0.2);
  }
  if (!options.root) training.input_scale.head(4).setZero();
  double sum = 0, weight = 1e-30;
  for (Eigen::Index s = 0; s < samples.Size(); ++s) {
    for (Eigen::Index i = 0; i < samples.weights.rows(); ++i) {
      const auto w = static_cast<double>(samples.weights(i, s));
      sum += w * static_cast<double>(
                     samples.offsets_m.col(s).segment<3>(3 * i).squaredNorm());
      weight += 3 * w;
    }
  }
  training.value_scale_m = sum > 0 ? std::sqrt(sum / weight) : 1;

  std::mt19937_64 engine(options.seed);
  training.network.parameters = Eigen::VectorXf::Zero(NumParameters(widths));
  float* at = training.network.parameters.data();
  for (std::size_t l = 0; l + 1 < widths.size(); ++l) {
    const bool last = l + 2 == widths.size();
    const double range = std::sqrt((last ? 0.1 : 6.0) / static_cast<double>(widths[l]));
    for (Eigen::Index w = 0; w < widths[l] * widths[l + 1]; ++w)
      *at++ = static_cast<float>(range * (2 * Uniform(engine) - 1));
    at += widths[l + 1];
  }
  training.first_moment = training.second_moment =
      Eigen::VectorXf::Zero(training.network.parameters.size());
  training.best = training.network.parameters;
  return training;
}

double NetworkLoss(const NetworkSamples& samples, const NetworkTrainingOptions& options,
                   const NetworkTraining& training) {
  constexpr Eigen::Index kColumns = 256;
  const Eigen::Index chunks = (samples.Size() + kColumns - 1) / kColumns;
  std::vector<Loss> losses(static_cast<std::size_t>(chunks));
  tbb::parallel_for(Eigen::Index{0}, chunks, [&](Eigen::Index chunk) {
    std::vector<View> views;
    for (Eigen::Index s = kColumns * chunk; s < std::min(samples.Size(), kColumns * (chunk + 1)); ++s)
      views.push_back({s, false, 1, 0});
    Eigen::MatrixXf columns = Inputs(samples, views, NumInputs(samples, options.kind), 0);
    Scale(training, columns);
    losses[static_cast<std::size_t>(chunk)] =
        LossOf(samples, views, training, EvaluateBatch(training.network, columns), nullptr);
  });
  Loss sum;
  for (const Loss& loss : losses) {
    sum.absolute += loss.absolute;
    sum.weight += loss.weight;
  }
  return Millimetres(sum, training);
}

void TrainEpoch(const NetworkSamples& samples, const NetworkSamples& validation,
                const NetworkTrainingOptions& options, NetworkTraining& training) {
  CheckSamples(samples);
  CheckSamples(validation);
  CheckOptions(options);
  if (training.finished) return;
  const std::vector<View> views = DrawViews(samples, options, training.epoch);
  Loss sum;
  for (std::size_t begin = 0; begin < views.size();) {
    const std::size_t size =
        std::min(views.size() - begin, static_cast<std::size_t>(options.batch));
    const Loss loss =
        LearnBatch(samples, std::span(views).subspan(begin, size), options, training);
    sum.absolute += loss.absolute;
    sum.weight += loss.weight;
    begin += size;
  }
  const double seen_mm = NetworkLoss(validation, options, training);
  Require(std::isfinite(seen_mm),
          fmt::format("network training: the loss grew beyond all bounds in epoch {}: use a lower "
                      "rate than {}",
                      training.epoch + 1, options.rate));
  training.train_mm.push_back(Millimetres(sum, training));
  training.validation_mm.push_back(seen_mm);
  ++training.epoch;
  if (training.epoch == 1 || seen_mm < training.best_mm) {
    training.best_mm = seen_mm;
    training.best = training.network.parameters;
    training.since_best = training.since_lowered = 0;
  } else {
    ++training.since_best;
    if (++training.since_lowered >= options.plateau) {
      training.rate *= options.rate_decay;
      training.since_lowered = 0;
    }
  }
  training.finished =
      training.epoch >= options.epochs || training.since_best >= options.patience;
}

std::vector<NetworkLayer> TrainedLayers(const NetworkTraining& training) {
  std::vector<NetworkLayer> layers = LayersOf({training.network.widths, training.best});
  NetworkLayer& first = layers.front();
  first.weight = (first.weight * training.input_scale.asDiagonal()).eval();
  first.bias -= first.weight * training.input_mean;
  NetworkLayer& last = layers.back();
  last.weight *= training.value_scale_m;
  last.bias *= training.value_scale_m;
  for (NetworkLayer& layer : layers) {
    layer.weight = layer.weight.cast<float>().cast<double>();
    layer.bias = layer.bias.cast<float>().cast<double>();
  }
  return layers;
}

}  // namespace sole::model
