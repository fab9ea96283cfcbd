#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/fit_sequence.h"
#include "core/mesh.h"
#include "model/foot_model.h"
#include "sim/plate_bending.h"

namespace sole::app {

/// Truth of one trigger of a simulated take.
struct FrameTruth {
  std::int64_t trigger = 0;
  TriangleMesh mesh;                              ///< world frame, constant vertex order
  std::vector<std::vector<std::uint8_t>> visible; ///< pair x vertex: seen by both cameras and lit
  sim::PlateSag sag;                              ///< of the glass top

  /// Height of a point over the glass.
  double Gap(const Eigen::Vector3d& point) const { return point.z() + sag.At(point.x(), point.y()); }
};

/// truth/ of a simulated take (docs/formats.md). Only scoring reads it, never a stage.
struct TakeTruth {
  Side side = Side::kRight;
  std::vector<FrameTruth> frames;
  std::map<std::string, double> measures_mm;
};

/// Throws Error naming what is missing or does not fit together.
TakeTruth ReadTruth(const std::filesystem::path& take);

/// True positions of the template's vertices (FootModel::material) on a simulated foot of `side`.
std::vector<Eigen::Vector3d> MaterialPositions(const model::FootModel& model, const TriangleMesh& truth, Side side);

}  // namespace sole::app
