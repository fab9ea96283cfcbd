#include "io/mesh_file.h"

#include <cmath>
#include <cstring>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/bytes_internal.h"
#include "io/ply_internal.h"

namespace sole::io {

namespace fs = std::filesystem;

namespace {

std::string PlyStart(const std::string& about) {
  return "ply\nformat binary_little_endian 1.0\ncomment Sole point cloud or mesh, format 1, " + about + "\n";
}

void AppendFloats(std::string& out, const auto& vector) {
  for (Eigen::Index i = 0; i < vector.size(); ++i) AppendLittle(out, static_cast<float>(vector[i]));
}

void CheckTriangles(const TriangleMesh& mesh, const fs::path& path) {
  for (const Eigen::Vector3i& t : mesh.triangles) {
    Require(t.minCoeff() >= 0 && static_cast<std::size_t>(t.maxCoeff()) < mesh.vertices.size(),
            path.string() + ": a triangle names a vertex that does not exist");
  }
}

Eigen::Vector3d TriangleNormal(const TriangleMesh& mesh, const Eigen::Vector3i& t) {
  const auto corner = [&](int i) { return mesh.vertices[static_cast<std::size_t>(t[i])]; };
  Eigen::Vector3d normal = (corner(1) - corner(0)).cross(corner(2) - corner(0));
  normal.stableNormalize();
  return normal.allFinite() ? normal : Eigen::Vector3d::Zero();
}

/// Three columns of a PLY file; empty if one is absent.
std::vector<Eigen::Vector3d> Triples(const PlyContent& content,
                                     const std::array<const char*, 3>& names) {
  std::array<const std::vector<double>*, 3> columns{};
  for (std::size_t i = 0; i < 3; ++i) {
    columns[i] = content.Find(names[i]);
    if (!columns[i]) return {};
  }
  std::vector<Eigen::Vector3d> result(content.vertices);
  for (std::size_t i = 0; i < content.vertices; ++i) {
    result[i] = {(*columns[0])[i], (*columns[1])[i], (*columns[2])[i]};
  }
  return result;
}

std::vector<Eigen::Vector3f> ToFloat(const std::vector<Eigen::Vector3d>& values) {
  std::vector<Eigen::Vector3f> result;
  for (const Eigen::Vector3d& v : values) result.push_back(v.cast<float>());
  return result;
}

void RequirePositions(const PlyContent& content, const std::string& where) {
  Require(content.Find("x") && content.Find("y") && content.Find("z"),
          where + ": has no vertices with x, y and z");
}

}  // namespace

void WritePly(const fs::path& path, const PointCloud& cloud) {
  const std::size_t n = cloud.Size();
  const auto fits = [&](std::size_t size) { return size == 0 || size == n; };
  Require(fits(cloud.normals.size()) && fits(cloud.sigma_m.size()) &&
              fits(cloud.intensity.size()) && fits(cloud.pair.size()),
          path.string() + ": the cloud's vectors differ in length");
  std::string out =
      PlyStart("metres, world frame (z up)") +
      fmt::format("element vertex {}\nproperty float x\nproperty float y\nproperty float z\n", n);
  if (!cloud.normals.empty()) out += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!cloud.sigma_m.empty()) out += "property float sigma\n";
  if (!cloud.intensity.empty()) out += "property float intensity\n";
  if (!cloud.pair.empty()) out += "property uchar pair\n";
  out += "end_header\n";
  out.reserve(out.size() + n * 33);
  for (std::size_t i = 0; i < n; ++i) {
    AppendFloats(out, cloud.points_m[i]);
    if (!cloud.normals.empty()) AppendFloats(out, cloud.normals[i]);
    if (!cloud.sigma_m.empty()) AppendLittle(out, cloud.sigma_m[i]);
    if (!cloud.intensity.empty()) AppendLittle(out, cloud.intensity[i]);
    if (!cloud.pair.empty()) AppendLittle(out, cloud.pair[i]);
  }
  WriteStringAtomically(path, out);
}

void WritePly(const fs::path& path, const TriangleMesh& mesh, const std::string& about) {
  CheckTriangles(mesh, path);
  std::string out =
      PlyStart(about) + fmt::format(
                      "element vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
                      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
                      mesh.vertices.size(), mesh.triangles.size());
  for (const Eigen::Vector3d& v : mesh.vertices) AppendFloats(out, v);
  for (const Eigen::Vector3i& t : mesh.triangles) {
    AppendLittle(out, std::uint8_t{3});
    for (int i = 0; i < 3; ++i) AppendLittle(out, static_cast<std::int32_t>(t[i]));
  }
  WriteStringAtomically(path, out);
}

PointCloud ReadPlyCloud(const fs::path& path) {
  const PlyContent content =
      ParsePly(ReadFile(path), {"x", "y", "z", "nx", "ny", "nz", "sigma", "intensity", "pair"},
               false, path.string());
  RequirePositions(content, path.string());
  PointCloud cloud;
  cloud.points_m = ToFloat(Triples(content, {"x", "y", "z"}));
  cloud.normals = ToFloat(Triples(content, {"nx", "ny", "nz"}));
  for (const auto& [name, target] :
       {std::pair{"sigma", &cloud.sigma_m}, {"intensity", &cloud.intensity}}) {
    const std::vector<double>* values = content.Find(name);
    if (!values) continue;
    for (const double value : *values) target->push_back(static_cast<float>(value));
  }
  if (const std::vector<double>* pair = content.Find("pair")) {
    for (const double value : *pair) {
      Require(value >= 0 && value <= 255, path.string() + ": property 'pair' must be 0 to 255");
      cloud.pair.push_back(static_cast<std::uint8_t>(value));
    }
  }
  return cloud;
}

TriangleMesh ReadPlyMesh(const fs::path& path) {
  const PlyContent content = ParsePly(ReadFile(path), {"x", "y", "z"}, true, path.string());
  RequirePositions(content, path.string());
  Require(content.has_faces, path.string() + ": holds points but no faces: a mesh is needed");
  TriangleMesh mesh;
  mesh.vertices = Triples(content, {"x", "y", "z"});
  const auto count = static_cast<long long>(mesh.vertices.size());
  for (const std::vector<long long>& face : content.faces) {
    for (const long long index : face) {
      Require(index >= 0 && index < count, path.string() + ": a face names vertex " +
                                               std::to_string(index) + " of " +
                                               std::to_string(count));
    }
    for (std::size_t i = 2; i < face.size(); ++i) {
      mesh.triangles.emplace_back(static_cast<int>(face[0]), static_cast<int>(face[i - 1]),
                                  static_cast<int>(face[i]));
    }
  }
  return mesh;
}

void WriteObj(const fs::path& path, const TriangleMesh& mesh) {
  CheckTriangles(mesh, path);
  std::string out = "# Sole mesh, format 1, metres, world frame (z up)\n";
  for (const Eigen::Vector3d& v : mesh.vertices)
    out += fmt::format("v {} {} {}\n", v.x(), v.y(), v.z());
  for (const Eigen::Vector3i& t : mesh.triangles)
    out += fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  WriteStringAtomically(path, out);
}

void WriteStl(const fs::path& path, const TriangleMesh& mesh) {
  CheckTriangles(mesh, path);
  std::string out = "Sole mesh, format 1, millimetres, world frame (z up)";
  out.resize(80, ' ');
  AppendLittle(out, static_cast<std::uint32_t>(mesh.triangles.size()));
  for (const Eigen::Vector3i& t : mesh.triangles) {
    AppendFloats(out, TriangleNormal(mesh, t));
    for (int i = 0; i < 3; ++i) {
      AppendFloats(out, Eigen::Vector3d(1000 * mesh.vertices[static_cast<std::size_t>(t[i])]));
    }
    AppendLittle(out, std::uint16_t{0});
  }
  WriteStringAtomically(path, out);
}

}  // namespace sole::io
