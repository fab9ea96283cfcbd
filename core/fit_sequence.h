#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace sole {

enum class Side { kRight, kLeft };

/// What is known of a vertex's contact.
enum class ContactState : std::uint8_t { kFree, kContact, kUncertain };

/// Contact of one frame, per template vertex (N). Vertices that were not registered are NaN in gap_m,
/// 0 in bits.
struct FrameContact {
  std::vector<std::uint8_t> contact;  ///< 1 where gap_m < 0.0001, doubtful ones as the frames around say
  Eigen::VectorXd probability;        ///< P(gap < 0.1 mm | sigma), doubtful ones given the frames around
  Eigen::VectorXd gap_m;              ///< signed height above the local glass
  std::vector<ContactState> state = {};  ///< or empty
  double slip_m = std::numeric_limits<double>::quiet_NaN();  ///< of touching vertices since the frame before, mean
  double penetration_m = std::numeric_limits<double>::quiet_NaN();  ///< of touching vertices under the glass, mean
};

/// Ground surface of one frame: z = offset_m + slope_x * x + slope_y * y in the world frame.
struct GroundPlane {
  double offset_m = 0;
  double slope_x = 0;
  double slope_y = 0;
  double sigma_m = 0;  ///< standard deviation of the offset
  int points = 0;      ///< platform points it rests on; 0 = the calibrated plane was taken
};

/// Fit of one foot in one frame. A frame without a foot has found = false and NaN values.
struct FrameFit {
  std::int64_t trigger = 0;
  bool found = false;
  Side side = Side::kRight;
  Eigen::MatrixX3d theta;               ///< K x 3 axis-angle, rad
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
  Eigen::VectorXd contact;              ///< N, soft contact that the model was told; empty: none
  Eigen::MatrixX3d vertices_m;          ///< N x 3, the posed model, world frame
  Eigen::MatrixX3d registration_m;      ///< N x 3, free registration
  Eigen::MatrixX3d registration_fine_m; ///< N_fine x 3
  Eigen::VectorXd registration_sd_m;    ///< N, along the normal; large where the scan has no points
  Eigen::MatrixX3d theta_sd;            ///< K x 3
  Eigen::VectorXd vertex_sd_m;          ///< N
  double residual_m = 0;                ///< mean scan-to-surface distance of the registration
  std::string verdict;                  ///< "good" or why not
};

/// Fits of one foot over a take; shape is shared by all frames.
struct FitSequence {
  Eigen::VectorXd beta;
  Eigen::VectorXd beta_sd;
  std::vector<FrameFit> frames;
};

}  // namespace sole
