#include "contact/label.h"

#include <algorithm>
#include <cmath>

#include "contact/ground.h"
#include "core/error.h"

namespace sole::contact {

FrameContact LabelContact(const Eigen::MatrixX3d& vertices_m, const Eigen::VectorXd& vertex_sd_m,
                          const GroundPlane& ground, const GroundSurface& calibrated) {
  const Eigen::Index n = vertices_m.rows();
  Require(vertex_sd_m.size() == n, "contact: " + std::to_string(vertex_sd_m.size()) +
                                       " standard deviations for " + std::to_string(n) + " vertices");
  FrameContact labels;
  labels.contact.assign(static_cast<std::size_t>(n), 0);
  labels.probability = Eigen::VectorXd::Zero(n);
  labels.gap_m = Eigen::VectorXd::Constant(n, std::nan(""));
  for (Eigen::Index i = 0; i < n; ++i) {
    if (!vertices_m.row(i).allFinite()) continue;
    const double gap = Gap(ground, vertices_m.row(i).transpose(), calibrated);
    const double sigma = std::max(std::hypot(vertex_sd_m[i], ground.sigma_m), 1e-9);
    labels.gap_m[i] = gap;
    labels.contact[static_cast<std::size_t>(i)] = gap < kContactGap_m;
    labels.probability[i] = 0.5 * std::erfc((gap - kContactGap_m) / (sigma * std::sqrt(2.0)));
  }
  return labels;
}

}  // namespace sole::contact
