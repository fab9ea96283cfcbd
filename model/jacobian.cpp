#include "model/jacobian.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

#include "core/error.h"
#include "model/constraints.h"
#include "model/contact_network.h"
#include "model/kernels_internal.h"
#include "model/skeleton.h"

namespace sole::model {
namespace {

/// Everything that does not depend on the vertex.
struct PoseDerivative {
  Skeleton skeleton;
  std::vector<Eigen::Matrix3d>
      turn_axes;  ///< K: columns = world angular velocity per theta component
  std::vector<Eigen::Matrix3Xd> joint_by_beta;   ///< K: derivative of the posed joint, 3 x B'
  std::vector<Eigen::Matrix3Xd> offset_by_beta;  ///< K: of the bone's offset, 3 x B'
  std::vector<FeatureBlock> features;            ///< K
};

PoseDerivative DifferentiatePose(const FootModel& model, const ModelParameters& parameters) {
  const auto k = static_cast<std::size_t>(model.NumJoints());
  const Eigen::Index betas = parameters.beta.size();
  PoseDerivative d;
  d.skeleton = PoseSkeleton(model, parameters.theta, parameters.beta);
  for (std::size_t j = 0; j < k; ++j) {
    const auto row = static_cast<Eigen::Index>(j);
    const Eigen::Matrix3d left = TurnAxes(model, parameters.theta, row);
    const Eigen::Matrix3Xd rest = model.derived.joint_shapedirs.block(3 * row, 0, 3, betas);
    if (model.parents[j] < 0) {
      d.turn_axes.push_back(left);
      d.joint_by_beta.push_back(rest);
    } else {
      const auto parent = static_cast<std::size_t>(model.parents[j]);
      d.turn_axes.emplace_back(d.skeleton.rotations[parent] * left);
      d.joint_by_beta.emplace_back(d.skeleton.rotations[parent] * rest + d.offset_by_beta[parent]);
    }
    d.offset_by_beta.emplace_back(d.joint_by_beta[j] - d.skeleton.rotations[j] * rest);
    d.features.push_back(ConstrainedFeatureBlock(model, parameters.theta, row));
  }
  return d;
}

/// d (axis x arm) for the three columns of `axes`.
Eigen::Matrix3d TurnColumns(const Eigen::Matrix3d& axes, const Eigen::Vector3d& arm) {
  Eigen::Matrix3d columns;
  for (int c = 0; c < 3; ++c) columns.col(c) = axes.col(c).cross(arm);
  return columns;
}

/// Writes the three rows of one vertex after another.
class VertexDifferentiator {
 public:
  VertexDifferentiator(const FootModel& model, const ModelParameters& parameters, Variant variant)
      : translation_m_(parameters.translation_m),
        network_(ContactOffsetsByPose(model, variant, parameters.theta, parameters.beta,
                                      parameters.contact)),
        rest_(StackedRestVertices(model, parameters, variant, network_.value)) {
    const PoseDerivative pose = DifferentiatePose(model, parameters);
    const ModelSurface& surface = SurfaceOf(model, variant);
    const DerivedModelData::Influences& influences = InfluencesOf(model, variant);
    transforms_ = BoneTransforms(pose.skeleton);
    StoreJoints(pose, model.NumJoints(), parameters.beta.size());
    terms_.joints = model.NumJoints();
    terms_.betas = parameters.beta.size();
    terms_.parents = model.parents.data();
    terms_.start = influences.start.data();
    terms_.joint = influences.joint.data();
    terms_.weight = influences.weight.data();
    terms_.rows = 3 * surface.NumVertices();
    terms_.shapedirs = surface.shapedirs.data();
    if (surface.posedirs.cols() > 0) {
      terms_.posedirs = surface.posedirs.data();
      terms_.corrected = (variant == Variant::kCoarse ? model.derived.coarse_corrected
                                                      : model.derived.fine_corrected)
                             .data();
    }
    const DerivedModelData::SingleSurface& single = SingleSurfaceOf(model, variant);
    terms_.shapedirs_single = single.shapedirs.data();
    terms_.posedirs_single = single.posedirs.data();
    terms_.single = single.shapedirs.size() == surface.shapedirs.size() &&
                    single.posedirs.size() == surface.posedirs.size();
    terms_.first_feature_joint = model.family == Family::kSupr ? 0 : 1;
    const bool by_beta = model.family == Family::kStar && surface.posedirs.cols() > 0;
    terms_.beta_feature = by_beta ? surface.posedirs.cols() - 1 : -1;
    Connect();
  }
  VertexDifferentiator(const VertexDifferentiator&) = delete;
  VertexDifferentiator& operator=(const VertexDifferentiator&) = delete;

  /// Of `count` vertices from `first`: positions to points, 3 rows each to `jacobian`, both from
  /// place `to` on.
  void Write(Eigen::Index first, Eigen::Index count, Eigen::Index to, Eigen::Matrix3Xd& points,
             RowMatrix& jacobian) {
    DifferentiateVertices(terms_, first, count, jacobian.row(3 * to).data(), points.col(to).data());
  }

 private:
  void StoreJoints(const PoseDerivative& pose, Eigen::Index joints, Eigen::Index betas) {
    centres_.resize(4, joints);
    centres_ << pose.skeleton.joints, Eigen::RowVectorXd::Ones(joints);
    turns_.setZero(36, joints);
    offset_by_beta_.setZero(4, joints * betas);
    terms_.joint_features = std::max<Eigen::Index>(4, pose.features.back().jacobian.rows());
    feature_derivative_.setZero(3 * terms_.joint_features, joints);
    for (Eigen::Index j = 0; j < joints; ++j) {
      const auto at = static_cast<std::size_t>(j);
      for (int arm = 0; arm < 3; ++arm) {
        const Eigen::Matrix3d columns = TurnColumns(pose.turn_axes[at], Eigen::Vector3d::Unit(arm));
        for (int c = 0; c < 3; ++c) turns_.col(j).segment<3>(12 * c + 4 * arm) = columns.col(c);
      }
      offset_by_beta_.block(0, j * betas, 3, betas) = pose.offset_by_beta[at];
      const auto& features = pose.features[at].jacobian;
      feature_derivative_.col(j).head(features.size()) =
          Eigen::Map<const Eigen::VectorXd>(features.data(), features.size());
    }
  }

  void Connect() {
    moments_.resize(4 * terms_.joints);
    block_.resize(3 * kVertexBlock * (3 * terms_.joints + terms_.betas));
    columns_.resize(4 * (3 * terms_.joints + terms_.betas + 3) + 16);
    terms_.transforms = transforms_.data();
    terms_.translation = translation_m_.data();
    terms_.centres = centres_.data();
    terms_.turns = turns_.data();
    terms_.offset_by_beta = offset_by_beta_.data();
    terms_.rest = rest_.data();
    terms_.feature_derivative = feature_derivative_.data();
    terms_.latent = network_.outer.cols();
    terms_.network_columns = network_.inner.cols();
    terms_.network_outer = network_.outer.data();
    terms_.network_inner = network_.inner.data();
    terms_.moments = moments_.data();
    terms_.block = block_.data();
    terms_.columns = columns_.data();
  }

  Eigen::Vector3d translation_m_;
  NetworkFactors network_;
  Eigen::Matrix3Xd rest_;
  Eigen::MatrixXd transforms_, centres_, turns_, offset_by_beta_, feature_derivative_;
  Eigen::VectorXd moments_, block_, columns_;
  VertexDerivativeTerms terms_{};
};

/// Rows of d vertices / d contact: the network's outer factor, turned with the vertices, and its
/// inner one.
struct ContactFactors {
  RowMatrix outer;  ///< 3 N x width
  Eigen::MatrixXd inner;
};

ContactFactors TurnedContactFactors(const FootModel& model, const ModelParameters& parameters,
                                    Variant variant) {
  CheckParameters(model, parameters);
  const NetworkFactors network = ContactOffsetsByContact(model, variant, parameters.theta,
                                                         parameters.beta, parameters.contact);
  const Skeleton skeleton = PoseSkeleton(model, parameters.theta, parameters.beta);
  const DerivedModelData::Influences& influences = InfluencesOf(model, variant);
  ContactFactors factors{network.outer, network.inner};
  for (Eigen::Index i = 0; 3 * i < network.outer.rows(); ++i) {
    Eigen::Matrix3d blended = Eigen::Matrix3d::Zero();
    const auto at = static_cast<std::size_t>(i);
    for (auto e = static_cast<std::size_t>(influences.start[at]);
         e < static_cast<std::size_t>(influences.start[at + 1]); ++e) {
      blended +=
          influences.weight[e] * skeleton.rotations[static_cast<std::size_t>(influences.joint[e])];
    }
    factors.outer.middleRows<3>(3 * i) = blended * network.outer.middleRows<3>(3 * i);
  }
  return factors;
}

}  // namespace

ParameterColumns ColumnsOf(const FootModel& model, const ModelParameters& parameters) {
  const Eigen::Index turns = 3 * model.NumJoints(), betas = parameters.beta.size();
  return {0, turns, turns + betas, turns + betas + 3};
}

PointsJacobian VertexJacobian(const FootModel& model, const ModelParameters& parameters,
                              Variant variant) {
  std::vector<int> all(static_cast<std::size_t>(SurfaceOf(model, variant).NumVertices()));
  std::iota(all.begin(), all.end(), 0);
  return VertexJacobian(model, parameters, variant, all);
}

PointsJacobian VertexJacobian(const FootModel& model, const ModelParameters& parameters,
                              Variant variant, std::span<const int> vertices) {
  CheckParameters(model, parameters);
  VertexDifferentiator differentiator(model, parameters, variant);
  const auto count = static_cast<Eigen::Index>(vertices.size());
  PointsJacobian result;
  result.points_m.resize(count, 3);
  result.jacobian.resize(3 * count, ColumnsOf(model, parameters).count);
  for (const int vertex : vertices) {
    if (vertex < 0 || vertex >= SurfaceOf(model, variant).NumVertices())
      throw Error(fmt::format("foot model: no vertex {}", vertex));
  }
  Eigen::Matrix3Xd points(3, count);
  for (std::size_t m = 0; m < vertices.size();) {
    std::size_t end = m + 1;
    while (end < vertices.size() && vertices[end] == vertices[end - 1] + 1) ++end;
    differentiator.Write(vertices[m], static_cast<Eigen::Index>(end - m),
                         static_cast<Eigen::Index>(m), points, result.jacobian);
    m = end;
  }
  result.points_m = points.transpose();
  return result;
}

void VisitSurfacePoints(const FootModel& model, const ModelParameters& parameters, Variant variant,
                        std::span<const SurfacePoint> points, const PointVisitor& visit) {
  CheckParameters(model, parameters);
  const ModelSurface& surface = SurfaceOf(model, variant);
  const Eigen::Index vertices = surface.NumVertices();
  // Blocks of vertices are computed when the first of them is asked for: a vertex is a corner of
  // many points.
  std::vector<bool> known(static_cast<std::size_t>(vertices / kVertexBlock + 1), false);
  VertexDifferentiator differentiator(model, parameters, variant);
  const Eigen::Index columns = ColumnsOf(model, parameters).count;
  Eigen::Matrix3Xd corners(3, vertices);
  RowMatrix corner_rows(3 * vertices, columns), rows(3, columns);
  for (std::size_t m = 0; m < points.size(); ++m) {
    const SurfacePoint& point = points[m];
    if (point.triangle < 0 || point.triangle >= surface.triangles.rows())
      throw Error(fmt::format("foot model: no triangle {}", point.triangle));
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    rows.setZero();
    for (int corner = 0; corner < 3; ++corner) {
      const Eigen::Index i = surface.triangles(point.triangle, corner), block = i / kVertexBlock;
      if (!known[static_cast<std::size_t>(block)]) {
        known[static_cast<std::size_t>(block)] = true;
        const Eigen::Index first = block * kVertexBlock;
        differentiator.Write(first, std::min(kVertexBlock, vertices - first), first, corners,
                             corner_rows);
      }
      position += point.barycentric[corner] * corners.col(i);
      rows += point.barycentric[corner] * corner_rows.middleRows<3>(3 * i);
    }
    visit(static_cast<Eigen::Index>(m), position, rows);
  }
}

PointsJacobian SurfacePointJacobian(const FootModel& model, const ModelParameters& parameters,
                                    Variant variant, std::span<const SurfacePoint> points) {
  const auto count = static_cast<Eigen::Index>(points.size());
  PointsJacobian result;
  result.points_m.resize(count, 3);
  result.jacobian.resize(3 * count, ColumnsOf(model, parameters).count);
  VisitSurfacePoints(model, parameters, variant, points,
                     [&](Eigen::Index m, const Eigen::Vector3d& position, const RowMatrix& rows) {
                       result.points_m.row(m) = position;
                       result.jacobian.middleRows<3>(3 * m) = rows;
                     });
  return result;
}

RowMatrix VertexContactJacobian(const FootModel& model, const ModelParameters& parameters,
                                Variant variant) {
  const ContactFactors factors = TurnedContactFactors(model, parameters, variant);
  if (model.network.empty())
    return RowMatrix::Zero(3 * SurfaceOf(model, variant).NumVertices(), model.NumVertices());
  return factors.outer * factors.inner;
}

RowMatrix SurfacePointContactJacobian(const FootModel& model, const ModelParameters& parameters,
                                      Variant variant, std::span<const SurfacePoint> points) {
  const ContactFactors factors = TurnedContactFactors(model, parameters, variant);
  const ModelSurface& surface = SurfaceOf(model, variant);
  const auto count = static_cast<Eigen::Index>(points.size());
  RowMatrix outer = RowMatrix::Zero(3 * count, factors.outer.cols());
  for (Eigen::Index m = 0; m < count; ++m) {
    const SurfacePoint& point = points[static_cast<std::size_t>(m)];
    if (point.triangle < 0 || point.triangle >= surface.triangles.rows())
      throw Error(fmt::format("foot model: no triangle {}", point.triangle));
    if (model.network.empty()) continue;
    for (int corner = 0; corner < 3; ++corner) {
      outer.middleRows<3>(3 * m) +=
          point.barycentric[corner] *
          factors.outer.middleRows<3>(3 * surface.triangles(point.triangle, corner));
    }
  }
  if (model.network.empty()) return RowMatrix::Zero(3 * count, model.NumVertices());
  return outer * factors.inner;
}

PointsJacobian JointJacobian(const FootModel& model, const ModelParameters& parameters) {
  CheckParameters(model, parameters);
  const PoseDerivative pose = DifferentiatePose(model, parameters);
  const ParameterColumns columns = ColumnsOf(model, parameters);
  const Eigen::Index joints = model.NumJoints();
  PointsJacobian result;
  result.points_m =
      pose.skeleton.joints.transpose().rowwise() + parameters.translation_m.transpose();
  result.jacobian = RowMatrix::Zero(3 * joints, columns.count);
  for (Eigen::Index j = 0; j < joints; ++j) {
    result.jacobian.block(3 * j, columns.beta, 3, parameters.beta.size()) =
        pose.joint_by_beta[static_cast<std::size_t>(j)];
    result.jacobian.block<3, 3>(3 * j, columns.translation).setIdentity();
    for (int above = model.parents[static_cast<std::size_t>(j)]; above >= 0;
         above = model.parents[static_cast<std::size_t>(above)]) {
      const Eigen::Vector3d arm = pose.skeleton.joints.col(j) - pose.skeleton.joints.col(above);
      result.jacobian.block<3, 3>(3 * j, columns.theta + 3 * above) =
          TurnColumns(pose.turn_axes[static_cast<std::size_t>(above)], arm);
    }
  }
  return result;
}

}  // namespace sole::model
