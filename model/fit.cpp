#include "model/fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <vector>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "core/error.h"
#include "model/foot_start.h"
#include "model/forward.h"
#include "model/jacobian.h"

namespace sole::model {
namespace {

// Annealed schedule: joints and shape with the data ever heavier.
constexpr PoseFitStage kCoarse{8, 0.03, 0.008, 0.003, true, true};
constexpr PoseFitStage kMiddle{8, 0.012, 0.004, 0.0015, true, true};
constexpr PoseFitStage kFine{10, 0.008, 0.002, 0.00025, true, true};

PoseFitStage With(PoseFitStage stage, bool free_shape) {
  stage.free_shape = free_shape;
  return stage;
}

struct Sides {
  const FootModel& right;
  const FootModel& left;
  const FootModel& Of(Side side) const { return side == Side::kRight ? right : left; }
};

/// A scan thinned for each stage.
struct Thinned {
  PointCloud coarse, middle, fine;
};

Thinned Thin(const PointCloud& scan, const FitOptions& options) {
  return {ThinForFit(scan, options.coarse_points), ThinForFit(scan, options.middle_points),
          ThinForFit(scan, options.fine_points)};
}

/// Best fit of each side that was tried, to the middle stage; cost infinite for the other.
struct ScratchFit {
  std::array<PoseFit, 2> fits;  ///< by Side
  ScratchFit() {
    for (PoseFit& fit : fits) fit.cost = std::numeric_limits<double>::infinity();
  }
  PoseFit& Of(Side side) { return fits[static_cast<std::size_t>(side)]; }
};

/// Without a frame before: from the best placements of the resting foot.
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

/// What the subject pass finds: side, shape and the fits it rests on.
struct SubjectFit {
  Side side = Side::kRight;
  Eigen::VectorXd beta, beta_sd;
  std::map<std::size_t, PoseFit> fits;  ///< by frame, of that side
};

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
    mine = FitPose(model, scans[f].fine, mine.parameters, kFine, options.pose);
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

FrameFit EmptyFrame(const FootModel& model, std::int64_t trigger, std::size_t points) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Eigen::Index n = model.NumVertices(), k = model.NumJoints();
  FrameFit frame;
  frame.trigger = trigger;
  frame.theta = Eigen::MatrixX3d::Constant(k, 3, nan);
  frame.translation_m.setConstant(nan);
  frame.vertices_m = Eigen::MatrixX3d::Constant(n, 3, nan);
  frame.registration_m = frame.vertices_m;
  frame.registration_fine_m = Eigen::MatrixX3d::Constant(model.fine.NumVertices(), 3, nan);
  frame.registration_sd_m = Eigen::VectorXd::Constant(n, nan);
  frame.theta_sd = frame.theta;
  frame.vertex_sd_m = frame.registration_sd_m;
  frame.residual_m = nan;
  frame.verdict = fmt::format("no foot: {} scan points", points);
  return frame;
}

/// Standard deviations of joints and vertices from the covariance of the parameters.
void SetDeviations(const FootModel& model, const PoseFit& fit, FrameFit& frame) {
  const ParameterColumns columns = ColumnsOf(model, fit.parameters);
  frame.theta_sd.resize(model.NumJoints(), 3);
  for (Eigen::Index j = 0; j < model.NumJoints(); ++j) {
    frame.theta_sd.row(j) = fit.covariance.diagonal().segment<3>(columns.theta + 3 * j).cwiseSqrt();
  }
  const PointsJacobian vertices = VertexJacobian(model, fit.parameters, Variant::kCoarse);
  frame.vertex_sd_m.resize(model.NumVertices());
  for (Eigen::Index v = 0; v < model.NumVertices(); ++v) {
    const auto rows = vertices.jacobian.middleRows<3>(3 * v);
    frame.vertex_sd_m[v] = std::sqrt((rows * fit.covariance * rows.transpose()).trace() / 3);
  }
}

/// Pose with the subject's shape, registration and uncertainty of one frame.
FrameFit FinishFrame(const FootModel& model, Side side, std::int64_t trigger, const PointCloud& scan,
                     const PointCloud& thinned, PoseFit fit, const FitOptions& options) {
  FrameFit frame;
  frame.trigger = trigger;
  frame.found = true;
  frame.side = side;
  frame.theta = fit.parameters.theta;
  frame.translation_m = fit.parameters.translation_m;
  frame.vertices_m = Forward(model, fit.parameters).vertices_m;
  AddCovariance(model, thinned, kFine, options.pose, fit);
  SetDeviations(model, fit, frame);

  const Variant variant = model.HasFine() ? Variant::kFine : Variant::kCoarse;
  const TriangleMesh posed = MeshOf(model, variant, Forward(model, fit.parameters, variant).vertices_m);
  const Registration registration = RegisterFree(posed, scan, options.registration);
  frame.registration_fine_m = registration.vertices_m;
  frame.registration_m = registration.vertices_m.topRows(model.NumVertices());
  frame.registration_sd_m = registration.sd_m.head(model.NumVertices());
  frame.residual_m = registration.residual_m;
  if (fit.matched < options.good_matched) {
    frame.verdict = fmt::format("poor fit: only {:.0f} % of the scan explained", 100 * fit.matched);
  } else if (fit.residual_m > options.good_residual_m) {
    frame.verdict = fmt::format("poor fit: {:.1f} mm from the scan", 1e3 * fit.residual_m);
  } else {
    frame.verdict = "good";
  }
  return frame;
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
    if (std::isfinite(fit.cost))
      fit = FitPose(model, scans[f].fine, fit.parameters, With(kFine, false), options.pose);
    else
      fit.parameters = RestParameters(model);
    FrameFit frame = FinishFrame(model, subject.side, triggers[f], clouds[f], scans[f].fine, fit, options);
    previous.reset();
    if (frame.verdict == "good") {
      previous = fit.parameters;
      heading = HeadingOf(fit.parameters);
    }
    sequence.frames.push_back(std::move(frame));
  }
  if (progress) progress(static_cast<int>(clouds.size()), static_cast<int>(clouds.size()));
  return sequence;
}

}  // namespace sole::model
