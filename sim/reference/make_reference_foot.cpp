// Makes sim/data/reference_foot.bin: the mean foot's mesh, whose connectivity every simulated foot shares.
//   sole_make_reference_foot OUTPUT
// It meshes the foot with its toes spread, where no cleft is thin, remeshes it to even triangles (fine on the toes),
// brings the toes back and projects the vertices to the mean foot's skin.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <numeric>
#include <string>

#include "core/error.h"
#include "sim/foot_kinematics.h"
#include "sim/reference/remesh.h"
#include "sim/reference_codec.h"
#include "sim/skin_binding.h"
#include "sim/skin_projection.h"

namespace {

using namespace sole;
using namespace sole::sim;
using Eigen::Vector3d;

constexpr double kCell = 0.0008;
constexpr double kToeEdge = 0.00082, kNailEdge = 0.0006, kBodyEdge = 0.0019, kSoleEdge = 0.0016;

/// Angles that fan the toes.
std::map<std::string, double> Spread(double degrees) {
  const double h = degrees * std::numbers::pi / 180;
  return {{"mtp_1.abduction", 0.5 * h}, {"mtp_2.abduction", -0.3 * h}, {"mtp_3.abduction", -0.7 * h},
          {"mtp_4.abduction", -1.1 * h}, {"mtp_5.abduction", -1.5 * h}};
}

double Smooth(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

double EdgeAt(const AnatomyTable& table, const Vector3d& point) {
  double nearest_nail = 1;
  for (const Nail& nail : table.nails) {
    nearest_nail = std::min(nearest_nail, (point - nail.centre).norm() - nail.half_width);
  }
  const double on_toes = Smooth((point.y() + 0.35 * (point.x() + 0.03) - 0.195) / 0.022);
  const double plain = kSoleEdge + (kBodyEdge - kSoleEdge) * Smooth((point.z() - 0.012) / 0.02);
  const double toe = kNailEdge + (kToeEdge - kNailEdge) * Smooth((nearest_nail - 0.001) / 0.004);
  return plain + (toe - plain) * on_toes;
}

int EulerCharacteristic(const LabelledMesh& mesh) {
  return static_cast<int>(mesh.vertices.size()) - static_cast<int>(mesh.triangles.size()) / 2;
}

/// Vertices sorted along the foot, so that differences of neighbours are small.
TriangleMesh Sorted(const TriangleMesh& mesh) {
  std::vector<int> order(mesh.vertices.size()), rank(order.size());
  std::iota(order.begin(), order.end(), 0);
  const auto slab = [&](int v) { return static_cast<int>(mesh.vertices[static_cast<std::size_t>(v)].y() / 0.003); };
  const auto angle = [&](int v) {
    const Vector3d& p = mesh.vertices[static_cast<std::size_t>(v)];
    return std::atan2(p.z() - 0.03, p.x());
  };
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    return slab(a) != slab(b) ? slab(a) < slab(b) : angle(a) != angle(b) ? angle(a) < angle(b) : a < b;
  });
  TriangleMesh sorted;
  for (std::size_t i = 0; i < order.size(); ++i) {
    rank[static_cast<std::size_t>(order[i])] = static_cast<int>(i);
    sorted.vertices.push_back(mesh.vertices[static_cast<std::size_t>(order[i])]);
  }
  for (const Eigen::Vector3i& t : mesh.triangles) {
    sorted.triangles.emplace_back(rank[static_cast<std::size_t>(t[0])], rank[static_cast<std::size_t>(t[1])],
                                  rank[static_cast<std::size_t>(t[2])]);
  }
  return sorted;
}

/// Field for marching, cheap where far from the skin.
std::function<double(const Vector3d&)> BlockedField(const ImplicitFoot& foot) {
  struct Block {
    Eigen::Vector3i id = Eigen::Vector3i::Constant(1 << 30);
    ImplicitFoot::Shortlist shortlist;
    double middle = 0;
  };
  return [&foot, block = Block()](const Vector3d& p) mutable {
    constexpr double kBlock = 0.006;
    const Eigen::Vector3i id = (p / kBlock).array().floor().cast<int>();
    if (id != block.id) {
      block.id = id;
      const Vector3d middle = kBlock * (id.cast<double>() + Vector3d::Constant(0.5));
      foot.MakeShortlist(middle, 0.0055, block.shortlist);
      block.middle = foot.Evaluate(middle).value;
    }
    if (std::abs(block.middle) > 0.016) return block.middle;
    return foot.Evaluate(p, 0, block.shortlist).value;
  };
}

/// Spreads the vertices evenly again where bringing the toes back crowded them.
void EvenOut(const ImplicitFoot& foot, const std::vector<SkinKind>& kinds, TriangleMesh& mesh) {
  const auto neighbours = VertexNeighbours(mesh.vertices.size(), mesh.triangles);
  for (int pass = 0; pass < 12; ++pass) {
    std::vector<Vector3d> moved = mesh.vertices;
    for (std::size_t v = 0; v < moved.size(); ++v) {
      if (kinds[v] != SkinKind::kSkin || moved[v].y() < 0.17) continue;
      Vector3d mean = Vector3d::Zero();
      for (const int n : neighbours[v]) mean += mesh.vertices[static_cast<std::size_t>(n)];
      moved[v] += 0.3 * (mean / static_cast<double>(neighbours[v].size()) - moved[v]);
    }
    mesh.vertices = std::move(moved);
    ProjectAllToSkin(foot, kinds, ToeCharts(foot, mesh), mesh.vertices);
  }
  for (int pass = 0; pass < 4; ++pass) ProjectAllToSkin(foot, kinds, ToeCharts(foot, mesh), mesh.vertices);
}

void Run(const std::string& path) {
  const AnatomyTable& mean = MeanAdultTable();
  const std::vector<Rigid3> motions = BoneMotions(mean, Spread(3));
  AnatomyTable open = MovedTable(mean, motions);
  open.toe_clearance = 0.0009;
  const ImplicitFoot foot(open);
  const Vector3d low(-0.075, -0.02, -0.008), high(0.075, 0.275, mean.cut_point.z());
  LabelledMesh mesh = MarchTetrahedra(BlockedField(foot), low, high, kCell);
  std::printf("marched: %zu vertices, Euler %d\n", mesh.vertices.size(), EulerCharacteristic(mesh));
  const RemeshTarget target{[&](const Vector3d& p) { return EdgeAt(open, p); },
                            [&](const Vector3d& p, SkinKind kind) { return ProjectToSkin(foot, p, kind, 0); }};
  mesh = Remesh(mesh, target, 8);
  std::printf("remeshed: %zu vertices, Euler %d\n", mesh.vertices.size(), EulerCharacteristic(mesh));
  Require(EulerCharacteristic(mesh) == 2, "the reference foot is not a closed simple surface");

  TriangleMesh result{mesh.vertices, mesh.triangles};
  const std::vector<std::uint8_t> charts = ToeCharts(foot, result);
  const Eigen::MatrixXf shares = ComputeBoneShares(foot, result, charts);
  std::vector<Rigid3> back;
  for (const Rigid3& motion : motions) back.push_back(motion.Inverse());
  result.vertices = CarriedByBones(result.vertices, shares, back);
  std::vector<SkinKind> kinds(result.vertices.size(), SkinKind::kSkin);
  std::vector<bool> skin(kinds.size(), false);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const int v : mesh.triangles[t]) {
      const auto i = static_cast<std::size_t>(v);
      if (mesh.labels[t] == 0) skin[i] = true;
      else kinds[i] = SkinKind::kCap;
    }
  }
  for (std::size_t v = 0; v < kinds.size(); ++v) {
    if (skin[v] && kinds[v] == SkinKind::kCap) kinds[v] = SkinKind::kRim;
  }
  const ImplicitFoot closed(mean);
  ProjectAllToSkin(closed, kinds, charts, result.vertices);
  EvenOut(closed, kinds, result);
  const std::string bytes = EncodeReference(Sorted(result));
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  std::printf("%zu vertices, %zu triangles, %zu bytes\n", result.vertices.size(), result.triangles.size(), bytes.size());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: sole_make_reference_foot OUTPUT\n");
    return 2;
  }
  try {
    Run(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
