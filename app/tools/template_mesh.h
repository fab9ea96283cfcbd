#pragma once

#include <vector>

#include "core/mesh.h"

namespace sole::tools {

struct TemplateOptions {
  double cut_height_m = 0.095;
  int fine_vertices = 4000, fine_boundary = 60;
  int coarse_vertices = 266, coarse_boundary = 15;
  /// Edge length at the hallux and at the lesser toes against the rest of the foot.
  double fine_hallux_size = 0.7, fine_toe_size = 0.6;
  double coarse_hallux_size = 0.6, coarse_toe_size = 0.4;
  double coarse_error_weight = 3;     ///< DecimationOptions::error_weight
  double coarse_facing_weight = 0.3;  ///< DecimationOptions::facing_weight
  int coarse_rounds = 1;              ///< DecimationOptions::improve_rounds
};

/// The template's two surfaces as points of the simulator's reference foot; the first
/// coarse_vertices of the fine points are those of the coarse surface.
struct TemplateMesh {
  std::vector<SurfacePoint> points;
  std::vector<Eigen::Vector3i> fine_triangles;
  std::vector<Eigen::Vector3i> coarse_triangles;
};

TemplateMesh MakeTemplateMesh(const TemplateOptions& options = {});

}  // namespace sole::tools
