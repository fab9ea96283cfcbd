#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "model/contact_network.h"
#include "model/train_float_network.h"

namespace sole::model {

/// What a network learns from, one column a registration. K joints, N vertices.
struct NetworkSamples {
  Eigen::MatrixXf given;        ///< 4K + 2: quaternion features, the first shape coefficients
  Eigen::MatrixXf contact;      ///< N, 0 or 1
  Eigen::MatrixXf probability;  ///< N, soft contact
  Eigen::MatrixXf offsets_m;    ///< 3N, what the linear model lacks in the rest pose
  Eigen::MatrixXf weights;      ///< N, from 0 (not seen) to 1 (certain)

  Eigen::Index Size() const { return given.cols(); }
};

struct NetworkTrainingOptions {
  NetworkKind kind = NetworkKind::kPoseShapeContact;
  std::vector<int> hidden = {256, 128, 64, 32, 16, 32, 64, 128};
  int batch = 32;
  int epochs = 300;    ///< at most
  int patience = 30;   ///< epochs without a better validation loss that end it
  int plateau = 8;     ///< epochs without a better one that lower the rate
  double rate = 1e-3;  ///< of Adam
  double rate_decay = 0.5;
  double weight_decay = 1e-4;  ///< share of the weights taken off a step, times the rate (AdamW)
  /// Share of the samples, drawn anew every epoch, that see soft contact instead of the bits.
  double soft_share = 0.25;
  /// Share of the samples with contact that see a random part s of it, and are to move by the same
  /// part of their offsets; half of them see none (s = 0). This is what makes contact, not the pose
  /// that goes with it, move the sole, in proportion.
  double scaled_share = 0.25;
  /// Standard deviation of turns added to every joint of every sample, drawn anew every epoch: fitted
  /// poses are known no better, and a network that lives on smaller differences has learnt the fit's
  /// habits (its leftovers of contact among them), not the foot's. With 0.15 pose no longer tells it the
  /// load of pressed toes, but takes are fitted a tenth worse (docs/model.md).
  double pose_noise_rad = 0.02;
  /// Whether the root's rotation, the foot's heading in the room included, counts. Otherwise its
  /// inputs have zero weights.
  bool root = false;
  std::uint64_t seed = 1;
};

/// Everything that training goes on from.
struct NetworkTraining {
  FloatNetwork network;  ///< of scaled inputs and values
  Eigen::VectorXf first_moment, second_moment, best;
  Eigen::VectorXd input_mean, input_scale;  ///< the network sees (input - mean) * scale
  double value_scale_m = 1;                 ///< metres of one unit of its values
  std::int64_t steps = 0;
  int epoch = 0;            ///< epochs done
  int since_best = 0;       ///< epochs since the best one
  int since_lowered = 0;    ///< epochs since the best one or since the rate was lowered
  double rate = 0;
  double best_mm = 0;                          ///< validation loss of `best`
  std::vector<double> train_mm, validation_mm; ///< mean |offset - value| a coordinate, per epoch
  bool finished = false;
};

/// Random layers (He, uniform) of the kind's widths; scales from the samples. Throws Error where the
/// samples do not fit together.
NetworkTraining StartNetworkTraining(const NetworkSamples& samples,
                                     const NetworkTrainingOptions& options);

/// One epoch: the samples once, shuffled by seed and epoch, L1 loss weighted by certainty, Adam. The
/// validation samples see their contact bits. The same bytes follow from the same training, samples
/// and options on the same machine, whatever the number of threads.
void TrainEpoch(const NetworkSamples& samples, const NetworkSamples& validation,
                const NetworkTrainingOptions& options, NetworkTraining& training);

/// Mean |offset - value| a coordinate, mm, of the training's current parameters.
double NetworkLoss(const NetworkSamples& samples, const NetworkTrainingOptions& options,
                   const NetworkTraining& training);

/// The best layers with the scales folded into first and last, rounded to float32: they take plain
/// inputs and give metres.
std::vector<NetworkLayer> TrainedLayers(const NetworkTraining& training);

}  // namespace sole::model
