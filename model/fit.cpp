#include "model/fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "core/error.h"
#include "model/fit_internal.h"
#include "model/foot_start.h"

namespace sole::model {
namespace {

Thinned Thin(const PointCloud& scan, const FitOptions& options) {
  return {&scan, ThinForFit(scan, options.coarse_points), ThinForFit(scan, options.middle_points),
          ThinForFit(scan, options.fine_points)};
}

}  // namespace

PointCloud ThinForFit(const PointCloud& scan, std::size_t count) {
  std::vector<std::size_t> finite;
  finite.reserve(scan.Size());
  for (std::size_t i = 0; i < scan.Size(); ++i) {
    if (scan.points_m[i].allFinite()) finite.push_back(i);
  }
  PointCloud thinned;
  const double step =
      std::max(1.0, static_cast<double>(finite.size()) / static_cast<double>(count));
  for (double at = 0; at < static_cast<double>(finite.size()); at += step) {
    const std::size_t i = finite[static_cast<std::size_t>(at)];
    thinned.points_m.push_back(scan.points_m[i]);
    if (!scan.normals.empty()) thinned.normals.push_back(scan.normals[i]);
    if (!scan.sigma_m.empty()) thinned.sigma_m.push_back(scan.sigma_m[i]);
  }
  return thinned;
}

FitSequence FitFrames(const FootModel& right, const FootModel& left, std::span<const PointCloud> clouds,
                      std::span<const std::int64_t> triggers, const FitOptions& options,
                      const FitProgress& progress) {
  Require(clouds.size() == triggers.size(),
          fmt::format("fit: {} clouds for {} triggers", clouds.size(), triggers.size()));
  const Sides models{right, left};
  std::vector<Thinned> scans;
  std::vector<std::size_t> with_foot;
  for (std::size_t f = 0; f < clouds.size(); ++f) {
    scans.push_back(Thin(clouds[f], options));
    if (clouds[f].Size() >= static_cast<std::size_t>(options.minimum_points)) with_foot.push_back(f);
  }
  const SubjectFit subject = FitSubject(models, scans, with_foot, options);
  const FootModel& model = models.Of(subject.side);

  FitSequence sequence;
  sequence.beta = subject.beta;
  sequence.beta_sd = subject.beta_sd;
  std::optional<ModelParameters> previous;
  std::optional<double> heading;
  for (std::size_t f = 0; f < clouds.size(); ++f) {
    if (progress) progress(static_cast<int>(f), static_cast<int>(clouds.size()));
    if (!std::binary_search(with_foot.begin(), with_foot.end(), f)) {
      sequence.frames.push_back(EmptyFrame(model, triggers[f], clouds[f].Size()));
      previous.reset();
      continue;
    }
    PoseFit fit;
    fit.cost = std::numeric_limits<double>::infinity();
    const auto known = subject.fits.find(f);
    std::optional<ModelParameters> start = previous;
    if (known != subject.fits.end()) start = known->second.parameters;
    if (start) {
      start->beta = subject.beta;
      fit = FitPose(model, scans[f].coarse, *start, With(kCoarse, false), options.pose);
      fit = FitPose(model, scans[f].middle, fit.parameters, With(kMiddle, false), options.pose);
    }
    for (const auto& hint : {heading, std::optional<double>()}) {
      if (!(fit.cost > options.tracked_cost)) break;
      PoseFit other = FitFromScratch(models, scans[f], subject.beta, subject.side, hint, false, options)
                          .Of(subject.side);
      if (other.cost < fit.cost) fit = other;
      if (!heading) break;
    }
    if (!std::isfinite(fit.cost)) fit.parameters = RestParameters(model);
    const SettledFit settled = SettleFit(model, f, scans[f], fit, false, options);
    FrameFit frame = FinishFrame(model, subject.side, triggers[f], scans[f], settled, options);
    previous.reset();
    if (frame.verdict == "good") {
      previous = settled.fit.parameters;
      heading = HeadingOf(settled.fit.parameters);
    }
    sequence.frames.push_back(std::move(frame));
  }
  if (progress) progress(static_cast<int>(clouds.size()), static_cast<int>(clouds.size()));
  return sequence;
}

}  // namespace sole::model
