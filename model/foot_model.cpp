#include "model/foot_model.h"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>

#include "core/error.h"
#include "model/contact_network.h"
#include "model/pose_features.h"

namespace sole::model {
namespace {

void CheckSize(Eigen::Index actual, Eigen::Index wanted, const char* what) {
  Require(actual == wanted,
          fmt::format("foot model: {} is {}, expected {}; the file is damaged or of another model",
                      what, actual, wanted));
}

void CheckTriangles(const ModelSurface& surface, const std::string& name) {
  const Eigen::Index n = surface.NumVertices();
  for (Eigen::Index t = 0; t < surface.triangles.rows(); ++t) {
    for (int corner = 0; corner < 3; ++corner) {
      const int vertex = surface.triangles(t, corner);
      Require(vertex >= 0 && vertex < n,
              fmt::format("foot model: {} triangle {} names vertex {} of {}", name, t, vertex, n));
    }
  }
}

void CheckSurface(const ModelSurface& surface, const FootModel& model, const std::string& name) {
  const Eigen::Index n = surface.NumVertices();
  CheckTriangles(surface, name);
  CheckSize(surface.weights.rows(), n, (name + " weights' number of rows").c_str());
  CheckSize(surface.weights.cols(), model.NumJoints(),
            (name + " weights' number of columns").c_str());
  CheckSize(surface.shapedirs.rows(), 3 * n, (name + " shapedirs' number of coordinates").c_str());
  CheckSize(surface.shapedirs.cols(), model.NumBetas(),
            (name + " shapedirs' number of shapes").c_str());
  if (surface.posedirs.cols() > 0) {
    CheckSize(surface.posedirs.rows(), 3 * n, (name + " posedirs' number of coordinates").c_str());
    CheckSize(surface.posedirs.cols(), NumPoseFeatures(model.family, model.NumJoints()),
              (name + " posedirs' number of features").c_str());
  }
  const double finite = surface.template_m.sum() + surface.weights.sum() + surface.shapedirs.sum() +
                        surface.posedirs.sum();
  Require(std::isfinite(finite),
          "foot model: " + name + " surface holds values that are not numbers");
  const double worst = n == 0 ? 0 : (surface.weights.rowwise().sum().array() - 1).abs().maxCoeff();
  Require(
      worst < 1e-3,
      fmt::format("foot model: {} weights of a vertex sum to 1 {:+.3g}, expected 1", name, worst));
}

void CheckTree(const FootModel& model) {
  Require(!model.parents.empty() && model.parents[0] == -1, "foot model: joint 0 is not the root");
  for (std::size_t j = 1; j < model.parents.size(); ++j) {
    Require(model.parents[j] >= 0 && model.parents[j] < static_cast<int>(j),
            fmt::format("foot model: parent {} of joint {} does not come before it",
                        model.parents[j], j));
  }
  if (!model.joint_names.empty()) {
    CheckSize(static_cast<Eigen::Index>(model.joint_names.size()), model.NumJoints(),
              "number of joint names");
  }
}

void CheckConstraints(const FootModel& model) {
  if (model.pose_index.rows() > 0) {
    CheckSize(model.pose_index.rows(), model.NumJoints(), "pose index's number of rows");
    Require(model.pose_index.maxCoeff() < 3 * model.NumJoints(),
            "foot model: its pose index names more values than its joints have");
  }
  if (model.constraints.empty()) return;
  CheckSize(static_cast<Eigen::Index>(model.constraints.size()), model.NumJoints(),
            "number of joint constraints");
  Require(model.family == Family::kSupr && model.network.empty(),
          "foot model: hinges are known for SUPR models without a contact network only");
  for (const JointConstraint& constraint : model.constraints) {
    Require(constraint.axes.size() <= 2, "foot model: a joint has more than two axes");
    for (const Eigen::Vector3d& axis : constraint.axes) {
      Require(std::abs(axis.norm() - 1) < 1e-3,
              fmt::format("foot model: a hinge's axis has length {:.4g}, expected 1", axis.norm()));
    }
  }
}

void CheckUpsampling(const FootModel& model) {
  if (!model.HasFine()) return;
  Require(model.fine.NumVertices() >= model.NumVertices(),
          "foot model: fine variant has fewer vertices than the coarse");
  if (model.upsampling.empty() && model.network.empty()) return;
  CheckSize(static_cast<Eigen::Index>(model.upsampling.size()), model.fine.NumVertices(),
            "number of upsampling rows");
  for (const UpsamplingRow& row : model.upsampling) {
    for (const auto& [vertex, weight] : row) {
      Require(
          vertex >= 0 && vertex < model.NumVertices() && std::isfinite(weight),
          fmt::format("foot model: upsampling names vertex {} of {}", vertex, model.NumVertices()));
    }
  }
}

void CheckRegressor(const FootModel& model) {
  const Eigen::Index k = model.NumJoints(), n = model.NumVertices();
  const Eigen::MatrixXd& regressor = model.joint_regressor;
  const bool sparse = regressor.rows() == k && regressor.cols() == n;
  const bool affine = regressor.rows() == 3 * k && regressor.cols() == 3 * n + 1;
  Require(sparse || affine,
          fmt::format("foot model: J_regressor is {} x {}, expected {} x {} or {} x {}",
                      regressor.rows(), regressor.cols(), k, n, 3 * k, 3 * n + 1));
  Require(regressor.allFinite(), "foot model: J_regressor holds values that are not numbers");
}

void CheckPoseSpace(const FootModel& model) {
  const PoseSpace& space = model.pose_space;
  if (space.Empty()) return;
  const Eigen::Index values = 3 * (model.NumJoints() - 1), c = space.components.cols(),
                     gaussians = space.weights.size();
  CheckSize(space.mean.size(), values, "pose space's number of values");
  CheckSize(space.components.rows(), values, "pose space's number of values a component");
  CheckSize(space.variances.size(), values, "pose space's number of variances");
  CheckSize(space.means.rows(), gaussians, "pose space's number of means");
  CheckSize(space.means.cols(), c, "pose space's number of components");
  CheckSize(space.covariances.rows(), gaussians, "pose space's number of covariances");
  CheckSize(space.covariances.cols(), c * c, "pose space's size of a covariance");
}

void CheckOthers(const FootModel& model) {
  const Eigen::Index n = model.NumVertices();
  Require(model.mirror_axis >= 0 && model.mirror_axis < 3,
          fmt::format("foot model: mirror axis {} is not 0, 1 or 2", model.mirror_axis));
  if (model.activations.size() > 0) {
    CheckSize(model.activations.rows(), n, "activations' number of rows");
    CheckSize(model.activations.cols(), model.NumJoints(), "activations' number of columns");
  }
  if (!model.material.empty())
    CheckSize(static_cast<Eigen::Index>(model.material.size()), n, "number of material points");
  for (const Landmark& landmark : model.landmarks) {
    Require(landmark.vertex >= 0 && landmark.vertex < n,
            fmt::format("foot model: landmark '{}' names vertex {} of {}", landmark.name,
                        landmark.vertex, n));
  }
  CheckPoseSpace(model);
  if (model.network.empty()) return;
  KindOfNetwork(model);
  CheckSize(model.network.back().weight.rows(), 3 * n, "network's number of outputs");
  for (std::size_t l = 0; l < model.network.size(); ++l) {
    CheckSize(model.network[l].bias.size(), model.network[l].weight.rows(), "network layer's bias");
    if (l > 0)
      CheckSize(model.network[l].weight.cols(), model.network[l - 1].weight.rows(),
                "network layer's number of inputs");
  }
}

DerivedModelData::Influences InfluencesFrom(const Eigen::MatrixXd& weights) {
  DerivedModelData::Influences influences;
  influences.start.push_back(0);
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    for (Eigen::Index j = 0; j < weights.cols(); ++j) {
      if (weights(i, j) == 0) continue;
      influences.joint.push_back(static_cast<int>(j));
      influences.weight.push_back(weights(i, j));
    }
    influences.start.push_back(static_cast<int>(influences.joint.size()));
  }
  return influences;
}

std::vector<unsigned char> CorrectedJoints(const ModelSurface& surface, Family family,
                                           Eigen::Index joints) {
  std::vector<unsigned char> corrected(static_cast<std::size_t>(surface.NumVertices() * joints), 0);
  if (surface.posedirs.cols() == 0) return corrected;
  const Eigen::Index size = family == Family::kSmpl ? 9 : 4,
                     first = family == Family::kSupr ? 0 : 1;
  for (Eigen::Index i = 0; i < surface.NumVertices(); ++i) {
    for (Eigen::Index j = first; j < joints; ++j) {
      corrected[static_cast<std::size_t>(i * joints + j)] =
          (surface.posedirs.block(3 * i, size * (j - first), 3, size).array() != 0).any() ? 1 : 0;
    }
  }
  return corrected;
}

/// In single precision; empty where a value changes by that.
Eigen::MatrixXf SingleIfExact(const Eigen::MatrixXd& values) {
  Eigen::MatrixXf single = values.cast<float>();
  if (single.cast<double>() != values) single.resize(0, 0);
  return single;
}

/// Joints (stacked, 3K) of stacked vertex coordinates (3N x M); `offset` = 1 for positions, 0 for
/// differences.
Eigen::MatrixXd RegressJoints(const FootModel& model, const Eigen::MatrixXd& stacked,
                              double offset) {
  const Eigen::Index k = model.NumJoints(), n = model.NumVertices();
  if (model.joint_regressor.cols() == 3 * n + 1) {
    Eigen::MatrixXd joints = model.joint_regressor.leftCols(3 * n) * stacked;
    joints.colwise() += offset * model.joint_regressor.col(3 * n);
    return joints;
  }
  Eigen::MatrixXd joints(3 * k, stacked.cols());
  for (Eigen::Index m = 0; m < stacked.cols(); ++m) {
    const Eigen::Map<const Eigen::Matrix3Xd> positions(stacked.col(m).data(), 3, n);
    Eigen::Map<Eigen::Matrix3Xd>(joints.col(m).data(), 3, k) =
        positions * model.joint_regressor.transpose();
  }
  return joints;
}

}  // namespace

void Prepare(FootModel& model) {
  CheckTree(model);
  CheckConstraints(model);
  CheckSurface(model.coarse, model, "coarse");
  if (model.HasFine()) CheckSurface(model.fine, model, "fine");
  CheckUpsampling(model);
  CheckRegressor(model);
  CheckOthers(model);
  const Eigen::Index k = model.NumJoints(), n = model.NumVertices();
  const Eigen::Matrix3Xd positions = model.coarse.template_m.transpose();
  const Eigen::MatrixXd joints =
      RegressJoints(model, Eigen::Map<const Eigen::VectorXd>(positions.data(), 3 * n), 1);
  model.derived.joints_m = Eigen::Map<const Eigen::Matrix3Xd>(joints.data(), 3, k).transpose();
  model.derived.joint_shapedirs = RegressJoints(model, model.coarse.shapedirs, 0);
  model.derived.coarse = InfluencesFrom(model.coarse.weights);
  model.derived.fine = InfluencesFrom(model.fine.weights);
  model.derived.coarse_corrected = CorrectedJoints(model.coarse, model.family, k);
  model.derived.fine_corrected = CorrectedJoints(model.fine, model.family, k);
  model.derived.coarse_single = {SingleIfExact(model.coarse.shapedirs),
                                 SingleIfExact(model.coarse.posedirs)};
  model.derived.fine_single = {SingleIfExact(model.fine.shapedirs),
                               SingleIfExact(model.fine.posedirs)};
  model.derived.network_single.clear();
  for (const NetworkLayer& layer : model.network)
    model.derived.network_single.push_back(SingleIfExact(layer.weight));
}

const ModelSurface& SurfaceOf(const FootModel& model, Variant variant) {
  if (variant == Variant::kCoarse) return model.coarse;
  Require(model.HasFine(), "foot model: it has no fine variant");
  return model.fine;
}

const DerivedModelData::Influences& InfluencesOf(const FootModel& model, Variant variant) {
  return variant == Variant::kCoarse ? model.derived.coarse : model.derived.fine;
}

const DerivedModelData::SingleSurface& SingleSurfaceOf(const FootModel& model, Variant variant) {
  return variant == Variant::kCoarse ? model.derived.coarse_single : model.derived.fine_single;
}

TriangleMesh TemplateMesh(const FootModel& model, Variant variant) {
  return MeshOf(model, variant, SurfaceOf(model, variant).template_m);
}

TriangleMesh MeshOf(const FootModel& model, Variant variant, const Eigen::MatrixX3d& vertices_m) {
  const ModelSurface& surface = SurfaceOf(model, variant);
  Require(vertices_m.rows() == surface.NumVertices(),
          fmt::format("foot model: {} vertices given for a surface of {}", vertices_m.rows(),
                      surface.NumVertices()));
  TriangleMesh mesh;
  for (Eigen::Index i = 0; i < vertices_m.rows(); ++i)
    mesh.vertices.emplace_back(vertices_m.row(i));
  for (Eigen::Index t = 0; t < surface.triangles.rows(); ++t)
    mesh.triangles.emplace_back(surface.triangles.row(t));
  return mesh;
}

}  // namespace sole::model
