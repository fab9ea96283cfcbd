#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <vector>

#include "core/fit_sequence.h"
#include "core/point_cloud.h"
#include "model/fit.h"
#include "model/foot_model.h"
#include "model/pose_fit.h"
#include "model/registration.h"

// Steps of FitFrames: the subject pass (fit_subject.cpp) and what finishes a frame (fit_frame.cpp).

namespace sole::model {

// Annealed schedule: joints and shape with the data ever heavier.
inline constexpr PoseFitStage kCoarse{8, 0.03, 0.008, 0.003, true, true};
inline constexpr PoseFitStage kMiddle{8, 0.012, 0.004, 0.0015, true, true};
inline constexpr PoseFitStage kFine{10, 0.008, 0.002, 0.00025, true, true};

inline PoseFitStage With(PoseFitStage stage, bool free_shape) {
  stage.free_shape = free_shape;
  return stage;
}

struct Sides {
  const FootModel& right;
  const FootModel& left;
  const FootModel& Of(Side side) const { return side == Side::kRight ? right : left; }
};

/// A scan as it came and thinned for each stage.
struct Thinned {
  const PointCloud* all = nullptr;
  PointCloud coarse, middle, fine;
};

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
                          const FitOptions& options);

/// What the subject pass finds: side, shape and the fits it rests on.
struct SubjectFit {
  Side side = Side::kRight;
  Eigen::VectorXd beta, beta_sd;
  std::map<std::size_t, PoseFit> fits;  ///< by frame, of that side
};
SubjectFit FitSubject(const Sides& models, const std::vector<Thinned>& scans,
                      const std::vector<std::size_t>& with_foot, const FitOptions& options);

/// Last stage of a fit with the registration that belongs to it.
struct SettledFit {
  PoseFit fit;
  Registration registration;
};

/// True if the fit is told contact: the model's network is told contact and somebody can label it.
bool UsesContact(const FootModel& model, const FitOptions& options);

/// Fits the last stage and registers, and where the model's network is told contact labels it on the registration
/// and fits the last stage again with these labels.
SettledFit SettleFit(const FootModel& model, std::size_t frame, const Thinned& scan, const PoseFit& start,
                     bool free_shape, const FitOptions& options);

FrameFit EmptyFrame(const FootModel& model, std::int64_t trigger, std::size_t points);

/// Pose with the subject's shape, registration and uncertainty of one frame.
FrameFit FinishFrame(const FootModel& model, Side side, std::int64_t trigger, const Thinned& scan,
                     SettledFit settled, const FitOptions& options);

}  // namespace sole::model
