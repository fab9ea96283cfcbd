#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <Eigen/Core>

#include "sim/scan_views.h"
#include "sim/true_rig.h"

namespace sole::bench {

/// A reconstructed point and what is true of it.
struct Sample {
  sim::ScanView view;
  int take = 0, frame = 0;
  Eigen::Vector3d point_m;
  double error_m = 0;  ///< along the true normal, positive outside
  double sigma_m = 0;
  double normal_off_rad = 0;
  double scaled = 0;  ///< error without bias over its class's SD
  bool outlier = false;
};

/// Places of a complete cloud, and whether the scan has a point there.
struct Place {
  sim::ScanView view;
  int frame = 0;
  Eigen::Vector3d point_m;
  bool there = false;
};

struct Samples {
  std::vector<Sample> points;
  std::vector<Place> places;
  std::size_t unseen = 0;  ///< points where the true surface is seen by no pair
};

/// truth/rig.json.
sim::TrueRig ReadTrueRig(const std::filesystem::path& path);

/// 1 for the vertices of the cut above the ankle, which show nothing.
std::vector<std::uint8_t> CutVertices();

/// Adds the scans of a processed simulated take, number `take`, to `all`. Throws Error.
Samples ReadTake(const std::filesystem::path& directory, double voxel_m, int take, Samples all);

}  // namespace sole::bench
