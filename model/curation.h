#pragma once

#include <string>

#include "core/fit_sequence.h"
#include "core/mesh.h"
#include "core/point_cloud.h"
#include "model/foot_model.h"

namespace sole::model {

/// What can be said of a registration without truth.
struct RegistrationQuality {
  double residual_m = 0;      ///< mean distance to the registered surface of the scan's points near it
  double explained = 0;       ///< share of the scan's points (the shank beyond the rim apart) that lie near it
  double coverage = 0;        ///< share of its area that has scan points
  double intersecting = 0;    ///< share of its edges that go through another part of it
  double stretch = 0;         ///< 95th percentile of |log(edge length / length on the fitted model)|
  double departure_m = 0;     ///< mean distance to the fitted model, over what has scan points
  double unsure_m = 0;        ///< mean stated deviation of the fitted model's vertices times the share that has no scan points
  double vague_m = 0;         ///< stated deviation of the fitted model's vertices, mean over the part that is known worst
  std::string vague_part;     ///< the joint that moves it
  double bent = 0;            ///< most deviations that a joint is away from the poses that the model was trained on
  std::string bent_joint;
  double turned_rad = 0;      ///< from the frame before
  double deformed_m = 0;      ///< mean distance to the frame before, once that is turned and moved onto it
};

/// Beyond these a registration is not good.
struct CurationOptions {
  double near_m = 0.003;          ///< scan points up to here are near the surface
  double covered_m = 0.002;       ///< a vertex with a scan point nearer than this is covered
  std::size_t points = 6000;      ///< of the scan that are looked at, evenly thinned
  double max_residual_m = 0.0004;
  double min_explained = 0.85;
  double min_coverage = 0.3;
  double max_intersecting = 0.04;
  double max_stretch = 0.7;
  double max_departure_m = 0.003;
  double max_unsure_m = 0.00027;
  double max_vague_m = 0.002;
  int part_vertices = 10;        ///< a part has at least as many
  double max_bent = 6;           ///< poses near the truth: 4; toes that exchange their places: 8 to 16
  double max_turned_rad = 1.6;
  double max_deformed_m = 0.02;  ///< a running foot at 6 frames a second: 15 mm
};

/// `before` is the same foot in the frame before, or null where there is none. `frame` must be found.
RegistrationQuality AssessRegistration(const FootModel& model, const Eigen::VectorXd& beta, const FrameFit& frame,
                                       const PointCloud& scan, const FrameFit* before,
                                       const CurationOptions& options = {});

/// "good", or the first reason why not, with its figure and limit.
std::string CurationVerdict(const RegistrationQuality& quality, const CurationOptions& options = {});

/// Share of a mesh's edges that cross a triangle they have no corner of.
double IntersectingEdges(const TriangleMesh& mesh);

}  // namespace sole::model
