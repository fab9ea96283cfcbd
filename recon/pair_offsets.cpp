#include "recon/pair_offsets.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cstddef>
#include <map>
#include <utility>

#include "core/error.h"

namespace sole::recon {

std::vector<double> SolvePairOffsets(std::span<const PairDifference> differences,
                                     std::span<const double> precision,
                                     const PairOffsetOptions& options) {
  const auto pairs = static_cast<int>(precision.size());
  std::map<std::pair<int, int>, std::vector<double>> by_pairs;
  for (const PairDifference& d : differences) {
    Require(d.first >= 0 && d.first < d.second && d.second < pairs,
            "pair offsets: a difference names a pair that is not there");
    by_pairs[{d.first, d.second}].push_back(d.along_m);
  }
  // A difference's weight is its number of places; a place is good to about a tenth of a millimetre
  // (points of two grids on a slanted, curved surface).
  constexpr double kPlace_m = 1e-4;
  double total = 0;
  for (const double p : precision) total += p;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(pairs, pairs);
  for (int i = 0; i < pairs; ++i) {
    const double share = total > 0 ? precision[static_cast<std::size_t>(i)] / total : 0;
    normal(i, i) = std::max(1e-3, share * pairs) / (options.prior_m * options.prior_m);
  }
  Eigen::VectorXd right = Eigen::VectorXd::Zero(pairs);
  for (auto& [names, values] : by_pairs) {
    if (static_cast<int>(values.size()) < options.min_shared) continue;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    const double weight = static_cast<double>(values.size()) / (kPlace_m * kPlace_m);
    const auto [i, j] = names;
    normal(i, i) += weight;
    normal(j, j) += weight;
    normal(i, j) -= weight;
    normal(j, i) -= weight;
    right[i] += weight * *middle;
    right[j] -= weight * *middle;
  }
  const Eigen::VectorXd offsets = normal.ldlt().solve(right);
  return {offsets.begin(), offsets.end()};
}

}  // namespace sole::recon
