#include "sim/reference/marching.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>

namespace sole::sim {
namespace {

/// A lattice of field values, corner (i, j, k) at low + cell * (i, j, k).
struct Lattice {
  Eigen::Vector3d low;
  double cell = 0;
  std::array<int, 3> size{};
  std::vector<double> values;

  std::int64_t Id(int i, int j, int k) const {
    return i + static_cast<std::int64_t>(size[0]) * (j + static_cast<std::int64_t>(size[1]) * k);
  }
  double Value(std::int64_t id) const { return values[static_cast<std::size_t>(id)]; }
  Eigen::Vector3d Position(std::int64_t id) const {
    const auto i = id % size[0], j = id / size[0] % size[1], k = id / size[0] / size[1];
    return low + cell * Eigen::Vector3d(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k));
  }
};

class Marcher {
 public:
  explicit Marcher(const Lattice& lattice) : lattice_(lattice) {}

  LabelledMesh Take() { return std::move(mesh_); }

  void Tetrahedron(const std::array<std::int64_t, 4>& corners) {
    std::array<std::int64_t, 4> in{}, out{};
    std::size_t n_in = 0, n_out = 0;
    for (const std::int64_t c : corners) (Inside(c) ? in[n_in++] : out[n_out++]) = c;
    if (n_in == 0 || n_out == 0) return;
    const Eigen::Vector3d outwards = lattice_.Position(out[0]) - lattice_.Position(in[0]);
    if (n_in == 1) {
      Triangle(Crossing(in[0], out[0]), Crossing(in[0], out[1]), Crossing(in[0], out[2]), outwards, 0);
    } else if (n_in == 3) {
      Triangle(Crossing(in[0], out[0]), Crossing(in[1], out[0]), Crossing(in[2], out[0]), outwards, 0);
    } else {
      const int a = Crossing(in[0], out[0]), b = Crossing(in[0], out[1]);
      const int c = Crossing(in[1], out[1]), d = Crossing(in[1], out[0]);
      Triangle(a, b, c, outwards, 0);
      Triangle(a, c, d, outwards, 0);
    }
  }

  /// The inside part of a lattice triangle in the top plane.
  void CapTriangle(const std::array<std::int64_t, 3>& corners) {
    std::vector<int> polygon;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::int64_t here = corners[i], next = corners[(i + 1) % 3];
      if (Inside(here)) polygon.push_back(Vertex(here, here, lattice_.Position(here)));
      if (Inside(here) != Inside(next)) polygon.push_back(Inside(here) ? Crossing(here, next) : Crossing(next, here));
    }
    for (std::size_t i = 2; i < polygon.size(); ++i) {
      Triangle(polygon[0], polygon[i - 1], polygon[i], Eigen::Vector3d::UnitZ(), 1);
    }
  }

 private:
  bool Inside(std::int64_t id) const { return lattice_.Value(id) < 0; }

  int Vertex(std::int64_t a, std::int64_t b, const Eigen::Vector3d& position) {
    const auto key = static_cast<std::uint64_t>(a) << 32 | static_cast<std::uint64_t>(b);
    const auto [found, added] = index_.try_emplace(key, static_cast<int>(mesh_.vertices.size()));
    if (added) mesh_.vertices.push_back(position);
    return found->second;
  }

  int Crossing(std::int64_t in, std::int64_t out) {
    const double a = lattice_.Value(in), b = lattice_.Value(out);
    const double t = std::clamp(a / (a - b), 0.05, 0.95);
    return Vertex(in, out, (1 - t) * lattice_.Position(in) + t * lattice_.Position(out));
  }

  void Triangle(int a, int b, int c, const Eigen::Vector3d& outwards, int label) {
    const auto at = [&](int i) -> const Eigen::Vector3d& { return mesh_.vertices[static_cast<std::size_t>(i)]; };
    const bool turned = (at(b) - at(a)).cross(at(c) - at(a)).dot(outwards) < 0;
    mesh_.triangles.emplace_back(a, turned ? c : b, turned ? b : c);
    mesh_.labels.push_back(label);
  }

  const Lattice& lattice_;
  LabelledMesh mesh_;
  std::unordered_map<std::uint64_t, int> index_;
};

}  // namespace

LabelledMesh MarchTetrahedra(const std::function<double(const Eigen::Vector3d&)>& field,
                             const Eigen::Vector3d& low, const Eigen::Vector3d& high, double cell) {
  Lattice lattice;
  lattice.cell = cell;
  for (int i = 0; i < 3; ++i) {
    lattice.size[static_cast<std::size_t>(i)] = static_cast<int>(std::ceil((high[i] - low[i]) / cell)) + 1;
  }
  const auto [nx, ny, nz] = lattice.size;
  lattice.low = low;
  lattice.low.z() = high.z() - cell * (nz - 1);
  lattice.values.resize(static_cast<std::size_t>(lattice.Id(0, 0, nz)));
  for (std::size_t i = 0; i < lattice.values.size(); ++i) {
    lattice.values[i] = field(lattice.Position(static_cast<std::int64_t>(i)));
  }
  // The six tetrahedra of a cube, one per order of the axes from its low to its high corner.
  constexpr int kPaths[6][2] = {{1, 3}, {1, 5}, {2, 3}, {2, 6}, {4, 5}, {4, 6}};
  Marcher marcher(lattice);
  for (int k = 0; k + 1 < nz; ++k) {
    for (int j = 0; j + 1 < ny; ++j) {
      for (int i = 0; i + 1 < nx; ++i) {
        const auto corner = [&](int bits) { return lattice.Id(i + (bits & 1), j + (bits >> 1 & 1), k + (bits >> 2)); };
        for (const auto& path : kPaths) {
          marcher.Tetrahedron({corner(0), corner(path[0]), corner(path[1]), corner(7)});
        }
        if (k + 2 == nz) {
          marcher.CapTriangle({corner(4), corner(5), corner(7)});
          marcher.CapTriangle({corner(4), corner(7), corner(6)});
        }
      }
    }
  }
  return marcher.Take();
}

}  // namespace sole::sim
