#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "model/foot_model.h"

namespace sole::model {

/// Slope of the leaky ReLU between the network's layers, and how many shape coefficients it sees.
inline constexpr double kNetworkSlope = 0.1;
inline constexpr Eigen::Index kNetworkBetas = 2;

/// What a network is told. Each kind's inputs are the first ones of the next, so the width of its
/// first layer says which it is: 4K quaternion features, 2 shape coefficients, N contact values.
enum class NetworkKind { kPose, kPoseShape, kPoseShapeContact };

Eigen::Index NumNetworkInputs(Eigen::Index num_joints, Eigen::Index num_vertices,
                              NetworkKind kind = NetworkKind::kPoseShapeContact);

/// Kind of a model's network; nothing where it has none. Throws Error where its width is no kind's.
std::optional<NetworkKind> KindOfNetwork(const FootModel& model);

/// Inputs of the fullest kind; beta may be short and contact empty, what is missing counts as zero.
Eigen::VectorXd NetworkInput(const Eigen::MatrixX3d& theta, const Eigen::VectorXd& beta,
                             const Eigen::VectorXd& contact, Eigen::Index num_vertices);

/// Network value (3N, metres): leaky ReLU after every layer but the last, which is linear. Of
/// `input` the first values count, as many as the network takes. `single` as in DerivedModelData:
/// layers' weights to be read in single precision, or nothing.
Eigen::VectorXd EvaluateNetwork(std::span<const NetworkLayer> layers, const Eigen::VectorXd& input,
                                std::span<const Eigen::MatrixXf> single = {});

/// The value, and its derivative in some of the inputs as a product, split at the narrowest layer:
/// few multiplications, since the network's width there is small.
struct NetworkFactors {
  Eigen::VectorXd value;  ///< 3N
  Eigen::MatrixXd outer;  ///< 3N x width of the narrowest layer
  Eigen::MatrixXd inner;  ///< that width x inputs asked for
};
NetworkFactors DifferentiateNetwork(std::span<const NetworkLayer> layers,
                                    const Eigen::VectorXd& input, Eigen::Index first_input,
                                    Eigen::Index num_inputs,
                                    std::span<const Eigen::MatrixXf> single = {});

/// Contact-conditioned offsets B_C of a variant, stacked (3N or 3 N_fine); the fine ones through
/// `upsampling`. Empty where the model has no network.
Eigen::VectorXd ContactOffsets(const FootModel& model, Variant variant,
                               const Eigen::MatrixX3d& theta, const Eigen::VectorXd& beta,
                               const Eigen::VectorXd& contact);

/// They and their derivative; no columns where the model has no network. `value` and `outer` have
/// the variant's rows.
/// In the pose: columns theta (3K), then the first min(B, 2) shape coefficients.
NetworkFactors ContactOffsetsByPose(const FootModel& model, Variant variant,
                                    const Eigen::MatrixX3d& theta, const Eigen::VectorXd& beta,
                                    const Eigen::VectorXd& contact);
/// In the N contact values; zero where the network is not told them.
NetworkFactors ContactOffsetsByContact(const FootModel& model, Variant variant,
                                       const Eigen::MatrixX3d& theta, const Eigen::VectorXd& beta,
                                       const Eigen::VectorXd& contact);

}  // namespace sole::model
