#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh.h"
#include "core/point_cloud.h"

namespace sole::bench {

/// What truly stood there: `visible` says per pair and vertex what the pair can measure.
struct RefSurface {
  TriangleMesh mesh;
  std::vector<std::vector<std::uint8_t>> visible;
};

/// Distance of every point from the surface, positive outside; infinite beyond 10 mm.
std::vector<double> SignedDistances(const TriangleMesh& mesh, const PointCloud& cloud);

/// Clouds against true surfaces, summed over frames; the definitions are those of summary.json.
class ReconScore {
 public:
  /// `through_glass`: per pair of the rig.
  explicit ReconScore(std::vector<bool> through_glass) : through_glass_(std::move(through_glass)) {}
  void Add(const RefSurface& truth, const PointCloud& cloud);

  struct Figures {
    double points = 0;  ///< a frame
    double rms_m = 0, p95_m = 0, bias_m = 0;
    double glass_rms_m = 0, glass_bias_m = 0;  ///< points that come mainly from pairs below
    double completeness = 0, outliers = 0;
    double inside = 0;            ///< completeness of what stands in the capture volume
    double within_sigma = 0;      ///< share of errors below the point's own sigma
    double median_sigma_m = 0;
  };
  Figures Result() const;

 private:
  std::vector<bool> through_glass_;
  int frames_ = 0;
  std::size_t points_ = 0, outliers_ = 0, within_ = 0;
  double seen_area_ = 0, covered_area_ = 0, seen_inside_ = 0, covered_inside_ = 0;
  std::vector<double> signed_m_, glass_m_, sigma_m_;
};

}  // namespace sole::bench
