#include "recon/surface_mesh.h"

#include <pcl/kdtree/kdtree_flann.h>
#include <pcl/point_types.h>
#include <pcl/surface/poisson.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "core/error.h"

namespace sole::recon {
namespace {

constexpr std::size_t kFewestPoints = 100;

pcl::PointCloud<pcl::PointNormal>::Ptr ToPcl(const PointCloud& cloud) {
  pcl::PointCloud<pcl::PointNormal>::Ptr points(new pcl::PointCloud<pcl::PointNormal>);
  for (std::size_t i = 0; i < cloud.Size(); ++i) {
    pcl::PointNormal& p = points->emplace_back();
    p.getVector3fMap() = cloud.points_m[i];
    p.getNormalVector3fMap() = cloud.normals[i];
  }
  return points;
}

TriangleMesh Poisson(const pcl::PointCloud<pcl::PointNormal>::Ptr& points,
                     const MeshOptions& options) {
  pcl::Poisson<pcl::PointNormal> poisson;
  poisson.setDepth(options.depth);
  poisson.setSamplesPerNode(static_cast<float>(options.samples_per_node));
  poisson.setThreads(1);  // sums in a fixed order
  poisson.setInputCloud(points);
  pcl::PointCloud<pcl::PointNormal> vertices;
  std::vector<pcl::Vertices> polygons;
  poisson.reconstruct(vertices, polygons);
  TriangleMesh mesh;
  for (const pcl::PointNormal& v : vertices) mesh.vertices.emplace_back(v.x, v.y, v.z);
  for (const pcl::Vertices& polygon : polygons)
    mesh.triangles.emplace_back(polygon.vertices[0], polygon.vertices[1], polygon.vertices[2]);
  return mesh;
}

/// Closes the surface where Poisson's ends at the border of its cube: a vertex in the middle of every
/// loop of open edges, joined to all of them.
void CloseLoops(TriangleMesh& mesh) {
  std::set<std::pair<int, int>> edges;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) edges.emplace(t[k], t[(k + 1) % 3]);
  }
  std::multimap<int, int> open;  // from, to: against the edge that lacks its twin
  for (const auto& [a, b] : edges) {
    if (!edges.contains({b, a})) open.emplace(b, a);
  }
  while (!open.empty()) {
    std::vector<int> loop;
    int at = open.begin()->first;
    // As many open edges leave a vertex as reach it, so the way ends where it began.
    for (auto next = open.find(at); next != open.end(); next = open.find(at)) {
      loop.push_back(at);
      at = next->second;
      open.erase(next);
    }
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const int v : loop)
      middle += mesh.vertices[static_cast<std::size_t>(v)] / static_cast<double>(loop.size());
    const auto centre = static_cast<int>(mesh.vertices.size());
    mesh.vertices.push_back(middle);
    for (std::size_t k = 0; k < loop.size(); ++k)
      mesh.triangles.emplace_back(loop[k], loop[(k + 1) % loop.size()], centre);
  }
}

/// Of every vertex: whether a point of the cloud lies within `reach_m`.
std::vector<char> NearPoints(const TriangleMesh& mesh,
                             const pcl::PointCloud<pcl::PointNormal>::Ptr& points, double reach_m) {
  pcl::KdTreeFLANN<pcl::PointNormal> tree(false);
  tree.setInputCloud(points);
  std::vector<char> near(mesh.vertices.size());
  tbb::parallel_for(std::size_t{0}, near.size(), [&](std::size_t i) {
    pcl::PointNormal at;
    at.getVector3fMap() = mesh.vertices[i].cast<float>();
    std::vector<int> index(1);
    std::vector<float> squared(1);
    near[i] = tree.nearestKSearch(at, 1, index, squared) == 1 &&
              static_cast<double>(squared[0]) <= reach_m * reach_m;
  });
  return near;
}

/// Of every vertex: the one that stands for its piece.
std::vector<int> Pieces(const TriangleMesh& mesh) {
  std::vector<int> root(mesh.vertices.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&root](int v) {
    while (root[static_cast<std::size_t>(v)] != v) {
      int& above = root[static_cast<std::size_t>(v)];
      above = root[static_cast<std::size_t>(above)];
      v = above;
    }
    return v;
  };
  for (const Eigen::Vector3i& t : mesh.triangles) {
    for (int k = 1; k < 3; ++k) root[static_cast<std::size_t>(find(t[k]))] = find(t[0]);
  }
  for (std::size_t v = 0; v < root.size(); ++v) root[v] = find(static_cast<int>(v));
  return root;
}

/// Keeps the triangles for which `keep` holds, and their vertices.
template <typename Keep>
TriangleMesh Filtered(const TriangleMesh& mesh, const Keep& keep) {
  TriangleMesh kept;
  std::vector<int> place(mesh.vertices.size(), -1);
  for (const Eigen::Vector3i& t : mesh.triangles) {
    if (!keep(t)) continue;
    Eigen::Vector3i& moved = kept.triangles.emplace_back();
    for (int k = 0; k < 3; ++k) {
      int& to = place[static_cast<std::size_t>(t[k])];
      if (to < 0) {
        to = static_cast<int>(kept.vertices.size());
        kept.vertices.push_back(mesh.vertices[static_cast<std::size_t>(t[k])]);
      }
      moved[k] = to;
    }
  }
  return kept;
}

}  // namespace

TriangleMesh MeshFromCloud(const PointCloud& cloud, const MeshOptions& options) {
  Require(options.depth >= 4 && options.depth <= 12, "mesh: depth must be 4 to 12");
  Require(options.trim_m >= 0, "mesh: trim_m must not be negative");
  Require(cloud.normals.size() == cloud.Size(), "mesh: the cloud has no normals");
  if (cloud.Size() < kFewestPoints) return {};
  const auto points = ToPcl(cloud);
  TriangleMesh mesh = Poisson(points, options);
  if (options.trim_m == 0) {
    CloseLoops(mesh);
    return mesh;
  }
  const std::vector<char> near = NearPoints(mesh, points, options.trim_m);
  mesh = Filtered(mesh, [&near](const Eigen::Vector3i& t) {
    return near[static_cast<std::size_t>(t[0])] && near[static_cast<std::size_t>(t[1])] &&
           near[static_cast<std::size_t>(t[2])];
  });
  const std::vector<int> piece = Pieces(mesh);
  std::vector<int> size(mesh.vertices.size(), 0);
  for (const Eigen::Vector3i& t : mesh.triangles)
    ++size[static_cast<std::size_t>(piece[static_cast<std::size_t>(t[0])])];
  const double least = options.min_piece * static_cast<double>(mesh.triangles.size());
  return Filtered(mesh, [&](const Eigen::Vector3i& t) {
    return size[static_cast<std::size_t>(piece[static_cast<std::size_t>(t[0])])] >= least;
  });
}

}  // namespace sole::recon
