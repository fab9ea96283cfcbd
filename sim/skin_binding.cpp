#include "sim/skin_binding.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <tbb/parallel_for.h>

namespace sole::sim {
namespace {

/// Softness of ownership: a primitive this much deeper than the nearest one pulls 1/e as strongly.
constexpr double kSoftness = 0.003;
constexpr int kSmoothing = 25;

/// Position of `point` along the primitive: share of bone_b.
double ShareOfB(const FleshPrimitive& primitive, const Eigen::Vector3d& point) {
  if (primitive.bone_a == primitive.bone_b) return 0;
  if (!primitive.is_cone) return 0.5;
  const Eigen::Vector3d along = primitive.b - primitive.a;
  return std::clamp((point - primitive.a).dot(along) / along.squaredNorm(), 0.0, 1.0);
}

void SharesAt(const ImplicitFoot& foot, const Eigen::Vector3d& point, int chart, Eigen::MatrixXf& shares,
              Eigen::Index row) {
  const auto& primitives = foot.Table().primitives;
  std::vector<double> distance(primitives.size(), 1);
  double nearest = 1;
  for (std::size_t i = 0; i < primitives.size(); ++i) {
    const int group = primitives[i].group;
    if (group != kBodyGroup && group != chart) continue;
    distance[i] = foot.PrimitiveDistance(i, point).value;
    nearest = std::min(nearest, distance[i]);
  }
  double sum = 0;
  for (std::size_t i = 0; i < primitives.size(); ++i) {
    const double weight = std::exp(-(distance[i] - nearest) / kSoftness);
    if (weight < 1e-4) continue;
    const double b = ShareOfB(primitives[i], point);
    shares(row, primitives[i].bone_a) += static_cast<float>(weight * (1 - b));
    shares(row, primitives[i].bone_b) += static_cast<float>(weight * b);
    sum += weight;
  }
  shares.row(row) /= static_cast<float>(sum);
}

}  // namespace

std::vector<std::uint8_t> ToeCharts(const ImplicitFoot& foot, const TriangleMesh& mesh) {
  std::vector<std::uint8_t> charts(mesh.vertices.size(), 0);
  tbb::parallel_for(std::size_t{0}, charts.size(), [&](std::size_t v) {
    const std::array<double, kNumGroups> distance = foot.GroupDistances(mesh.vertices[v]);
    const auto toe = std::min_element(distance.begin() + 1, distance.end());
    if (*toe < distance[kBodyGroup] + 0.006) charts[v] = static_cast<std::uint8_t>(toe - distance.begin());
  });
  return charts;
}

std::vector<std::vector<int>> VertexNeighbours(std::size_t vertices, const std::vector<Eigen::Vector3i>& triangles) {
  std::vector<std::vector<int>> neighbours(vertices);
  for (const Eigen::Vector3i& t : triangles) {
    for (int i = 0; i < 3; ++i) neighbours[static_cast<std::size_t>(t[i])].push_back(t[(i + 1) % 3]);
  }
  for (std::vector<int>& list : neighbours) std::sort(list.begin(), list.end());
  return neighbours;
}

Eigen::MatrixXf ComputeBoneShares(const ImplicitFoot& foot, const TriangleMesh& mesh,
                                  const std::vector<std::uint8_t>& charts) {
  const auto rows = static_cast<Eigen::Index>(mesh.vertices.size());
  Eigen::MatrixXf shares = Eigen::MatrixXf::Zero(rows, static_cast<Eigen::Index>(foot.Table().bones.size()));
  tbb::parallel_for(Eigen::Index{0}, rows, [&](Eigen::Index v) {
    SharesAt(foot, mesh.vertices[static_cast<std::size_t>(v)], charts[static_cast<std::size_t>(v)], shares, v);
  });
  const auto neighbours = VertexNeighbours(mesh.vertices.size(), mesh.triangles);
  tbb::parallel_for(Eigen::Index{0}, shares.cols(), [&](Eigen::Index bone) {
    Eigen::VectorXf now = shares.col(bone), next(rows);
    if (now.maxCoeff() <= 0) return;
    for (int pass = 0; pass < kSmoothing; ++pass) {
      for (Eigen::Index v = 0; v < rows; ++v) {
        const auto& around = neighbours[static_cast<std::size_t>(v)];
        float sum = 0;
        for (const int n : around) sum += now[n];
        next[v] = 0.3F * now[v] + 0.7F * sum / static_cast<float>(around.size());
      }
      now.swap(next);
    }
    shares.col(bone) = now;
  });
  const Eigen::VectorXf sums = shares.rowwise().sum();
  return sums.cwiseInverse().asDiagonal() * shares;
}

std::vector<Eigen::Vector3d> CarriedByBones(const std::vector<Eigen::Vector3d>& points, const Eigen::MatrixXf& shares,
                                            const std::vector<Rigid3>& motions) {
  std::vector<Eigen::Vector3d> carried(points.size());
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t v) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t b = 0; b < motions.size(); ++b) {
      const float share = shares(static_cast<Eigen::Index>(v), static_cast<Eigen::Index>(b));
      if (share > 1e-5F) sum += static_cast<double>(share) * (motions[b] * points[v]);
    }
    carried[v] = sum;
  });
  return carried;
}

}  // namespace sole::sim
