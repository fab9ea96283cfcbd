#include "model/forward_batch.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>

#include "model/constraints.h"
#include "model/contact_network.h"
#include "model/kernels_internal.h"
#include "model/skeleton.h"

namespace sole::model {
namespace {

/// Feet of one chunk: the products' working set stays in the second-level cache.
constexpr std::size_t kChunk = 64;

/// sum += a b.
template <class Scalar>
void Add(const MatrixOf<Scalar>& a, const MatrixOf<Scalar>& b, Eigen::Ref<MatrixOf<Scalar>> sum) {
  AddProduct<Scalar>({a.rows(), b.cols(), a.cols(), a.data(), a.rows(), b.data(), b.rows(),
                      sum.data(), sum.outerStride()});
}

/// beta, then the pose features, of every foot.
template <class Scalar>
MatrixOf<Scalar> Coefficients(const BatchModel<Scalar>& batch,
                              std::span<const ModelParameters> feet) {
  const Eigen::Index betas = batch.model->NumBetas();
  MatrixOf<Scalar> values =
      MatrixOf<Scalar>::Zero(batch.blend.cols(), static_cast<Eigen::Index>(feet.size()));
  for (Eigen::Index m = 0; m < values.cols(); ++m) {
    const ModelParameters& foot = feet[static_cast<std::size_t>(m)];
    values.col(m).head(foot.beta.size()) = foot.beta.template cast<Scalar>();
    if (values.rows() == betas) continue;
    values.col(m).tail(values.rows() - betas) =
        ConstrainedPoseFeatures(*batch.model, foot.theta, foot.beta).template cast<Scalar>();
  }
  return values;
}

/// Network values of every foot, 3N of the coarse variant.
template <class Scalar>
MatrixOf<Scalar> NetworkValues(const BatchModel<Scalar>& batch,
                               std::span<const ModelParameters> feet) {
  MatrixOf<Scalar> values(batch.weights.front().cols(), static_cast<Eigen::Index>(feet.size()));
  for (Eigen::Index m = 0; m < values.cols(); ++m) {
    const ModelParameters& foot = feet[static_cast<std::size_t>(m)];
    values.col(m) = NetworkInput(foot.theta, foot.beta, foot.contact, batch.model->NumVertices())
                        .head(values.rows())
                        .template cast<Scalar>();
  }
  for (std::size_t l = 0; l < batch.weights.size(); ++l) {
    MatrixOf<Scalar> next(batch.weights[l].rows(), values.cols());
    next.colwise() = batch.biases[l].col(0);
    Add<Scalar>(batch.weights[l], values, next);
    if (l + 1 < batch.weights.size())
      next = next.cwiseMax(static_cast<Scalar>(kNetworkSlope) * next);
    values.swap(next);
  }
  return values;
}

/// Adds the network's offsets, on the fine variant through the upsampling.
template <class Scalar>
void AddOffsets(const BatchModel<Scalar>& batch, const MatrixOf<Scalar>& coarse,
                Eigen::Ref<MatrixOf<Scalar>> rest) {
  if (batch.variant == Variant::kCoarse) {
    rest += coarse;
    return;
  }
  for (Eigen::Index m = 0; m < rest.cols(); ++m) {
    for (std::size_t i = 0; i < batch.model->upsampling.size(); ++i) {
      for (const auto& [vertex, weight] : batch.model->upsampling[i]) {
        rest.col(m).template segment<3>(3 * static_cast<Eigen::Index>(i)) +=
            static_cast<Scalar>(weight) * coarse.col(m).template segment<3>(3 * vertex);
      }
    }
  }
}

/// Skins one foot in place and writes its joints.
template <class Scalar>
void SkinFoot(const BatchModel<Scalar>& batch, const ModelParameters& foot, Scalar* vertices,
              Scalar* joints) {
  using Points = Eigen::Matrix<Scalar, 3, Eigen::Dynamic>;
  const Skeleton skeleton = PoseSkeleton(*batch.model, foot.theta, foot.beta);
  const MatrixOf<Scalar> transforms = BoneTransforms(skeleton).template cast<Scalar>();
  const Eigen::Matrix<Scalar, 3, 1> translation = foot.translation_m.template cast<Scalar>();
  const DerivedModelData::Influences& influences = InfluencesOf(*batch.model, batch.variant);
  Skin<Scalar>({batch.template_m.rows() / 3, influences.start.data(), influences.joint.data(),
                influences.weight.data(), transforms.data(), translation.data(), vertices,
                vertices});
  Eigen::Map<Points>(joints, 3, skeleton.joints.cols()) =
      skeleton.joints.template cast<Scalar>().colwise() + translation;
}

}  // namespace

template <class Scalar>
BatchModel<Scalar> PrepareBatch(const FootModel& model, Variant variant) {
  const ModelSurface& surface = SurfaceOf(model, variant);
  BatchModel<Scalar> batch{&model, variant, {}, {}, {}, {}};
  const Eigen::Matrix3Xd positions = surface.template_m.transpose();
  batch.template_m =
      Eigen::Map<const Eigen::VectorXd>(positions.data(), positions.size()).template cast<Scalar>();
  batch.blend.resize(surface.shapedirs.rows(), surface.shapedirs.cols() + surface.posedirs.cols());
  batch.blend.leftCols(surface.shapedirs.cols()) = surface.shapedirs.template cast<Scalar>();
  if (surface.posedirs.cols() > 0)
    batch.blend.rightCols(surface.posedirs.cols()) = surface.posedirs.template cast<Scalar>();
  for (const NetworkLayer& layer : model.network) {
    batch.weights.push_back(layer.weight.template cast<Scalar>());
    batch.biases.push_back(layer.bias.template cast<Scalar>());
  }
  return batch;
}

template <class Scalar>
PosedBatch<Scalar> ForwardBatch(const BatchModel<Scalar>& batch,
                                std::span<const ModelParameters> parameters) {
  for (const ModelParameters& foot : parameters) CheckParameters(*batch.model, foot);
  const auto count = static_cast<Eigen::Index>(parameters.size());
  PosedBatch<Scalar> posed;
  posed.vertices_m.resize(batch.template_m.rows(), count);
  posed.joints_m.resize(3 * batch.model->NumJoints(), count);
  const std::size_t chunks = (parameters.size() + kChunk - 1) / kChunk;
  tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t chunk) {
    const std::size_t first = chunk * kChunk, size = std::min(kChunk, parameters.size() - first);
    const auto feet = parameters.subspan(first, size);
    auto vertices = posed.vertices_m.middleCols(static_cast<Eigen::Index>(first),
                                                static_cast<Eigen::Index>(size));
    vertices.colwise() = batch.template_m.col(0);
    Add<Scalar>(batch.blend, Coefficients(batch, feet), vertices);
    if (!batch.weights.empty()) AddOffsets<Scalar>(batch, NetworkValues(batch, feet), vertices);
    for (std::size_t m = 0; m < size; ++m) {
      SkinFoot(batch, feet[m], vertices.col(static_cast<Eigen::Index>(m)).data(),
               posed.joints_m.col(static_cast<Eigen::Index>(first + m)).data());
    }
  });
  return posed;
}

template BatchModel<double> PrepareBatch(const FootModel& model, Variant variant);
template BatchModel<float> PrepareBatch(const FootModel& model, Variant variant);
template PosedBatch<double> ForwardBatch(const BatchModel<double>& batch,
                                         std::span<const ModelParameters> parameters);
template PosedBatch<float> ForwardBatch(const BatchModel<float>& batch,
                                        std::span<const ModelParameters> parameters);

PosedBatch<double> ForwardBatch(const FootModel& model, std::span<const ModelParameters> parameters,
                                Variant variant) {
  return ForwardBatch(PrepareBatch<double>(model, variant), parameters);
}

}  // namespace sole::model
