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
      : model_(model),
        parameters_(parameters),
        surface_(SurfaceOf(model, variant)),
        influences_(InfluencesOf(model, variant)),
        corrected_(variant == Variant::kCoarse ? model.derived.coarse_corrected
                                               : model.derived.fine_corrected),
        columns_(ColumnsOf(model, parameters)),
        pose_(DifferentiatePose(model, parameters)),
        rest_(RestVertices(model, parameters, variant)),
        network_(ContactOffsetsJacobian(model, variant, parameters.theta, parameters.beta,
                                        parameters.contact)),
        moments_(model.parents.size()),
        masses_(model.parents.size()) {}

  /// Position of vertex i; its derivative goes to rows `row` .. `row` + 2 of `jacobian`, zero on
  /// entry.
  Eigen::Vector3d Write(Eigen::Index i, Eigen::Index row, RowMatrix& jacobian) {
    const Eigen::Vector3d point = rest_.row(i);
    std::fill(moments_.begin(), moments_.end(), Eigen::Vector3d::Zero());
    std::fill(masses_.begin(), masses_.end(), 0.0);
    Eigen::Matrix3d blended = Eigen::Matrix3d::Zero();
    const Eigen::Index betas = parameters_.beta.size();
    auto by_beta = jacobian.block(row, columns_.beta, 3, betas);
    const auto at = static_cast<std::size_t>(i);
    for (auto e = static_cast<std::size_t>(influences_.start[at]);
         e < static_cast<std::size_t>(influences_.start[at + 1]); ++e) {
      const auto joint = static_cast<std::size_t>(influences_.joint[e]);
      const double weight = influences_.weight[e];
      moments_[joint] = weight * (pose_.skeleton.rotations[joint] * point +
                                  pose_.skeleton.offsets.col(influences_.joint[e]));
      masses_[joint] = weight;
      blended += weight * pose_.skeleton.rotations[joint];
      by_beta += weight * pose_.offset_by_beta[joint];
    }
    by_beta.noalias() += blended * surface_.shapedirs.block(3 * i, 0, 3, betas);
    jacobian.block<3, 3>(row, columns_.translation).setIdentity();
    AccumulateTurns(row, jacobian);
    AddOffsets(i, row, blended, jacobian);
    return moments_[0] + parameters_.translation_m;
  }

 private:
  /// Carries each bone's share to its ancestors: a joint turns all that hangs below it.
  void AccumulateTurns(Eigen::Index row, RowMatrix& jacobian) {
    for (std::size_t j = masses_.size(); j-- > 0;) {
      if (masses_[j] == 0) continue;
      const auto column = static_cast<Eigen::Index>(j);
      const Eigen::Vector3d arm = moments_[j] - masses_[j] * pose_.skeleton.joints.col(column);
      jacobian.block<3, 3>(row, columns_.theta + 3 * column) = TurnColumns(pose_.turn_axes[j], arm);
      if (model_.parents[j] < 0) continue;
      const auto parent = static_cast<std::size_t>(model_.parents[j]);
      moments_[parent] += moments_[j];
      masses_[parent] += masses_[j];
    }
  }

  /// Pose correctives and network, turned by the vertex's blended rotation.
  void AddOffsets(Eigen::Index i, Eigen::Index row, const Eigen::Matrix3d& blended,
                  RowMatrix& jacobian) {
    if (surface_.posedirs.cols() > 0) {
      for (std::size_t j = 0; j < masses_.size(); ++j) {
        const FeatureBlock& block = pose_.features[j];
        if (!corrected_[static_cast<std::size_t>(i) * masses_.size() + j]) continue;
        const auto directions =
            surface_.posedirs.block(3 * i, block.first, 3, block.jacobian.rows());
        jacobian.block<3, 3>(row, columns_.theta + 3 * static_cast<Eigen::Index>(j)) +=
            blended * (directions * block.jacobian);
      }
      if (model_.family == Family::kStar && parameters_.beta.size() > 1) {
        jacobian.block<3, 1>(row, columns_.beta + 1) +=
            blended * surface_.posedirs.block<3, 1>(3 * i, surface_.posedirs.cols() - 1);
      }
    }
    if (network_.cols() == 0) return;
    // Columns theta then beta, adjacent in both layouts.
    jacobian.block(row, columns_.theta, 3, network_.cols()) +=
        blended * network_.middleRows<3>(3 * i);
  }

  const FootModel& model_;
  const ModelParameters& parameters_;
  const ModelSurface& surface_;
  const DerivedModelData::Influences& influences_;
  const std::vector<bool>& corrected_;
  ParameterColumns columns_;
  PoseDerivative pose_;
  Eigen::MatrixX3d rest_;
  Eigen::MatrixXd network_;
  std::vector<Eigen::Vector3d> moments_;
  std::vector<double> masses_;
};

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
  result.jacobian = RowMatrix::Zero(3 * count, ColumnsOf(model, parameters).count);
  for (Eigen::Index m = 0; m < count; ++m) {
    const int vertex = vertices[static_cast<std::size_t>(m)];
    Require(vertex >= 0 && vertex < SurfaceOf(model, variant).NumVertices(),
            fmt::format("foot model: no vertex {}", vertex));
    result.points_m.row(m) = differentiator.Write(vertex, 3 * m, result.jacobian);
  }
  return result;
}

PointsJacobian SurfacePointJacobian(const FootModel& model, const ModelParameters& parameters,
                                    Variant variant, std::span<const SurfacePoint> points) {
  CheckParameters(model, parameters);
  const ModelSurface& surface = SurfaceOf(model, variant);
  VertexDifferentiator differentiator(model, parameters, variant);
  const Eigen::Index columns = ColumnsOf(model, parameters).count;
  const auto count = static_cast<Eigen::Index>(points.size());
  PointsJacobian result;
  result.points_m = Eigen::MatrixX3d::Zero(count, 3);
  result.jacobian = RowMatrix::Zero(3 * count, columns);
  RowMatrix corner_rows(3, columns);
  for (Eigen::Index m = 0; m < count; ++m) {
    const SurfacePoint& point = points[static_cast<std::size_t>(m)];
    Require(point.triangle >= 0 && point.triangle < surface.triangles.rows(),
            fmt::format("foot model: no triangle {}", point.triangle));
    for (int corner = 0; corner < 3; ++corner) {
      corner_rows.setZero();
      const Eigen::Vector3d position =
          differentiator.Write(surface.triangles(point.triangle, corner), 0, corner_rows);
      result.points_m.row(m) += point.barycentric[corner] * position.transpose();
      result.jacobian.middleRows<3>(3 * m) += point.barycentric[corner] * corner_rows;
    }
  }
  return result;
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
