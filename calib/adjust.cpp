#include "calib/adjust.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include <ceres/ceres.h>

#include "calib/covariance_internal.h"
#include "calib/refractive_cost_internal.h"
#include "core/error.h"

namespace sole::calib {
namespace {

/// An observation with what it belongs to. `frame` is -1 for fiducials.
struct Term {
  int camera;
  int frame;
  PointObservation seen;
  bool active = true;
};

std::vector<Term> Collect(const TakeObservations& observations) {
  std::vector<Term> terms;
  for (std::size_t f = 0; f < observations.frames.size(); ++f) {
    for (std::size_t c = 0; c < observations.frames[f].size(); ++c) {
      const ViewObservations& view = observations.frames[f][c];
      for (const auto& seen : view.target)
        terms.push_back({static_cast<int>(c), static_cast<int>(f), seen});
      for (const auto& seen : view.fiducials) terms.push_back({static_cast<int>(c), -1, seen});
    }
  }
  return terms;
}

bool Keeps(const std::vector<bool>& keep, std::size_t camera) {
  return camera < keep.size() && keep[camera];
}

std::size_t At(int index) { return static_cast<std::size_t>(index); }

/// Parameter blocks around the reference `state`, and the problem made of them. All blocks lie in
/// one array, because Ceres orders them by address and results shall repeat.
class Adjustment {
 public:
  Adjustment(const AdjustState& state, const std::vector<Eigen::Vector3d>& target_corners,
             const std::vector<Eigen::Vector3d>& fiducial_corners, const AdjustOptions& options)
      : state_(state),
        target_corners_(target_corners),
        fiducial_corners_(fiducial_corners),
        options_(options),
        nominal_thickness_m_(state.plate.thickness_m),
        values_(kCameraSize * state.cameras.size() + 1 + kPoseSize * state.world_from_body.size() +
                2 * state.fiducial_offset_m.size()) {
    StateToValues();
  }

  /// Solves for the active terms; `huber_sigmas` 0 means plain least squares.
  ceres::Solver::Summary Solve(const std::vector<Term>& terms, double huber_sigmas) {
    ceres::Problem problem;
    Build(terms, huber_sigmas, problem);
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::SPARSE_SCHUR;
    solver.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (double* block : OtherBlocks(problem))
      solver.linear_solver_ordering->AddElementToGroup(block, 0);
    for (double* block : SharedBlocks()) solver.linear_solver_ordering->AddElementToGroup(block, 1);
    solver.max_num_iterations = options_.max_iterations;
    solver.num_threads = options_.threads;
    solver.function_tolerance = 1e-10;
    solver.parameter_tolerance = 1e-12;
    solver.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);
    ValuesToState();
    StateToValues();
    return summary;
  }

  /// Residual of a term in sigmas; not finite behind the camera.
  Eigen::Vector2d Residual(const Term& term) const {
    const std::array<double, kPoseSize> zero{};
    const Eigen::Vector3d point = term.frame < 0 ? FiducialPoint(term) : TargetPoint(term);
    Eigen::Vector2d r = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
    ProjectionOf(term).Evaluate(zero.data(), state_.cameras[At(term.camera)].intrinsics.data(),
                                state_.plate.thickness_m, point, r.data(), nullptr);
    return r;
  }

  Eigen::MatrixXd Covariance(const std::vector<Term>& terms) {
    ceres::Problem problem;
    Build(terms, 0, problem);
    return MarginalCovariance(problem, SharedBlocks(), OtherBlocks(problem));
  }

  const AdjustState& State() const { return state_; }

 private:
  static constexpr std::size_t kCameraSize = kPoseSize + kNumIntrinsics;

  double* Pose(std::size_t camera) { return &values_[kCameraSize * camera]; }
  double* IntrinsicsOf(std::size_t camera) { return Pose(camera) + kPoseSize; }
  double* Thickness() { return &values_[kCameraSize * state_.cameras.size()]; }
  double* Body(std::size_t frame) { return Thickness() + 1 + kPoseSize * frame; }
  double* Offset(std::size_t fiducial) {
    return Body(state_.world_from_body.size()) + 2 * fiducial;
  }

  Eigen::Vector3d TargetPoint(const Term& term) const {
    return state_.world_from_body[At(term.frame)] * target_corners_[At(term.seen.point)];
  }
  Eigen::Vector3d FiducialPoint(const Term& term) const {
    Eigen::Vector3d point = fiducial_corners_[At(term.seen.point)];
    point.head<2>() += state_.fiducial_offset_m[At(term.seen.point / 4)];
    return point;
  }
  RefractedResidual ProjectionOf(const Term& term) const {
    return {term.seen.pixel, term.seen.sigma_px, state_.plate.index,
            state_.cameras[At(term.camera)].cam_from_world};
  }

  void Build(const std::vector<Term>& terms, double huber_sigmas, ceres::Problem& problem) {
    for (std::size_t c = 0; c < state_.cameras.size();
         ++c) {  // every camera: the covariance has a place for it
      problem.AddParameterBlock(Pose(c), kPoseSize);
      problem.AddParameterBlock(
          IntrinsicsOf(c), kNumIntrinsics,
          options_.estimate_k3 ? nullptr : new ceres::SubsetManifold(kNumIntrinsics, {8}));
      if (Keeps(options_.keep_pose, c)) problem.SetParameterBlockConstant(Pose(c));
      if (Keeps(options_.keep_intrinsics, c)) problem.SetParameterBlockConstant(IntrinsicsOf(c));
    }
    problem.AddParameterBlock(Thickness(), 1);
    for (const Term& term : terms) {
      if (!term.active) continue;
      ceres::LossFunction* loss = huber_sigmas > 0 ? new ceres::HuberLoss(huber_sigmas) : nullptr;
      double* pose = Pose(At(term.camera));
      double* intrinsics = IntrinsicsOf(At(term.camera));
      if (term.frame >= 0) {
        problem.AddResidualBlock(
            new TargetCost(ProjectionOf(term), state_.world_from_body[At(term.frame)],
                           target_corners_[At(term.seen.point)]),
            loss, pose, intrinsics, Body(At(term.frame)), Thickness());
      } else {
        problem.AddResidualBlock(
            new FiducialCost(ProjectionOf(term), fiducial_corners_[At(term.seen.point)]), loss,
            pose, intrinsics, Offset(At(term.seen.point / 4)), Thickness());
      }
    }
    for (std::size_t i = 0; i < state_.fiducial_offset_m.size(); ++i) {
      if (!problem.HasParameterBlock(Offset(i))) continue;
      problem.AddResidualBlock(
          Prior<2>::Create(Eigen::Vector2d::Zero(), options_.fiducial_tolerance_m), nullptr,
          Offset(i));
    }
    problem.AddResidualBlock(Prior<1>::Create(Eigen::Matrix<double, 1, 1>(nominal_thickness_m_),
                                              options_.thickness_tolerance_m),
                             nullptr, Thickness());
    if (!options_.estimate_thickness) problem.SetParameterBlockConstant(Thickness());
  }

  /// Blocks in the order of Calibration::covariance.
  std::vector<double*> SharedBlocks() {
    std::vector<double*> blocks;
    for (std::size_t c = 0; c < state_.cameras.size(); ++c) {
      blocks.push_back(Pose(c));
      blocks.push_back(IntrinsicsOf(c));
    }
    blocks.push_back(Thickness());
    return blocks;
  }

  /// Target poses and fiducials that something was observed of.
  std::vector<double*> OtherBlocks(const ceres::Problem& problem) {
    std::vector<double*> blocks;
    for (std::size_t f = 0; f < state_.world_from_body.size(); ++f) blocks.push_back(Body(f));
    for (std::size_t i = 0; i < state_.fiducial_offset_m.size(); ++i) blocks.push_back(Offset(i));
    std::erase_if(blocks, [&](double* block) { return !problem.HasParameterBlock(block); });
    return blocks;
  }

  void ValuesToState() {
    for (std::size_t c = 0; c < state_.cameras.size(); ++c) {
      Camera& camera = state_.cameras[c];
      camera.cam_from_world = Moved(camera.cam_from_world, Pose(c));
      camera.intrinsics = Eigen::Map<const Intrinsics>(IntrinsicsOf(c));
    }
    state_.plate.thickness_m = *Thickness();
    for (std::size_t f = 0; f < state_.world_from_body.size(); ++f) {
      state_.world_from_body[f] = Moved(state_.world_from_body[f], Body(f));
    }
    for (std::size_t i = 0; i < state_.fiducial_offset_m.size(); ++i) {
      state_.fiducial_offset_m[i] = Eigen::Map<const Eigen::Vector2d>(Offset(i));
    }
  }

  /// Poses are the reference itself, hence zero.
  void StateToValues() {
    std::fill(values_.begin(), values_.end(), 0.0);
    for (std::size_t c = 0; c < state_.cameras.size(); ++c) {
      Eigen::Map<Intrinsics> intrinsics(IntrinsicsOf(c));
      intrinsics = state_.cameras[c].intrinsics;
    }
    *Thickness() = state_.plate.thickness_m;
    for (std::size_t i = 0; i < state_.fiducial_offset_m.size(); ++i) {
      Eigen::Map<Eigen::Vector2d> offset(Offset(i));
      offset = state_.fiducial_offset_m[i];
    }
  }

  AdjustState state_;
  const std::vector<Eigen::Vector3d>& target_corners_;
  const std::vector<Eigen::Vector3d>& fiducial_corners_;
  const AdjustOptions& options_;
  double nominal_thickness_m_;
  std::vector<double> values_;
};

/// Robust scale of the residuals: the median of a chi-squared variable of two degrees of freedom is
/// 2 ln 2.
double RobustSigma0(const Adjustment& adjustment, const std::vector<Term>& terms) {
  std::vector<double> squares;
  for (const Term& term : terms) {
    if (term.active) squares.push_back(adjustment.Residual(term).squaredNorm());
  }
  if (squares.empty()) return 1;
  const auto middle = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
  std::nth_element(squares.begin(), middle, squares.end());
  return std::sqrt(*middle / (2 * std::log(2.0)));
}

/// Below this share of the stated sigmas, residuals are called perfect rather than scaled down
/// further.
constexpr double kLeastSigma0 = 0.1;

/// Marks terms beyond the limit as inactive and others as active; returns how many are inactive.
int SelectInliers(const Adjustment& adjustment, double outlier_sigmas, std::vector<Term>& terms) {
  const double limit = outlier_sigmas * std::max(kLeastSigma0, RobustSigma0(adjustment, terms));
  int dropped = 0;
  for (Term& term : terms) {
    term.active = adjustment.Residual(term).norm() < limit;
    dropped += !term.active;
  }
  return dropped;
}

void FillStatistics(const Adjustment& adjustment, const std::vector<Term>& terms,
                    const AdjustOptions& options, AdjustResult& result) {
  const std::size_t cameras = result.state.cameras.size();
  std::vector<double> sums(cameras, 0);
  result.camera_corners.assign(cameras, 0);
  double weighted = 0;
  int count = 0;
  for (const Term& term : terms) {
    if (!term.active) continue;
    const double square = adjustment.Residual(term).squaredNorm();
    weighted += square;
    sums[At(term.camera)] += square * term.seen.sigma_px * term.seen.sigma_px;
    ++result.camera_corners[At(term.camera)];
    ++count;
  }
  double total = 0;
  for (std::size_t c = 0; c < cameras; ++c) {
    total += sums[c];
    result.camera_rms_px.push_back(std::sqrt(sums[c] / std::max(1, 2 * result.camera_corners[c])));
  }
  result.reprojection_rms_px = std::sqrt(total / std::max(1, 2 * count));
  double unknowns = 6.0 * static_cast<double>(result.state.world_from_body.size());
  for (std::size_t c = 0; c < cameras; ++c) {
    unknowns += Keeps(options.keep_pose, c) ? 0 : 6;
    unknowns += Keeps(options.keep_intrinsics, c) ? 0 : (options.estimate_k3 ? 9 : 8);
  }
  result.sigma0 = std::sqrt(weighted / std::max(1.0, 2.0 * count - unknowns));
}

void RequireConsistent(const AdjustState& start, const TakeObservations& observations,
                       const std::vector<Term>& terms, std::size_t corners,
                       std::size_t fiducial_corners) {
  Require(start.world_from_body.size() == observations.frames.size(),
          "adjustment: " + std::to_string(start.world_from_body.size()) + " target poses for " +
              std::to_string(observations.frames.size()) + " frames");
  Require(4 * start.fiducial_offset_m.size() == fiducial_corners,
          "adjustment: needs one offset per fiducial");
  for (const Term& term : terms) {
    Require(At(term.camera) < start.cameras.size(), "adjustment: observation of an unknown camera");
    const std::size_t limit = term.frame < 0 ? fiducial_corners : corners;
    Require(term.seen.point >= 0 && At(term.seen.point) < limit && term.seen.sigma_px > 0,
            "adjustment: observation of unknown point " + std::to_string(term.seen.point));
  }
}

}  // namespace

AdjustResult Adjust(const AdjustState& start, const TakeObservations& observations,
                    const std::vector<Eigen::Vector3d>& target_corners,
                    const std::vector<Eigen::Vector3d>& fiducial_corners,
                    const AdjustOptions& options) {
  std::vector<Term> terms = Collect(observations);
  RequireConsistent(start, observations, terms, target_corners.size(), fiducial_corners.size());

  Adjustment adjustment(start, target_corners, fiducial_corners, options);
  AdjustResult result;
  ceres::Solver::Summary summary = adjustment.Solve(terms, options.huber_sigmas);
  result.iterations = static_cast<int>(summary.iterations.size());
  for (int round = 0; round < 2; ++round) {
    const int before = result.outliers;
    result.outliers = SelectInliers(adjustment, options.outlier_sigmas, terms);
    if (round > 0 && result.outliers == before) break;
    summary = adjustment.Solve(terms, 0);
    result.iterations += static_cast<int>(summary.iterations.size());
  }
  result.converged = summary.termination_type == ceres::CONVERGENCE;
  result.state = adjustment.State();
  FillStatistics(adjustment, terms, options, result);
  result.covariance = adjustment.Covariance(terms) * (result.sigma0 * result.sigma0);
  return result;
}

}  // namespace sole::calib
