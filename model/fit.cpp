#include "model/fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "core/error.h"
#include "model/forward.h"
#include "model/jacobian.h"

namespace sole::model {
namespace {

// Annealed schedule: the whole foot rigidly, then joints and shape with the data ever heavier.
constexpr PoseFitStage kAlign{8, 0.04, 0.015, 0.004, false, false};
constexpr PoseFitStage kCoarse{8, 0.025, 0.008, 0.003, true, true};
constexpr PoseFitStage kMiddle{8, 0.012, 0.004, 0.0015, true, true};
constexpr PoseFitStage kFine{10, 0.008, 0.002, 0.00025, true, true};

PoseFitStage FixedShape(PoseFitStage stage) {
  stage.free_shape = false;
  return stage;
}

struct SidedFit {
  Side side = Side::kRight;
  PoseFit fit;
};

/// Start with the foot's long axis along `heading_rad` (angle of the toes from +y, counter-clockwise), its box
/// over the scan's box and its lowest point on the scan's lowest.
ModelParameters StartAt(const FootModel& model, const PointCloud& scan, double heading_rad,
                        const Eigen::VectorXd& beta) {
  ModelParameters start = RestParameters(model);
  start.beta = beta;
  start.theta.row(0) = Eigen::RowVector3d(0, 0, heading_rad);
  const Eigen::MatrixX3d vertices = Forward(model, start).vertices_m;
  Eigen::AlignedBox3d scan_box;
  for (const Eigen::Vector3f& p : scan.points_m) scan_box.extend(p.cast<double>());
  const Eigen::Vector3d low = vertices.colwise().minCoeff(), high = vertices.colwise().maxCoeff();
  start.translation_m = scan_box.center() - 0.5 * (low + high);
  start.translation_m.z() = scan_box.min().z() - low.z();
  return start;
}

/// Angle of the scan's long horizontal axis from +y, in (-pi/2, pi/2].
double LongAxis(const PointCloud& scan) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector3f& p : scan.points_m) mean += p.head<2>().cast<double>();
  mean /= static_cast<double>(scan.Size());
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector3f& p : scan.points_m) {
    const Eigen::Vector2d d = p.head<2>().cast<double>() - mean;
    scatter += d * d.transpose();
  }
  const Eigen::Vector2d axis = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(scatter).eigenvectors().col(1);
  const double angle = std::atan2(-axis.x(), axis.y());
  return angle > M_PI / 2 ? angle - M_PI : angle <= -M_PI / 2 ? angle + M_PI : angle;
}

/// Both sides, toes at either end: the start whose fit explains most of the scan.
SidedFit FitFromScratch(const FootModel& right, const FootModel& left, const PointCloud& scan,
                        std::optional<Side> known_side, const FitOptions& options) {
  const double axis = LongAxis(scan);
  SidedFit best;
  best.fit.cost = std::numeric_limits<double>::infinity();
  for (const Side side : {Side::kRight, Side::kLeft}) {
    if (known_side && side != *known_side) continue;
    const FootModel& model = side == Side::kRight ? right : left;
    for (const double heading : {axis, axis + M_PI}) {
      const ModelParameters start = StartAt(model, scan, heading, Eigen::VectorXd::Zero(model.NumBetas()));
      PoseFit fit = FitPose(model, scan, start, kAlign, options.pose);
      fit = FitPose(model, scan, fit.parameters, kCoarse, options.pose);
      if (fit.cost < best.fit.cost) best = {side, fit};
    }
  }
  const FootModel& model = best.side == Side::kRight ? right : left;
  best.fit = FitPose(model, scan, best.fit.parameters, kMiddle, options.pose);
  best.fit = FitPose(model, scan, best.fit.parameters, kFine, options.pose);
  return best;
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

PointCloud ThinForFit(const PointCloud& scan, double height_m, std::size_t count) {
  PointCloud thinned;
  if (scan.Size() == 0) return thinned;
  std::vector<float> heights;
  heights.reserve(scan.Size());
  for (const Eigen::Vector3f& p : scan.points_m) heights.push_back(p.z());
  const auto low = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 100);
  std::nth_element(heights.begin(), low, heights.end());
  const float limit = *low + static_cast<float>(height_m);
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < scan.Size(); ++i) {
    if (scan.points_m[i].z() <= limit && scan.points_m[i].allFinite()) kept.push_back(i);
  }
  const double step = std::max(1.0, static_cast<double>(kept.size()) / static_cast<double>(count));
  for (double at = 0; at < static_cast<double>(kept.size()); at += step) {
    const std::size_t i = kept[static_cast<std::size_t>(at)];
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
  std::vector<PointCloud> thinned;
  for (const PointCloud& cloud : clouds) {
    thinned.push_back(ThinForFit(cloud, options.model_height_m, options.fit_points));
  }
  const auto has_foot = [&](std::size_t f) {
    return clouds[f].Size() >= static_cast<std::size_t>(options.minimum_points);
  };

  // Subject pass: shape and side from the first frames with a foot.
  std::vector<std::optional<PoseFit>> fits(clouds.size());
  std::optional<Side> side;
  Eigen::VectorXd beta_sum = Eigen::VectorXd::Zero(right.NumBetas());
  int shapes = 0;
  int done = 0;
  std::optional<ModelParameters> latest;
  for (std::size_t f = 0; f < clouds.size() && shapes < options.shape_frames; ++f) {
    if (!has_foot(f)) {
      latest.reset();
      continue;
    }
    PoseFit fit;
    if (latest) {
      fit = FitPose(side == Side::kLeft ? left : right, thinned[f], *latest, kMiddle, options.pose);
      fit = FitPose(side == Side::kLeft ? left : right, thinned[f], fit.parameters, kFine, options.pose);
    } else {
      const SidedFit sided = FitFromScratch(right, left, thinned[f], side, options);
      side = sided.side;
      fit = sided.fit;
    }
    latest = fit.parameters;
    fits[f] = fit;
    beta_sum += fit.parameters.beta;
    ++shapes;
    if (progress) progress(++done, static_cast<int>(clouds.size()));
  }

  FitSequence sequence;
  sequence.beta = shapes ? Eigen::VectorXd(beta_sum / shapes) : beta_sum;
  sequence.beta_sd = Eigen::VectorXd::Ones(sequence.beta.size());
  const FootModel& model = side == Side::kLeft ? left : right;

  // Sequence pass: the subject's shape, each frame from the one before it.
  std::optional<ModelParameters> previous;
  for (std::size_t f = 0; f < clouds.size(); ++f) {
    if (!has_foot(f)) {
      sequence.frames.push_back(EmptyFrame(model, triggers[f], clouds[f].Size()));
      previous.reset();
      continue;
    }
    const bool started = fits[f].has_value();
    ModelParameters start = started    ? fits[f]->parameters
                            : previous ? *previous
                                       : FitFromScratch(right, left, thinned[f], side, options).fit.parameters;
    start.beta = sequence.beta;
    PoseFit fit = FitPose(model, thinned[f], start, FixedShape(kMiddle), options.pose);
    fit = FitPose(model, thinned[f], fit.parameters, FixedShape(kFine), options.pose);
    FrameFit frame = FinishFrame(model, *side, triggers[f], clouds[f], thinned[f], fit, options);
    if (frame.verdict == "good") {
      previous = fit.parameters;
    } else {
      previous.reset();
    }
    sequence.frames.push_back(std::move(frame));
    if (!started && progress) progress(++done, static_cast<int>(clouds.size()));
  }
  if (shapes > 0) {
    const std::size_t first = static_cast<std::size_t>(
        std::find_if(fits.begin(), fits.end(), [](const auto& fit) { return fit.has_value(); }) - fits.begin());
    PoseFit at = *fits[first];
    AddCovariance(model, thinned[first], kFine, options.pose, at);
    const ParameterColumns columns = ColumnsOf(model, at.parameters);
    sequence.beta_sd =
        (at.covariance.diagonal().segment(columns.beta, sequence.beta.size()) / shapes).cwiseSqrt();
  }
  return sequence;
}

}  // namespace sole::model
