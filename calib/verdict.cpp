#include "calib/verdict.h"

#include <cstdio>

namespace sole::calib {
namespace {

void Check(std::vector<std::string>& failures, const std::string& what, double value_mm,
           double limit_mm) {
  if (!(value_mm > limit_mm)) return;
  char figures[64];
  std::snprintf(figures, sizeof figures, "%.3f mm, limit %.3f mm", value_mm, limit_mm);
  failures.push_back(what + " " + figures);
}

}  // namespace

std::vector<std::string> Failures(const Rig& rig, const CalibrationStats& stats,
                                  const CalibrationLimits& limits) {
  std::vector<std::string> failures;
  Check(failures, "held-out distances above the plate: RMS", stats.heldout_rms_air_mm,
        limits.heldout_air_mm);
  Check(failures, "held-out distances through the plate: RMS", stats.heldout_rms_glass_mm,
        limits.heldout_glass_mm);
  Check(failures, "held-out distances from above to below the plate: RMS",
        stats.heldout_rms_across_mm, limits.heldout_across_mm);
  Check(failures, "held-out distances: largest", stats.heldout_max_mm, limits.heldout_max_mm);
  for (std::size_t i = 0; i < stats.pair_offset_mm.size() && i < rig.pairs.size(); ++i) {
    Check(failures,
          "pair " + rig.pairs[i].name + " sees the held-out target displaced: RMS",
          stats.pair_offset_mm[i], limits.pair_offset_mm);
  }
  Check(failures, "fiducials off the glass top: RMS", stats.ground_rms_mm, limits.ground_mm);
  if (stats.heldout_rejected > limits.rejected_share * stats.heldout_points) {
    failures.push_back(std::to_string(stats.heldout_rejected) + " of " +
                       std::to_string(stats.heldout_points) +
                       " held-out points miss their own images by more than a pixel");
  }
  return failures;
}

}  // namespace sole::calib
