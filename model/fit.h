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

/// Soft contact, 0 to 1, of the N vertices in frame `frame` (index into the clouds): `registered_m` (N x 3) and their `sd_m` (N)
/// as in Registration, `undeformed_m` (N x 3) of the fitted model that was told no contact. World frame.
using ContactLabeller = std::function<Eigen::VectorXd(const Eigen::MatrixX3d& registered_m, const Eigen::VectorXd& sd_m,
                                                      const Eigen::MatrixX3d& undeformed_m, std::size_t frame)>;

struct FitOptions {
  int shape_frames = 4;            ///< frames, spread over the take, whose shapes are averaged into the subject's
  int minimum_points = 1000;       ///< fewer scan points: no foot in the frame
  std::size_t coarse_points = 500; ///< scan points that each stage of the pose fit uses, evenly thinned
  std::size_t middle_points = 1200;
  std::size_t fine_points = 2500;
  double tracked_cost = 0.12;      ///< robust cost above which a frame is also fitted from scratch
  double side_ratio = 0.8;         ///< of the two sides' costs below which the side is decided
  double good_residual_m = 0.0015;
  double good_matched = 0.6;
  ContactLabeller label_contact;   ///< needed by a model whose network is told contact; without it contact is zero
  PoseFitOptions pose;
  RegistrationOptions registration;
};

/// Called after each finished frame with the number done and the number in all.
using FitProgress = std::function<void(int, int)>;

/// Registers and fits one foot over the scans of a take (world frame, one cloud per trigger, in order of time).
/// Some frames spread over the take give side and shape, each from scratch (foot_start.h); shape is then fixed, and
/// every frame starts from the one before. A frame that this does not explain is fitted from scratch, too, and the
/// better one kept. Where the model has a network that is told contact, every frame is registered without contact,
/// labelled on its registration (FitOptions::label_contact) and then fitted with these labels. Registering again from
/// the flattened sole finds more contact each time than there is, so it is not done. `right` and `left` are the two
/// sides of one model; which one it is is decided from the data.
/// Frames without a foot have found = false.
FitSequence FitFrames(const FootModel& right, const FootModel& left, std::span<const PointCloud> clouds,
                      std::span<const std::int64_t> triggers, const FitOptions& options = {},
                      const FitProgress& progress = {});

/// A cloud of about `count` points, by taking every k-th of the finite ones.
PointCloud ThinForFit(const PointCloud& scan, std::size_t count);

}  // namespace sole::model
