#include "app/tools/template_mesh.h"

#include <cstddef>

#include "app/tools/simulated_people.h"
#include "model/decimation.h"
#include "model/mesh_clip.h"

namespace sole::tools {
namespace {

/// Relative edge length: 1 on the foot, less where only toe bones move the skin.
std::vector<double> SizeField(const Eigen::MatrixXd& joint_shares, double hallux_size,
                              double toe_size) {
  std::vector<double> sizes;
  const Eigen::Index toes = joint_shares.cols() - 3;
  for (Eigen::Index i = 0; i < joint_shares.rows(); ++i) {
    const double hallux = joint_shares.row(i).segment(3, 2).sum(),
                 lesser = joint_shares.row(i).tail(toes - 2).sum();
    sizes.push_back(1 + (hallux_size - 1) * hallux + (toe_size - 1) * lesser);
  }
  return sizes;
}

}  // namespace

TemplateMesh MakeTemplateMesh(const TemplateOptions& options) {
  const model::ClippedMesh clipped = model::ClipBelow(sim::ReferenceFoot(), options.cut_height_m);
  const Eigen::MatrixXd shares = JointShares(clipped.source);
  const model::SubsetMesh fine = model::Decimate(
      clipped.mesh, SizeField(shares, options.fine_hallux_size, options.fine_toe_size),
      {.vertices = options.fine_vertices, .boundary_vertices = options.fine_boundary});
  const TriangleMesh fine_mesh = model::MeshFrom(clipped.mesh, fine);
  std::vector<SurfacePoint> fine_points;
  for (const int v : fine.vertices)
    fine_points.push_back(clipped.source[static_cast<std::size_t>(v)]);
  const model::SubsetMesh coarse = model::Decimate(
      fine_mesh,
      SizeField(JointShares(fine_points), options.coarse_hallux_size, options.coarse_toe_size),
      {.vertices = options.coarse_vertices,
       .boundary_vertices = options.coarse_boundary,
       .error_weight = options.coarse_error_weight,
       .facing_weight = options.coarse_facing_weight,
       .improve_rounds = options.coarse_rounds});
  // Coarse vertices first, the others after them in their order.
  std::vector<int> number(fine_points.size(), -1);
  TemplateMesh result;
  for (const int v : coarse.vertices) {
    number[static_cast<std::size_t>(v)] = static_cast<int>(result.points.size());
    result.points.push_back(fine_points[static_cast<std::size_t>(v)]);
  }
  for (std::size_t v = 0; v < fine_points.size(); ++v) {
    if (number[v] >= 0) continue;
    number[v] = static_cast<int>(result.points.size());
    result.points.push_back(fine_points[v]);
  }
  for (const Eigen::Vector3i& t : fine.triangles) {
    const auto at = [&](int corner) { return number[static_cast<std::size_t>(t[corner])]; };
    result.fine_triangles.emplace_back(at(0), at(1), at(2));
  }
  result.coarse_triangles = coarse.triangles;
  return result;
}

}  // namespace sole::tools
