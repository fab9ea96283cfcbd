#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "core/fit_sequence.h"
#include "core/point_cloud.h"
#include "model/foot_model.h"
#include "model/pose_fit.h"
#include "model/registration.h"

namespace sole::model {

struct FitOptions {
  int shape_frames = 5;          ///< frames whose shapes are averaged into the subject's
  int minimum_points = 1000;     ///< fewer scan points in the model's reach: no foot in the frame
  double model_height_m = 0.11;  ///< scan points higher than this above the lowest belong to the shank
  std::size_t fit_points = 4000; ///< scan points the pose fit uses, evenly thinned
  double good_residual_m = 0.0015;
  double good_matched = 0.6;
  PoseFitOptions pose;
  RegistrationOptions registration;
};

/// Called after each finished frame with the number done and the number in all.
using FitProgress = std::function<void(int, int)>;

/// Registers and fits one foot over the scans of a take (world frame, one cloud per trigger, in order of time). The
/// first frames give the subject's shape, side and pose from several starts; shape is then fixed and every
/// frame starts from the one before. `right` and `left` are the two sides of one model; which one it is
/// is decided from the data. Frames without a foot have found = false.
FitSequence FitFrames(const FootModel& right, const FootModel& left, std::span<const PointCloud> clouds,
                      std::span<const std::int64_t> triggers, const FitOptions& options = {},
                      const FitProgress& progress = {});

/// Every part of a scan that a foot model can explain: points up to `height_m` above the lowest percentile, thinned to about
/// `count` by taking every k-th.
PointCloud ThinForFit(const PointCloud& scan, double height_m, std::size_t count);

}  // namespace sole::model
