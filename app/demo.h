#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace sole::app {

struct DemoOptions {
  std::filesystem::path out;
  std::uint64_t seed = 1;
  std::uint64_t rig_seed = 0;         ///< 0: the seed
  std::filesystem::path calibration;  ///< of an earlier demo with this rig seed; empty: record and make one
  std::string motion = "stand";
  int frames = 6;
  int poses = 20;
  int cameras = 4;
  std::string size = "1624x1236";
  double noise = 1;
  std::vector<std::string> faults;  ///< of the foot's take, as ParseFault reads them
  std::filesystem::path model;  ///< empty: the shipped one
};

/// Simulated cameras on the wire to an exported, measured foot: renders and serves a calibration take and a
/// foot take, records both, calibrates, reconstructs, labels contact, fits, measures, exports, scores against the truth and writes
/// OUT/summary.json and OUT/report.html. With a calibration at hand the first take is left out. An earlier demo in OUT is replaced. Returns the summary.
nlohmann::json RunDemo(const DemoOptions& options);

}  // namespace sole::app
