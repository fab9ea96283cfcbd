#include "sim/subject_shape.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>

#include "sim/reference_codec.h"
#include "sim/reference_foot.h"
#include "sim/skin_binding.h"

namespace sole::sim {
namespace {

ReferenceBinding MakeBinding() {
  const TriangleMesh& mesh = ReferenceFoot();
  const ImplicitFoot foot(MeanAdultTable());
  ReferenceBinding binding;
  binding.charts = ToeCharts(foot, mesh);
  binding.shares = ComputeBoneShares(foot, mesh, binding.charts);
  binding.neighbours = VertexNeighbours(mesh.vertices.size(), mesh.triangles);
  const auto cut = [&](int v) {
    return std::abs(mesh.vertices[static_cast<std::size_t>(v)].z() - foot.Table().cut_point.z()) < 2 * kReferenceStep;
  };
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    SkinKind kind = SkinKind::kSkin;
    if (cut(static_cast<int>(v))) {
      const auto& around = binding.neighbours[v];
      kind = std::all_of(around.begin(), around.end(), cut) ? SkinKind::kCap : SkinKind::kRim;
    }
    binding.kinds.push_back(kind);
  }
  return binding;
}

/// Triangles that face away from the skin they should cover.
std::vector<int> FoldedTriangles(const ImplicitFoot& foot, const std::vector<Eigen::Vector3d>& vertices) {
  const ReferenceBinding& binding = Binding();
  const auto& triangles = ReferenceFoot().triangles;
  const auto at = [&](int v) -> const Eigen::Vector3d& { return vertices[static_cast<std::size_t>(v)]; };
  std::vector<Eigen::Vector3d> face(triangles.size()), vertex(vertices.size(), Eigen::Vector3d::Zero());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const Eigen::Vector3i& i = triangles[t];
    face[t] = (at(i[1]) - at(i[0])).cross(at(i[2]) - at(i[0]));
    for (const int v : i) vertex[static_cast<std::size_t>(v)] += face[t];
  }
  std::vector<int> folded;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const Eigen::Vector3i& i = triangles[t];
    bool suspicious = false, skin = true;
    for (const int v : i) {
      const Eigen::Vector3d& n = vertex[static_cast<std::size_t>(v)];
      suspicious = suspicious || face[t].dot(n) < 0.4 * face[t].norm() * n.norm();
      skin = skin && binding.kinds[static_cast<std::size_t>(v)] == SkinKind::kSkin;
    }
    if (!suspicious || !skin) continue;
    const Eigen::Vector3d middle = (at(i[0]) + at(i[1]) + at(i[2])) / 3;
    const Eigen::Vector3d gradient = foot.Evaluate(middle, binding.charts[static_cast<std::size_t>(i[0])]).gradient;
    if (face[t].dot(gradient) < 0.15 * face[t].norm() * gradient.norm()) folded.push_back(static_cast<int>(t));
  }
  return folded;
}

}  // namespace

const ReferenceBinding& Binding() {
  static const ReferenceBinding binding = MakeBinding();
  return binding;
}

void SettleOnSkin(const ImplicitFoot& foot, std::vector<Eigen::Vector3d>& vertices) {
  const ReferenceBinding& binding = Binding();
  ProjectAllToSkin(foot, binding.kinds, binding.charts, vertices);
  for (int pass = 0; pass < 12; ++pass) {
    const std::vector<int> folded = FoldedTriangles(foot, vertices);
    if (folded.empty()) return;
    std::vector<int> loose;
    for (const int t : folded) {
      for (const int v : ReferenceFoot().triangles[static_cast<std::size_t>(t)]) {
        const auto& around = binding.neighbours[static_cast<std::size_t>(v)];
        loose.push_back(v);
        loose.insert(loose.end(), around.begin(), around.end());
      }
    }
    std::sort(loose.begin(), loose.end());
    loose.erase(std::unique(loose.begin(), loose.end()), loose.end());
    std::vector<Eigen::Vector3d> moved;
    for (const int v : loose) {
      Eigen::Vector3d mean = Eigen::Vector3d::Zero();
      const auto& around = binding.neighbours[static_cast<std::size_t>(v)];
      for (const int n : around) mean += vertices[static_cast<std::size_t>(n)];
      mean /= static_cast<double>(around.size());
      const auto i = static_cast<std::size_t>(v);
      moved.push_back(binding.kinds[i] == SkinKind::kSkin
                          ? ProjectToSkin(foot, 0.4 * vertices[i] + 0.6 * mean, SkinKind::kSkin, binding.charts[i])
                          : vertices[i]);
    }
    for (std::size_t i = 0; i < loose.size(); ++i) vertices[static_cast<std::size_t>(loose[i])] = moved[i];
  }
}

SubjectShape MakeShape(const ShapeHandles& handles) {
  SubjectShape shape;
  shape.handles = handles;
  shape.table = ShapedTable(MeanAdultTable(), handles);
  shape.rest = ShapedPoints(MeanAdultTable(), handles, Binding().shares, ReferenceFoot().vertices);
  SettleOnSkin(ImplicitFoot(shape.table), shape.rest);
  return shape;
}

Eigen::Vector3d Mirrored(const Eigen::Vector3d& point) { return {-point.x(), point.y(), point.z()}; }

Rigid3 Mirrored(const Rigid3& motion) {
  const Eigen::Quaterniond& q = motion.rotation;
  return {Eigen::Quaterniond(q.w(), q.x(), -q.y(), -q.z()), Mirrored(motion.translation)};
}

}  // namespace sole::sim
