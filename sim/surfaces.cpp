#include "sim/surfaces_internal.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include <Eigen/Geometry>
#include <tbb/parallel_for.h>

namespace sole::sim {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kClearance = 1e-4;  // m, steps over the surface a shadow ray starts from
constexpr int kNoiseSize = 64;

/// Random values on a periodic lattice, smoothly interpolated.
class Noise3 {
 public:
  Noise3() : values_(kNoiseSize * kNoiseSize * kNoiseSize) {
    std::mt19937_64 engine(20);
    std::uniform_real_distribution<float> unit(-1, 1);
    for (float& value : values_) value = unit(engine);
  }
  float At(Vector3f p) const {
    int i[3];
    float f[3];
    for (int axis = 0; axis < 3; ++axis) {
      i[axis] = static_cast<int>(p[axis]);
      i[axis] -= p[axis] < static_cast<float>(i[axis]);  // rounds down below zero, too
      f[axis] = p[axis] - static_cast<float>(i[axis]);
      f[axis] = f[axis] * f[axis] * (3 - 2 * f[axis]);
    }
    float sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const int a = corner & 1, b = (corner >> 1) & 1, c = corner >> 2;
      const float weight = (a ? f[0] : 1 - f[0]) * (b ? f[1] : 1 - f[1]) * (c ? f[2] : 1 - f[2]);
      sum += weight * values_[Index(i[0] + a, i[1] + b, i[2] + c)];
    }
    return sum;
  }

 private:
  static std::size_t Index(int x, int y, int z) {
    constexpr int mask = kNoiseSize - 1;
    return static_cast<std::size_t>(((z & mask) * kNoiseSize + (y & mask)) * kNoiseSize +
                                    (x & mask));
  }
  std::vector<float> values_;
};

LitGrid LightGrid(const Lighting& lighting, const SceneTracer& tracer, ExposureKind kind,
                  LitGrid grid, const Vector3d& normal, bool two_sided) {
  const std::size_t stride = lighting.Stride(kind);
  const int nodes = grid.nodes_x * grid.nodes_y;
  grid.light.resize(static_cast<std::size_t>(nodes) * stride);
  tbb::parallel_for(0, nodes, [&](int node) {
    const Vector3d point =
        grid.origin + node % grid.nodes_x * grid.along_x + node / grid.nodes_x * grid.along_y;
    lighting.At(tracer, kind, {point, normal, two_sided, kClearance},
                grid.light.data() + static_cast<std::size_t>(node) * stride);
  });
  return grid;
}

}  // namespace

void LightMesh(const Lighting& lighting, const SceneTracer& tracer, ExposureKind kind,
               LitMesh& mesh) {
  const std::size_t stride = lighting.Stride(kind), panels = lighting.Panels().size();
  const bool moves = !mesh.shifts.empty();
  mesh.light.resize(mesh.vertices.size() * stride);
  if (moves) mesh.light_close.resize(mesh.light.size());
  if (kind == ExposureKind::kTexture) mesh.panels.resize(mesh.vertices.size() * panels);
  tbb::parallel_for(std::size_t{0}, mesh.vertices.size(), [&](std::size_t i) {
    Lighting::Place place{mesh.vertices[i], mesh.normals[i].cast<double>(), false, 5 * kClearance};
    if (moves) place.point -= mesh.shifts[i], place.time = 0;
    lighting.At(tracer, kind, place, mesh.light.data() + i * stride,
                mesh.panels.empty() ? nullptr : mesh.panels.data() + i * panels);
    if (!moves) return;
    place.point += 2 * mesh.shifts[i], place.time = 1;
    lighting.At(tracer, kind, place, mesh.light_close.data() + i * stride);
  });
}

LitGrid LightCubeFace(const Lighting& lighting, const SceneTracer& tracer, ExposureKind kind,
                      const Rigid3& world_from_body, double edge_m, int face) {
  constexpr int kNodes = 17;
  const int axis = face / 2;
  Vector3d normal = Vector3d::Zero();
  normal[axis] = face % 2 == 0 ? -1 : 1;
  const Vector3d x = Vector3d::Unit((axis + 1) % 3), y = Vector3d::Unit((axis + 2) % 3);
  LitGrid grid;
  grid.nodes_x = grid.nodes_y = kNodes;
  grid.origin = world_from_body * Vector3d(0.5 * edge_m * (normal - x - y));
  grid.along_x = world_from_body.rotation * (x * (edge_m / (kNodes - 1)));
  grid.along_y = world_from_body.rotation * (y * (edge_m / (kNodes - 1)));
  return LightGrid(lighting, tracer, kind, std::move(grid), world_from_body.rotation * normal,
                   false);
}

LitGrid LightGlass(const Lighting& lighting, const SceneTracer& tracer, ExposureKind kind,
                   const TruePlate& plate) {
  LitGrid grid;
  grid.nodes_x = 41;
  grid.nodes_y = 51;
  // A little inside the edges: light from below to the rim itself would meet the ground edge.
  const double half_x = 0.49 * plate.size_x_m, half_y = 0.49 * plate.size_y_m;
  grid.origin = {-half_x, -half_y, 0};
  grid.along_x = Vector3d::UnitX() * (2 * half_x / (grid.nodes_x - 1));
  grid.along_y = Vector3d::UnitY() * (2 * half_y / (grid.nodes_y - 1));
  return LightGrid(lighting, tracer, kind, std::move(grid), Vector3d::UnitZ(), true);
}

LitSheet LightSheet(const Lighting& lighting, const SceneTracer& tracer, ExposureKind kind,
                    const ContactSheet& sheet) {
  constexpr std::uint64_t kPrint = 4711;  // every sheet is printed alike
  constexpr double kDot_m = 0.00074;      // four pixels of the default rig
  constexpr int kNodesX = 19, kNodesY = 37;
  LitSheet lit{sheet, SpecklePattern(kPrint, kDot_m), {}};
  const Eigen::Rotation2Dd turn(sheet.turn_rad);
  const Eigen::Vector2d x = turn * Eigen::Vector2d(sheet.size_x_m, 0),
                        y = turn * Eigen::Vector2d(0, sheet.size_y_m),
                        corner = sheet.centre_m - 0.5 * (x + y);
  for (const int side : {0, 1}) {
    LitGrid grid;
    grid.nodes_x = kNodesX;
    grid.nodes_y = kNodesY;
    grid.origin = {corner.x(), corner.y(), side == 0 ? 0 : sheet.thickness_m};
    grid.along_x = Vector3d(x.x(), x.y(), 0) / (kNodesX - 1);
    grid.along_y = Vector3d(y.x(), y.y(), 0) / (kNodesY - 1);
    lit.sides[static_cast<std::size_t>(side)] =
        LightGrid(lighting, tracer, kind, std::move(grid),
                  (side == 0 ? -1 : 1) * Vector3d::UnitZ(), false);
  }
  return lit;
}

Eigen::Vector2d LitSheet::OnSheet(const Vector3d& point) const {
  return Eigen::Rotation2Dd(-sheet.turn_rad) * (point.head<2>() - sheet.centre_m);
}

bool LitSheet::Covers(const Eigen::Vector2d& place) const {
  return std::abs(place.x()) <= 0.5 * sheet.size_x_m && std::abs(place.y()) <= 0.5 * sheet.size_y_m;
}

MixedLight MixLight(const Lighting& lighting, ExposureKind kind, bool skin,
                    const WeightedPoint* points, int count) {
  MixedLight sum{lighting.RoomLight(), 0};
  const bool gloss = points[0].gloss != nullptr;
  if (kind == ExposureKind::kTexture) {
    for (int i = 0; i < count; ++i) {
      sum.diffuse += points[i].weight * points[i].light->weight;
      if (gloss) sum.gloss += points[i].weight * *points[i].gloss;
    }
    return sum;
  }
  std::size_t lamp = 0;
  for (const Lamp& projector : lighting.Projectors()) {
    float u = 0, v = 0, strength = 0, lobe = 0;
    for (int i = 0; i < count; ++i) {
      const LampLight& light = points[i].light[lamp];
      u += points[i].weight * light.u;
      v += points[i].weight * light.v;
      strength += points[i].weight * light.weight;
      if (gloss) lobe += points[i].weight * points[i].gloss[lamp];
    }
    ++lamp;
    if (!(strength > 0)) continue;
    const auto x = static_cast<double>(u), y = static_cast<double>(v);
    sum.diffuse += strength * (skin ? projector.skin_slide : projector.slide).At(x, y);
    // What gloss reflects has not been in the skin.
    if (lobe > 1e-3f) sum.gloss += strength * lobe * projector.slide.At(x, y);
  }
  return sum;
}

float GridLight(const Lighting& lighting, ExposureKind kind, std::size_t stride,
                const LitGrid& grid, double x, double y) {
  x = std::clamp(x, 0.0, grid.nodes_x - 1.0);
  y = std::clamp(y, 0.0, grid.nodes_y - 1.0);
  const int ix = std::min(static_cast<int>(x), grid.nodes_x - 2),
            iy = std::min(static_cast<int>(y), grid.nodes_y - 2);
  const auto a = static_cast<float>(x - ix), b = static_cast<float>(y - iy);
  const LampLight* corner =
      grid.light.data() + static_cast<std::size_t>(iy * grid.nodes_x + ix) * stride;
  const std::size_t row = static_cast<std::size_t>(grid.nodes_x) * stride;
  const WeightedPoint points[4] = {{corner, nullptr, (1 - a) * (1 - b)},
                                   {corner + stride, nullptr, a * (1 - b)},
                                   {corner + row, nullptr, (1 - a) * b},
                                   {corner + row + stride, nullptr, a * b}};
  return MixLight(lighting, kind, false, points, 4).diffuse;
}

float SkinTexture(const Vector3f& material_m) {
  static const Noise3 noise;
  const float mottles = noise.At(material_m / 0.006f);  // blotches of some millimetres
  const float creases = noise.At(material_m / 0.0016f + Vector3f(7.3f, 1.9f, 4.1f));
  const float pores = noise.At(material_m / 0.0007f);
  return 1 + 0.07f * mottles + 0.05f * creases + 0.04f * pores;
}

std::vector<Dust> ScatterDust(const TruePlate& plate, std::uint64_t seed) {
  std::mt19937_64 engine(seed * 613 + 5);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<Dust> specks(600);
  for (Dust& speck : specks) {
    const double x = unit(engine) - 0.5, y = unit(engine) - 0.5, size = unit(engine);
    speck.centre_m = {0.98 * x * plate.size_x_m, 0.98 * y * plate.size_y_m};
    speck.radius_m = 0.00008 + 0.00022 * size * size;
  }
  return specks;
}

namespace {
constexpr int kDustCells = 100;  // a side
}

std::size_t DustCell(const TruePlate& plate, double x, double y) {
  const auto cell = [](double value, double size) {
    return std::clamp(static_cast<int>((value / size + 0.5) * kDustCells), 0, kDustCells - 1);
  };
  return static_cast<std::size_t>(cell(y, plate.size_y_m) * kDustCells + cell(x, plate.size_x_m));
}

std::vector<std::vector<int>> SortDust(const TruePlate& plate, const std::vector<Dust>& specks) {
  std::vector<std::vector<int>> cells(kDustCells * kDustCells);
  for (std::size_t i = 0; i < specks.size(); ++i) {
    // A speck is far smaller than a cell, so its corners name every cell it reaches into.
    for (int corner = 0; corner < 4; ++corner) {
      const double dx = (corner & 1 ? 1 : -1) * specks[i].radius_m,
                   dy = (corner & 2 ? 1 : -1) * specks[i].radius_m;
      std::vector<int>& cell =
          cells[DustCell(plate, specks[i].centre_m.x() + dx, specks[i].centre_m.y() + dy)];
      if (cell.empty() || cell.back() != static_cast<int>(i)) cell.push_back(static_cast<int>(i));
    }
  }
  return cells;
}

}  // namespace sole::sim
