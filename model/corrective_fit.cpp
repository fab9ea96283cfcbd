#include "model/corrective_fit.h"

#include <Eigen/Cholesky>
#include <cstddef>
#include <vector>

#include "core/error.h"

namespace sole::model {

Eigen::MatrixXd FitCorrectives(std::span<const Eigen::VectorXd> offsets,
                               std::span<const Eigen::VectorXd> features,
                               const Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic>& allowed,
                               double ridge) {
  Require(!offsets.empty() && offsets.size() == features.size() &&
              offsets[0].size() == 3 * allowed.rows() && features[0].size() == allowed.cols(),
          "correctives: offsets, features and the mask do not fit");
  const Eigen::Index n = allowed.rows(), p = allowed.cols();
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(p, p), moments = Eigen::MatrixXd::Zero(p, 3 * n);
  for (std::size_t s = 0; s < offsets.size(); ++s) {
    gram += features[s] * features[s].transpose();
    moments += features[s] * offsets[s].transpose();
  }
  gram.diagonal().array() += ridge * static_cast<double>(offsets.size());
  Eigen::MatrixXd posedirs = Eigen::MatrixXd::Zero(3 * n, p);
  for (Eigen::Index i = 0; i < n; ++i) {
    std::vector<Eigen::Index> used;
    for (Eigen::Index f = 0; f < p; ++f) {
      if (allowed(i, f)) used.push_back(f);
    }
    if (used.empty()) continue;
    const Eigen::MatrixXd solved =
        gram(used, used).ldlt().solve(moments(used, Eigen::seqN(3 * i, 3)));
    posedirs(Eigen::seqN(3 * i, 3), used) = solved.transpose();
  }
  return posedirs;
}

}  // namespace sole::model
