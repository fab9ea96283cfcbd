#pragma once

#include <Eigen/Core>

#include "core/mesh.h"
#include "core/point_cloud.h"

namespace sole::model {

struct RegistrationOptions {
  int iterations = 5;
  double search_radius_m = 0.008;   ///< in the first iteration; shrinks to final_radius_m in the last
  double final_radius_m = 0.002;
  double stiffness = 4.0;           ///< pull of an edge's two ends towards one displacement, in scan points; shrinks
  double final_stiffness = 0.2;
  double anchor = 1e-3;             ///< pull of every vertex towards the model, in scan points
  double tangential = 0.05;         ///< point-to-point share of the data term: keeps vertices from sliding
  double minimum_normal_cosine = 0.5;
  std::size_t early_points = 20000;  ///< of a scan that has at least twice as many, used until the last two iterations
  double point_sigma_m = 5e-5;      ///< of scan points that carry no sigma
};

struct Registration {
  Eigen::MatrixX3d vertices_m;  ///< registered vertices, in the order of the mesh
  Eigen::VectorXd sd_m;         ///< along the normal; large where the scan has no points
  Eigen::VectorXd support;      ///< scan points that hold a vertex (barycentric shares)
  double residual_m = 0;        ///< mean distance of matched scan points to the registered surface
  double matched = 0;           ///< share of scan points that found the surface
};

/// Free registration of a posed model surface to a scan (energies E_g and E_c of the registration): every
/// vertex moves on its own so that scan points lie on the triangles (point to plane), neighbours move
/// alike, and what the scan does not show follows the model. Both in the world frame.
Registration RegisterFree(const TriangleMesh& model, const PointCloud& scan,
                          const RegistrationOptions& options = {});

}  // namespace sole::model
