#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/fit_sequence.h"
#include "core/mesh.h"
#include "core/rigid3.h"
#include "io/take.h"
#include "sim/plate_bending.h"

namespace sole::sim {

/// What truly stood in the rig at one trigger. Vectors have one value per vertex of `mesh` (V, the
/// same in every frame).
struct TruthFrame {
  std::int64_t trigger = 0;
  TriangleMesh mesh;                  ///< dense, world frame, metres
  std::vector<std::uint8_t> contact;  ///< 1 where the true gap is below 0.1 mm
  std::vector<double> pressure_pa;
  std::vector<double> penetration_m;
  double load_n = 0;
  PlateSag plate_sag;  ///< of the glass top; without nodes: rigid or unloaded
  std::vector<std::vector<std::uint8_t>> visible;  ///< per pair of the rig: see VisibleToPairs
  std::vector<Rigid3> world_from_bone;             ///< rest pose to world, per bone; may be empty
};

struct TakeTruth {
  Side side = Side::kRight;
  std::vector<std::string> pairs;  ///< names, in the order of TruthFrame::visible
  std::vector<std::string> bones;  ///< names, in the order of TruthFrame::world_from_bone
  std::map<std::string, double> measures_mm;
  std::vector<TruthFrame> frames;
};

/// Writes truth/mesh/NNNNNN.ply for every frame and truth/truth.npz (docs/formats.md, truth/),
/// making the directories. Throws Error if the frames disagree about the number of vertices, pairs
/// or bones.
void WriteTruth(const io::TakePaths& take, const TakeTruth& truth);

}  // namespace sole::sim
