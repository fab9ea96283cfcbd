#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "core/error.h"
#include "model/contact_network.h"
#include "model/fit_internal.h"
#include "model/forward.h"
#include "model/jacobian.h"

namespace sole::model {

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

namespace {

/// Standard deviations of joints and vertices from the covariance of the parameters.
void SetDeviations(const FootModel& model, const PoseFit& fit, FrameFit& frame) {
  const ParameterColumns columns = ColumnsOf(model, fit.parameters);
  frame.theta_sd.resize(model.NumJoints(), 3);
  for (Eigen::Index j = 0; j < model.NumJoints(); ++j) {
    frame.theta_sd.row(j) = fit.covariance.diagonal().segment<3>(columns.theta + 3 * j).cwiseSqrt();
  }
  // No parameters bring the model nearer than this.
  const double misfit = MisfitOf(fit.residual_m);
  const PointsJacobian vertices = VertexJacobian(model, fit.parameters, Variant::kCoarse);
  frame.vertex_sd_m.resize(model.NumVertices());
  for (Eigen::Index v = 0; v < model.NumVertices(); ++v) {
    const auto rows = vertices.jacobian.middleRows<3>(3 * v);
    frame.vertex_sd_m[v] = std::sqrt((rows * fit.covariance * rows.transpose()).trace() / 3 + misfit * misfit);
  }
}

/// Flesh below the glass (z = 0) is pressed straight up to it, as it is in a foot that comes down; skin beside it leaves the glass
/// smoothly. Sought along the skin's normal, as registration seeks it, it would be found further out on the foot's side. Nothing
/// changes in the air, or where the scan reaches below z = 0 and there is no glass.
TriangleMesh LaidOnGlass(TriangleMesh posed, const PointCloud& scan) {
  constexpr double kSmooth_m = 0.0004;  // the skin then leaves the glass where the model lies 0.5 mm below it
  const auto below = std::count_if(scan.points_m.begin(), scan.points_m.end(), [](const auto& p) { return p.z() < -0.001F; });
  if (static_cast<double>(below) > 0.01 * static_cast<double>(scan.Size())) return posed;
  for (Eigen::Vector3d& v : posed.vertices) {
    if (v.z() < 20 * kSmooth_m) v.z() = kSmooth_m * std::log1p(std::exp(v.z() / kSmooth_m));
  }
  return posed;
}

}  // namespace

bool UsesContact(const FootModel& model, const FitOptions& options) {
  return options.label_contact && KindOfNetwork(model) == NetworkKind::kPoseShapeContact;
}

SettledFit SettleFit(const FootModel& model, std::size_t frame, const Thinned& scan, const PoseFit& start,
                     bool free_shape, const FitOptions& options) {
  const Variant variant = model.HasFine() ? Variant::kFine : Variant::kCoarse;
  SettledFit settled{start, {}};
  ModelParameters& parameters = settled.fit.parameters;
  parameters.contact.resize(0);  // that of the frame before would be found again
  settled.fit = FitPose(model, scan.fine, parameters, With(kFine, free_shape), options.pose);
  const TriangleMesh posed = MeshOf(model, variant, Forward(model, parameters, variant).vertices_m);
  settled.registration = RegisterFree(LaidOnGlass(posed, scan.fine), *scan.all, options.registration);
  if (!UsesContact(model, options)) return settled;
  const Eigen::Index n = model.NumVertices();
  const Eigen::VectorXd labels = options.label_contact(settled.registration.vertices_m.topRows(n),
                                                       settled.registration.sd_m.head(n),
                                                       Forward(model, parameters).vertices_m, frame);
  Require(labels.size() == n && labels.allFinite(),
          fmt::format("fit: the labels of frame {} are not {} finite values", frame, n));
  if (labels.maxCoeff() < 0.5) return settled;
  parameters.contact = labels.cwiseMax(0).cwiseMin(1);
  settled.fit = FitPose(model, scan.fine, parameters, With(kFine, free_shape), options.pose);
  return settled;
}

FrameFit FinishFrame(const FootModel& model, Side side, std::int64_t trigger, const Thinned& scan,
                     SettledFit settled, const FitOptions& options) {
  PoseFit& fit = settled.fit;
  const Registration& registration = settled.registration;
  FrameFit frame;
  frame.trigger = trigger;
  frame.found = true;
  frame.side = side;
  frame.theta = fit.parameters.theta;
  frame.translation_m = fit.parameters.translation_m;
  frame.contact = fit.parameters.contact;
  frame.vertices_m = Forward(model, fit.parameters).vertices_m;
  AddCovariance(model, scan.fine, kFine, options.pose, fit);
  SetDeviations(model, fit, frame);

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

}  // namespace sole::model
