#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>

namespace sole::recon {

struct NearPoint {
  double squared_m2 = 0;
  int index = 0;
};

/// Calls f(i, near) for every point with its `k` nearest ones (all where there are fewer), itself
/// included, in no particular order but always the same; from several threads. `cell_m`: about the
/// distance within which most points have `k` others; it changes the speed only. Points of equal
/// distance are taken by index.
void ForNearest(std::span<const Eigen::Vector3d> points, int k, double cell_m,
                const std::function<void(int, std::span<const NearPoint>)>& f);

}  // namespace sole::recon
