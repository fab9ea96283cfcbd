#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "sim/scan_views.h"

namespace sole::sim {

/// Classes in which noise and gaps are told.
inline constexpr std::size_t kIncidenceBins = 7;  ///< of 10 degrees
inline constexpr std::size_t kEdgeBins = 4;       ///< of 1.5 mm
inline constexpr std::size_t kPairBins = 3;       ///< 1, 2, 3 and more pairs
std::size_t IncidenceBin(const ScanView& view);
std::size_t EdgeBin(const ScanView& view);
std::size_t PairBin(const ScanView& view);  ///< view.pairs must not be 0

/// Part of the error's variance that goes together over a distance.
struct NoiseComponent {
  double length_m = 0;  ///< covariance falls as exp(-d^2 / (2 length^2)); 0: each point for itself
  double share = 0;     ///< of the variance; shares sum to 1
};

/// Noise, bias and gaps of what pairs above or below the glass reconstruct. Errors are along the
/// true normal; their standard deviation is sd_m * sd_of_edge * sd_of_pairs.
struct SideNoise {
  std::array<double, kIncidenceBins> sd_m{};
  std::array<double, kEdgeBins> sd_of_edge{};
  std::array<double, kPairBins> sd_of_pairs{};
  std::vector<NoiseComponent> components;
  double pair_bias_m = 0;  ///< SD of an offset that each pair keeps during a sequence
  std::array<double, kIncidenceBins> mean_m{};          ///< systematic offset, positive outwards
  std::array<double, kIncidenceBins> stated_sigma_m{};  ///< what reconstruction states as sigma_m
  std::array<double, kIncidenceBins> normal_rad{};      ///< SD of a normal's direction, per axis
  /// Share of the points of a complete cloud that is there, by incidence and edge.
  std::array<std::array<double, kEdgeBins>, kIncidenceBins> completeness{};
  std::array<double, kEdgeBins> outlier_share{};  ///< points further off than 5 standard deviations
  double outlier_m = 0;  ///< their mean distance from the surface; exponential, to both sides
};

/// Measured on reconstructed takes with known truth by bench/accuracy/scan_noise.cpp.
struct ScanNoise {
  double voxel_m = 0.001;        ///< one point per cell of this size, as fusion leaves it
  double hole_length_m = 0.002;  ///< gaps hang together over this distance
  SideNoise glass, air;
  std::string measured_on;  ///< for people

  const SideNoise& Side(const ScanView& view) const { return view.through_glass ? glass : air; }
  double Sd(const ScanView& view) const;
};

/// The parameters that come with the program (sim/data/scan_noise.json).
const ScanNoise& DefaultScanNoise();

/// Text of a parameter file (docs/formats.md), and back. Throws Error naming `where`, the key and
/// what is wrong with it: missing, of another shape, negative, shares that do not sum to 1.
std::string FormatScanNoise(const ScanNoise& noise);
ScanNoise ParseScanNoise(const std::string& text, const std::string& where);
ScanNoise ReadScanNoise(const std::filesystem::path& path);

}  // namespace sole::sim
