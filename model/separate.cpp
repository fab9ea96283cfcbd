#include "model/separate.h"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cstddef>

#include "core/error.h"
#include "model/pose_features.h"

namespace sole::model {
namespace {

std::size_t At(Eigen::Index index) { return static_cast<std::size_t>(index); }

/// First pose feature of a joint and their number.
struct FeatureRange {
  Eigen::Index first = 0, count = 0;
};

FeatureRange FeaturesOf(Family family, Eigen::Index joint) {
  if (family == Family::kSupr) return {4 * joint, 4};
  if (joint == 0) return {};
  return family == Family::kStar ? FeatureRange{4 * (joint - 1), 4}
                                 : FeatureRange{9 * (joint - 1), 9};
}

/// Rows 3 i + axis of the listed vertices.
Eigen::MatrixXd StackedRows(const Eigen::MatrixXd& stacked, std::span<const int> vertices) {
  Eigen::MatrixXd rows(3 * static_cast<Eigen::Index>(vertices.size()), stacked.cols());
  for (std::size_t i = 0; i < vertices.size(); ++i)
    rows.middleRows<3>(3 * static_cast<Eigen::Index>(i)) = stacked.middleRows<3>(3 * vertices[i]);
  return rows;
}

void CheckVertices(const FootModel& model, std::span<const int> vertices) {
  Require(!vertices.empty(), "body part: no vertices are given");
  std::vector<char> seen(At(model.NumVertices()), 0);
  for (const int v : vertices) {
    Require(
        v >= 0 && v < model.NumVertices(),
        fmt::format("body part: vertex {} is not one of the model's {}", v, model.NumVertices()));
    Require(!seen[At(v)], fmt::format("body part: vertex {} is named twice", v));
    seen[At(v)] = 1;
  }
}

bool Moves(const FootModel& model, const Eigen::MatrixXd& posedirs, std::span<const int> vertices,
           Eigen::Index joint) {
  const bool weighted = std::any_of(vertices.begin(), vertices.end(), [&](int v) {
    return model.coarse.weights(v, joint) != 0 ||
           (model.activations.size() > 0 && model.activations(v, joint) > 0);
  });
  if (weighted || posedirs.cols() == 0) return weighted;
  const FeatureRange features = FeaturesOf(model.family, joint);
  return !posedirs.middleCols(features.first, features.count).isZero(0);
}

/// Nearest joint at or above `joint` that is kept; -1 if none.
int NearestKept(const FootModel& model, const std::vector<char>& kept, int joint) {
  while (joint >= 0 && !kept[At(joint)]) joint = model.parents[At(joint)];
  return joint;
}

/// Keeps the nearest joint below which all kept ones hang.
void KeepCommonRoot(const FootModel& model, std::vector<char>& kept) {
  if (model.family != Family::kSupr) kept[0] = 1;
  std::vector<int> below(kept.begin(), kept.end());
  for (std::size_t j = kept.size(); j-- > 1;) below[At(model.parents[j])] += below[j];
  const auto all = std::count(kept.begin(), kept.end(), 1);
  for (std::size_t j = kept.size(); j-- > 0;) {
    if (below[j] != all) continue;  // parents come before children: the first is the deepest
    kept[j] = 1;
    return;
  }
}

std::vector<int> KeptJoints(const FootModel& model, const Eigen::MatrixXd& posedirs,
                            std::span<const int> vertices) {
  std::vector<char> kept(model.parents.size(), 0);
  for (Eigen::Index j = 0; j < model.NumJoints(); ++j)
    kept[At(j)] = Moves(model, posedirs, vertices, j);
  KeepCommonRoot(model, kept);
  std::vector<int> joints;
  for (std::size_t j = 0; j < kept.size(); ++j) {
    if (kept[j]) joints.push_back(static_cast<int>(j));
  }
  return joints;
}

void SliceTree(const FootModel& model, const std::vector<int>& joints, FootModel& part) {
  std::vector<char> kept(model.parents.size(), 0);
  std::vector<int> place(model.parents.size(), -1);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    kept[At(joints[j])] = 1;
    place[At(joints[j])] = static_cast<int>(j);
  }
  int next = 0;
  if (model.pose_index.rows() > 0)
    part.pose_index.resize(static_cast<Eigen::Index>(joints.size()), 3);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const std::size_t whole = At(joints[j]);
    const int parent = NearestKept(model, kept, model.parents[whole]);
    part.parents.push_back(parent < 0 ? -1 : place[At(parent)]);
    if (!model.joint_names.empty()) part.joint_names.push_back(model.joint_names[whole]);
    if (!model.constraints.empty()) part.constraints.push_back(model.constraints[whole]);
    for (int i = 0; i < 3 && model.pose_index.rows() > 0; ++i) {
      const bool used = model.pose_index(joints[j], i) >= 0;
      part.pose_index(static_cast<Eigen::Index>(j), i) = used ? next++ : -1;
    }
  }
}

void SliceTriangles(const FootModel& model, std::span<const int> vertices, FootModel& part) {
  std::vector<int> place(At(model.NumVertices()), -1);
  for (std::size_t i = 0; i < vertices.size(); ++i) place[At(vertices[i])] = static_cast<int>(i);
  const Eigen::MatrixX3i& triangles = model.coarse.triangles;
  part.coarse.triangles.resize(triangles.rows(), 3);
  Eigen::Index count = 0;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Eigen::Vector3i moved(place[At(triangles(t, 0))], place[At(triangles(t, 1))],
                                place[At(triangles(t, 2))]);
    if ((moved.array() >= 0).all()) part.coarse.triangles.row(count++) = moved;
  }
  part.coarse.triangles.conservativeResize(count, 3);
  for (const Landmark& landmark : model.landmarks) {
    const int vertex = place[At(landmark.vertex)];
    if (vertex >= 0) part.landmarks.push_back({landmark.name, vertex});
  }
}

void SliceCorrectives(const FootModel& model, const Eigen::MatrixXd& posedirs,
                      const std::vector<int>& joints, FootModel& part) {
  if (posedirs.cols() == 0) return;
  const auto k = static_cast<Eigen::Index>(joints.size());
  part.coarse.posedirs.setZero(posedirs.rows(), NumPoseFeatures(model.family, k));
  for (Eigen::Index j = 0; j < k; ++j) {
    const FeatureRange from = FeaturesOf(model.family, joints[At(j)]),
                       to = FeaturesOf(model.family, j);
    part.coarse.posedirs.middleCols(to.first, to.count) = posedirs.middleCols(from.first, to.count);
  }
  if (model.family == Family::kStar) part.coarse.posedirs.rightCols<1>() = posedirs.rightCols<1>();
}

/// Fills the joint regressor from the whole's joints; returns its largest error, m per unit of
/// beta.
double LearnRegressor(const FootModel& model, const std::vector<int>& joints, FootModel& part) {
  const Eigen::MatrixXd directions = StackedRows(model.derived.joint_shapedirs, joints);
  const Eigen::MatrixXd& shapes = part.coarse.shapedirs;
  const Eigen::Index rows = directions.rows(), coordinates = 3 * part.NumVertices();
  part.joint_regressor.setZero(rows, coordinates + 1);
  // The smallest A with A S = J_S: transposed, S' A' = J_S'.
  if (shapes.cols() > 0) {
    part.joint_regressor.leftCols(coordinates) = shapes.transpose()
                                                     .completeOrthogonalDecomposition()
                                                     .solve(directions.transpose())
                                                     .transpose();
  }
  const Eigen::Matrix3Xd rest = part.coarse.template_m.transpose();
  Eigen::Matrix3Xd wanted(3, rows / 3);
  for (Eigen::Index j = 0; j < wanted.cols(); ++j)
    wanted.col(j) = model.derived.joints_m.row(joints[At(j)]);
  const auto regressor = part.joint_regressor.leftCols(coordinates);
  const Eigen::VectorXd offset =
      Eigen::Map<const Eigen::VectorXd>(wanted.data(), rows) -
      regressor * Eigen::Map<const Eigen::VectorXd>(rest.data(), coordinates);
  part.joint_regressor.col(coordinates) = offset;
  if (shapes.cols() == 0) return 0;
  return (regressor * shapes - directions).cwiseAbs().maxCoeff();
}

}  // namespace

SeparatedPart SeparatePart(const FootModel& model, std::span<const int> vertices) {
  CheckVertices(model, vertices);
  SeparatedPart result;
  result.vertices.assign(vertices.begin(), vertices.end());
  const Eigen::MatrixXd posedirs =
      StackedRows(model.coarse.posedirs.cols() > 0 ? model.coarse.posedirs
                                                   : Eigen::MatrixXd(3 * model.NumVertices(), 0),
                  vertices);
  result.joints = KeptJoints(model, posedirs, vertices);
  FootModel& part = result.model;
  part.family = model.family;
  part.side = model.side;
  part.licence = model.licence;
  part.mirror_axis = model.mirror_axis;
  SliceTree(model, result.joints, part);
  SliceTriangles(model, vertices, part);
  part.coarse.template_m = model.coarse.template_m(result.vertices, Eigen::all);
  part.coarse.weights = model.coarse.weights(result.vertices, result.joints);
  part.coarse.shapedirs = StackedRows(model.coarse.shapedirs, vertices);
  SliceCorrectives(model, posedirs, result.joints, part);
  if (model.activations.size() > 0)
    part.activations = model.activations(result.vertices, result.joints);
  for (const int v : vertices) {
    if (!model.material.empty()) part.material.push_back(model.material[At(v)]);
  }
  result.joint_error_m = LearnRegressor(model, result.joints, part);
  Prepare(part);
  return result;
}

}  // namespace sole::model
