#include "model/simplex_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cstddef>
#include <limits>

#include "core/error.h"

namespace sole::model {
namespace {

/// Minimum on the plane sum(w) = 1 over the entries of `support`, by Lagrange's equations.
Eigen::VectorXd SolveOnSupport(const Eigen::MatrixXd& h, const Eigen::VectorXd& g,
                               const std::vector<Eigen::Index>& support) {
  const auto m = static_cast<Eigen::Index>(support.size());
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(m + 1, m + 1);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(m + 1);
  double scale = 0;
  for (Eigen::Index i = 0; i < m; ++i)
    scale = std::max(scale,
                     h(support[static_cast<std::size_t>(i)], support[static_cast<std::size_t>(i)]));
  if (scale <= 0) scale = 1;
  for (Eigen::Index i = 0; i < m; ++i) {
    const Eigen::Index si = support[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j < m; ++j)
      system(i, j) = h(si, support[static_cast<std::size_t>(j)]) / scale;
    system(i, i) += 1e-10;
    right[i] = g[si] / scale;
    system(i, m) = system(m, i) = 1;
  }
  right[m] = 1;
  return system.fullPivLu().solve(right).head(m);
}

/// Non-negative minimum over the allowed entries: the primal active-set method started at the best
/// single entry.
Eigen::VectorXd FitNonNegative(const Eigen::MatrixXd& h, const Eigen::VectorXd& g,
                               const std::vector<bool>& allowed) {
  const Eigen::Index n = g.size();
  Eigen::Index start = -1;
  double best = std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 0; i < n; ++i) {
    const double value = h(i, i) - 2 * g[i];
    if (allowed[static_cast<std::size_t>(i)] && value < best) {
      best = value;
      start = i;
    }
  }
  Require(start >= 0, "weights: no entry is allowed");
  std::vector<Eigen::Index> support = {start};
  Eigen::VectorXd w = Eigen::VectorXd::Unit(n, start);
  const double tolerance = 1e-9 * std::max(1e-300, h.diagonal().cwiseAbs().maxCoeff());
  for (Eigen::Index round = 0; round < 10 * n; ++round) {
    // The entry whose growth at the others' expense helps most.
    const Eigen::VectorXd gradient = h * w - g;
    const double level = gradient.dot(w);
    Eigen::Index enter = -1;
    double steepest = -tolerance;
    for (Eigen::Index i = 0; i < n; ++i) {
      const bool inside = std::find(support.begin(), support.end(), i) != support.end();
      if (inside || !allowed[static_cast<std::size_t>(i)] || gradient[i] - level >= steepest)
        continue;
      steepest = gradient[i] - level;
      enter = i;
    }
    if (enter < 0) break;
    support.push_back(enter);
    while (true) {
      const Eigen::VectorXd solved = SolveOnSupport(h, g, support);
      double step = 1;
      std::size_t leave = support.size();
      for (std::size_t i = 0; i < support.size(); ++i) {
        const double to = solved[static_cast<Eigen::Index>(i)], from = w[support[i]];
        if (to > 0 || from <= to) continue;
        if (from / (from - to) < step) {
          step = from / (from - to);
          leave = i;
        }
      }
      for (std::size_t i = 0; i < support.size(); ++i)
        w[support[i]] += step * (solved[static_cast<Eigen::Index>(i)] - w[support[i]]);
      if (leave == support.size()) break;
      w[support[leave]] = 0;
      support.erase(support.begin() + static_cast<std::ptrdiff_t>(leave));
    }
  }
  w = w.cwiseMax(0);
  return w / w.sum();
}

}  // namespace

Eigen::VectorXd FitOnSimplex(const Eigen::MatrixXd& h, const Eigen::VectorXd& g, int max_entries,
                             const std::vector<bool>& allowed) {
  const auto n = static_cast<std::size_t>(g.size());
  Require(h.rows() == g.size() && h.cols() == g.size() && (allowed.empty() || allowed.size() == n),
          "weights: sizes do not fit");
  std::vector<bool> open = allowed.empty() ? std::vector<bool>(n, true) : allowed;
  Eigen::VectorXd w = FitNonNegative(h, g, open);
  while ((w.array() > 0).count() > max_entries) {
    // Drop the smallest and fit again.
    Eigen::Index smallest = -1;
    for (Eigen::Index i = 0; i < w.size(); ++i) {
      if (w[i] > 0 && (smallest < 0 || w[i] < w[smallest])) smallest = i;
      if (w[i] <= 0) open[static_cast<std::size_t>(i)] = false;
    }
    open[static_cast<std::size_t>(smallest)] = false;
    w = FitNonNegative(h, g, open);
  }
  return w;
}

}  // namespace sole::model
