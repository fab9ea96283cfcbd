#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "model/fit_internal.h"
#include "model/foot_start.h"
#include "model/jacobian.h"

namespace sole::model {

ScratchFit FitFromScratch(const Sides& models, const Thinned& scan, const Eigen::VectorXd& beta,
                          std::optional<Side> side, std::optional<double> heading, bool free_shape,
                          const FitOptions& options) {
  ScratchFit best;
  for (const FootStart& start :
       FindFootStarts(models.right, models.left, scan.coarse, beta, side, heading)) {
    PoseFit fit = FitPose(models.Of(start.side), scan.coarse, start.parameters,
                          With(kCoarse, free_shape), options.pose);
    fit.cost += 0.2 * start.cost;  // a foot that the scan does not cover fits as well otherwise
    if (fit.cost < best.Of(start.side).cost) best.Of(start.side) = fit;
  }
  for (const Side s : {Side::kRight, Side::kLeft}) {
    PoseFit& fit = best.Of(s);
    if (!std::isfinite(fit.cost)) continue;
    fit = FitPose(models.Of(s), scan.middle, fit.parameters, With(kMiddle, free_shape), options.pose);
  }
  return best;
}

SubjectFit FitSubject(const Sides& models, const std::vector<Thinned>& scans,
                      const std::vector<std::size_t>& with_foot, const FitOptions& options) {
  const Eigen::Index betas = models.right.NumBetas();
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(betas);
  SubjectFit subject{Side::kRight, none, Eigen::VectorXd::Ones(betas), {}};
  const auto frames = std::min<std::size_t>(with_foot.size(), static_cast<std::size_t>(options.shape_frames));
  std::array<double, 2> costs{0, 0};
  std::optional<Side> decided;
  std::map<std::size_t, ScratchFit> fits;
  for (std::size_t k = 0; k < frames; ++k) {
    const std::size_t f = with_foot[(2 * k + 1) * with_foot.size() / (2 * frames)];
    fits[f] = FitFromScratch(models, scans[f], none, decided, {}, true, options);
    if (decided) continue;
    for (std::size_t s = 0; s < 2; ++s) costs[s] += std::min(fits[f].fits[s].cost, 1.0);
    subject.side = costs[0] <= costs[1] ? Side::kRight : Side::kLeft;
    if (std::min(costs[0], costs[1]) < options.side_ratio * std::max(costs[0], costs[1]))
      decided = subject.side;
  }
  // Shapes of the frames that fit about as well as the best one.
  double least = std::numeric_limits<double>::infinity();
  const FootModel& model = models.Of(subject.side);
  for (auto& [f, fit] : fits) {
    PoseFit& mine = fit.Of(subject.side);
    if (!std::isfinite(mine.cost)) continue;
    mine = UsesContact(model, options)
               ? SettleFit(model, f, scans[f], mine, true, options).fit
               : FitPose(model, scans[f].fine, mine.parameters, kFine, options.pose);
    least = std::min(least, mine.cost);
    subject.fits[f] = mine;
  }
  int shapes = 0;
  Eigen::VectorXd variance = Eigen::VectorXd::Zero(betas);
  for (auto& [f, fit] : subject.fits) {
    if (fit.cost > 2 * least + 0.01) continue;
    AddCovariance(model, scans[f].fine, kFine, options.pose, fit);
    const ParameterColumns columns = ColumnsOf(model, fit.parameters);
    variance += fit.covariance.diagonal().segment(columns.beta, betas);
    subject.beta += fit.parameters.beta;
    ++shapes;
  }
  if (shapes > 0) {
    subject.beta /= shapes;
    subject.beta_sd = (variance / shapes / shapes).cwiseSqrt();
  }
  return subject;
}

}  // namespace sole::model
