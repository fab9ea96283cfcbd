#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>

#include "calib/ground_fit_internal.h"

namespace sole::calib {
namespace {

/// 1.48 times the median size: the standard deviation of a normal distribution.
double RobustSigma(std::vector<double> residuals) {
  for (double& r : residuals) r = std::abs(r);
  return 1.4826 * Median(std::move(residuals));
}

/// Nodes around a place and their bilinear weights.
struct Stencil {
  std::array<int, 4> node;
  std::array<double, 4> weight;
};
Stencil StencilAt(const GroundSurface& s, const Eigen::Vector2d& place_m) {
  const Eigen::Vector2d at = (place_m - s.first_node_m) / s.spacing_m;
  const int i = std::clamp(static_cast<int>(at.x()), 0, s.nodes_x - 2),
            j = std::clamp(static_cast<int>(at.y()), 0, s.nodes_y - 2);
  const double a = at.x() - i, b = at.y() - j;
  const int low = j * s.nodes_x + i, high = low + s.nodes_x;
  return {{low, low + 1, high, high + 1}, {(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b}};
}

/// Normal equations of the grid: the samples and, as prior, that slopes change little from node to
/// node.
struct GridSystem {
  Eigen::MatrixXd normal;
  Eigen::VectorXd right;
};
GridSystem AssembleGrid(const GroundSurface& s, const std::vector<GroundSample>& samples,
                        const GroundOptions& options) {
  const Eigen::Index n = s.nodes_x * s.nodes_y;
  GridSystem system{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)};
  for (const GroundSample& sample : samples) {
    const Stencil stencil = StencilAt(s, sample.place_m);
    const double height = sample.height_m - s.plane.At(sample.place_m);
    const double weight = sample.weight / options.common_points;
    for (std::size_t k = 0; k < 4; ++k) {
      system.right[stencil.node[k]] += weight * stencil.weight[k] * height;
      for (std::size_t l = 0; l < 4; ++l)
        system.normal(stencil.node[k], stencil.node[l]) +=
            weight * stencil.weight[k] * stencil.weight[l];
    }
  }
  const auto add = [&](std::initializer_list<std::pair<int, double>> terms, double sigma_m) {
    for (const auto& [i, a] : terms) {
      for (const auto& [j, b] : terms) system.normal(i, j) += a * b / (sigma_m * sigma_m);
    }
  };
  for (int j = 0; j < s.nodes_y; ++j) {
    for (int i = 0; i < s.nodes_x; ++i) {
      const int at = j * s.nodes_x + i, row = s.nodes_x;
      if (i > 0 && i + 1 < s.nodes_x)
        add({{at - 1, 1}, {at, -2}, {at + 1, 1}}, options.bend_sigma_m);
      if (j > 0 && j + 1 < s.nodes_y)
        add({{at - row, 1}, {at, -2}, {at + row, 1}}, options.bend_sigma_m);
      if (i + 1 < s.nodes_x && j + 1 < s.nodes_y)
        add({{at, 1}, {at + 1, -1}, {at + row, -1}, {at + row + 1, 1}}, options.bend_sigma_m);
      add({{at, 1}}, options.max_distance_m);  // keeps corners that nothing was seen of
    }
  }
  return system;
}

}  // namespace

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

HeightPlane FitPlane(const std::vector<GroundSample>& samples) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const GroundSample& s : samples) {
    const Eigen::Vector3d row(1, s.place_m.x(), s.place_m.y());
    normal += s.weight * row * row.transpose();
    right += s.weight * s.height_m * row;
  }
  const Eigen::Vector3d plane = normal.ldlt().solve(right);
  return {plane[0], plane[1], plane[2]};
}

int FitGrid(GroundSurface& s, std::vector<GroundSample>& samples, const GroundOptions& options) {
  Eigen::Vector2d low = samples.front().place_m, high = low;
  for (const GroundSample& sample : samples) {
    low = low.cwiseMin(sample.place_m);
    high = high.cwiseMax(sample.place_m);
  }
  s.spacing_m = options.node_m;
  const auto cells = [&](double extent) {
    return std::max(1, static_cast<int>(std::ceil(extent / s.spacing_m)));
  };
  s.nodes_x = cells(high.x() - low.x()) + 1;
  s.nodes_y = cells(high.y() - low.y()) + 1;
  const Eigen::Vector2d span(s.nodes_x - 1, s.nodes_y - 1);
  s.first_node_m = 0.5 * (low + high - s.spacing_m * span);
  int rejected = 0;
  for (int round = 0; round < 4; ++round) {
    s.plane = FitPlane(samples);
    const GridSystem system = AssembleGrid(s, samples, options);
    const Eigen::LDLT<Eigen::MatrixXd> factor(system.normal);
    const Eigen::VectorXd heights = factor.solve(system.right);
    s.residual_m.assign(heights.data(), heights.data() + heights.size());
    const Eigen::MatrixXd inverse =
        factor.solve(Eigen::MatrixXd::Identity(heights.size(), heights.size()));
    s.sigma_m.clear();
    for (Eigen::Index i = 0; i < heights.size(); ++i) s.sigma_m.push_back(std::sqrt(inverse(i, i)));
    std::vector<double> residuals;
    for (const GroundSample& sample : samples)
      residuals.push_back(sample.height_m - HeightAt(s, sample.place_m));
    const double limit = options.outlier_sigmas * std::max(RobustSigma(residuals), 1e-7);
    const std::size_t before = samples.size();
    std::erase_if(samples, [&](const GroundSample& sample) {
      return std::abs(sample.height_m - HeightAt(s, sample.place_m)) > limit;
    });
    rejected += static_cast<int>(before - samples.size());
    if (before == samples.size()) break;
  }
  return rejected;
}

}  // namespace sole::calib
