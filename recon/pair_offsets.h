#pragma once

#include <span>
#include <vector>

namespace sole::recon {

/// One place that two pairs measured.
struct PairDifference {
  int first = 0, second = 0;  ///< pairs, first < second
  double along_m = 0;         ///< by which the first one's point lies nearer to the cameras
};

struct PairOffsetOptions {
  int min_shared = 100;      ///< places that two pairs must share to be compared
  double prior_m = 0.0005;   ///< expected size of an offset
};

/// How far each pair's points lie too near to the cameras, as the median differences of the pairs
/// imply (least squares weighted by the number of places). `precision` holds one positive number a
/// pair, such as the sum of its inverse variances: what all pairs have in common cannot be seen, so
/// the offsets' mean by precision is about zero. Zero for a pair that shares too little with any
/// other.
std::vector<double> SolvePairOffsets(std::span<const PairDifference> differences,
                                     std::span<const double> precision,
                                     const PairOffsetOptions& options = {});

}  // namespace sole::recon
