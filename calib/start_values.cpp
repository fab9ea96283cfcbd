#include "calib/start_values.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "core/error.h"

namespace sole::calib {
namespace {

constexpr std::size_t kMinPnpCorners = 6;

Rigid3 RigidFromCv(const cv::Mat& rvec, const cv::Mat& tvec) {
  const Eigen::Vector3d w(rvec.at<double>(0), rvec.at<double>(1), rvec.at<double>(2));
  const double angle = w.norm();
  Rigid3 pose;
  if (angle > 0) pose.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(angle, w / angle));
  pose.translation = {tvec.at<double>(0), tvec.at<double>(1), tvec.at<double>(2)};
  return pose;
}

bool AllInOnePlane(const std::vector<Eigen::Vector3d>& points) {
  Eigen::MatrixX3d centred(static_cast<Eigen::Index>(points.size()), 3);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& point : points) mean += point / static_cast<double>(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    centred.row(static_cast<Eigen::Index>(i)) = (points[i] - mean).transpose();
  }
  const Eigen::Matrix3d scatter = centred.transpose() * centred;
  const Eigen::Vector3d values =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvalues();
  return values[0] < 1e-8 * values[2];
}

/// Candidate poses (camera from the points' frame), best first; empty if the points do not suffice.
/// The plate is ignored.
std::vector<Rigid3> SolvePnp(const Camera& camera, const std::vector<Eigen::Vector3d>& points,
                             const std::vector<Eigen::Vector2d>& pixels) {
  if (points.size() < kMinPnpCorners) return {};
  std::vector<cv::Point3d> object;
  std::vector<cv::Point2d> image;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d n = NormalizedFromPixel(camera.intrinsics, pixels[i]);
    object.emplace_back(points[i].x(), points[i].y(), points[i].z());
    image.emplace_back(n.x(), n.y());
  }
  const cv::Mat identity = cv::Mat::eye(3, 3, CV_64F);
  std::vector<cv::Mat> rvecs, tvecs;
  const int method = AllInOnePlane(points) ? cv::SOLVEPNP_IPPE : cv::SOLVEPNP_SQPNP;
  std::vector<Rigid3> poses;
  try {
    cv::solvePnPGeneric(object, image, identity, cv::noArray(), rvecs, tvecs, false,
                        static_cast<cv::SolvePnPMethod>(method));
    for (std::size_t i = 0; i < rvecs.size(); ++i) {
      cv::solvePnPRefineLM(object, image, identity, cv::noArray(), rvecs[i], tvecs[i]);
      const Rigid3 pose = RigidFromCv(rvecs[i], tvecs[i]);
      if (pose.translation.allFinite() && pose.translation.z() > 0) poses.push_back(pose);
    }
  } catch (const cv::Exception&) {  // degenerate points: no candidate
    return {};
  }
  return poses;
}

/// Median pixel of each fiducial corner over all frames.
std::map<int, Eigen::Vector2d> FiducialMedians(const TakeObservations& observations,
                                               std::size_t camera) {
  std::map<int, std::pair<std::vector<double>, std::vector<double>>> seen;
  for (const auto& frame : observations.frames) {
    for (const PointObservation& o : frame[camera].fiducials) {
      seen[o.point].first.push_back(o.pixel.x());
      seen[o.point].second.push_back(o.pixel.y());
    }
  }
  std::map<int, Eigen::Vector2d> medians;
  for (auto& [point, values] : seen) {
    const auto median = [](std::vector<double>& v) {
      const auto middle = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
      std::nth_element(v.begin(), middle, v.end());
      return *middle;
    };
    medians[point] = {median(values.first), median(values.second)};
  }
  return medians;
}

double CostOf(const AdjustState& state, std::size_t camera, const Eigen::Vector3d& point,
              const Eigen::Vector2d& pixel) {
  const double distance =
      (PixelFromWorld(state.cameras[camera], state.plate, point) - pixel).norm() / 20.0;
  return distance < 1 ? distance * distance : 1.0;  // NaN counts 1
}

/// Pose from the fiducials alone. The plate enters by moving the points to where they appear from
/// the current centre, three times over.
std::optional<Rigid3> PoseFromFiducials(AdjustState state, std::size_t camera,
                                        const std::map<int, Eigen::Vector2d>& medians,
                                        const std::vector<Eigen::Vector3d>& corners) {
  if (medians.size() < 8) return {};
  std::vector<Eigen::Vector3d> world;
  std::vector<Eigen::Vector2d> pixels;
  for (const auto& [point, pixel] : medians) {
    world.push_back(corners[static_cast<std::size_t>(point)]);
    pixels.push_back(pixel);
  }
  std::optional<Rigid3> best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (Rigid3 pose : SolvePnp(state.cameras[camera], world, pixels)) {
    for (int iteration = 0; iteration < 3; ++iteration) {
      std::vector<Eigen::Vector3d> apparent;
      for (const auto& point : world) {
        apparent.push_back(ApparentPoint(state.plate, pose.Inverse().translation, point));
      }
      const std::vector<Rigid3> again = SolvePnp(state.cameras[camera], apparent, pixels);
      if (again.empty()) break;
      // Of the two solutions of a plane, follow the one we came from.
      pose = *std::min_element(again.begin(), again.end(), [&](const Rigid3& a, const Rigid3& b) {
        return a.rotation.angularDistance(pose.rotation) <
               b.rotation.angularDistance(pose.rotation);
      });
    }
    state.cameras[camera].cam_from_world = pose;
    double cost = 0;
    for (std::size_t i = 0; i < world.size(); ++i)
      cost += CostOf(state, camera, world[i], pixels[i]);
    if (cost < best_cost) {
      best_cost = cost;
      best = pose;
    }
  }
  return best;
}

/// cam_from_body candidates of every frame and camera.
using PnpTable = std::vector<std::vector<std::vector<Rigid3>>>;

PnpTable SolveAllTargets(const AdjustState& state, const TakeObservations& observations,
                         const std::vector<Eigen::Vector3d>& target_corners) {
  PnpTable table;
  for (const auto& frame : observations.frames) {
    auto& row = table.emplace_back();
    for (std::size_t c = 0; c < state.cameras.size(); ++c) {
      std::vector<Eigen::Vector3d> points;
      std::vector<Eigen::Vector2d> pixels;
      for (const PointObservation& o : frame[c].target) {
        points.push_back(target_corners[static_cast<std::size_t>(o.point)]);
        pixels.push_back(o.pixel);
      }
      row.push_back(SolvePnp(state.cameras[c], points, pixels));
    }
  }
  return table;
}

class Placer {
 public:
  Placer(AdjustState& state, const TakeObservations& observations,
         const std::vector<Eigen::Vector3d>& target_corners, std::vector<bool> placed)
      : state_(state),
        observations_(observations),
        corners_(target_corners),
        placed_(std::move(placed)),
        has_pose_(observations.frames.size(), false),
        table_(SolveAllTargets(state, observations, target_corners)) {}

  /// Target poses from the placed cameras: the candidate that fits all of them best.
  void PlaceTargets() {
    for (std::size_t f = 0; f < table_.size(); ++f) {
      double best = std::numeric_limits<double>::infinity();
      for (std::size_t c = 0; c < placed_.size(); ++c) {
        if (!placed_[c]) continue;
        for (const Rigid3& cam_from_body : table_[f][c]) {
          const Rigid3 candidate = state_.cameras[c].cam_from_world.Inverse() * cam_from_body;
          const double cost =
              PoseCost(state_, observations_.frames[f], corners_, candidate, placed_);
          if (cost < best) {
            best = cost;
            state_.world_from_body[f] = candidate;
            has_pose_[f] = true;
          }
        }
      }
    }
  }

  /// Places the cameras that share a target pose with placed ones. Returns how many.
  int PlaceCameras() {
    int count = 0;
    for (std::size_t c = 0; c < placed_.size(); ++c) {
      if (placed_[c]) continue;
      double best = std::numeric_limits<double>::infinity();
      Rigid3 best_pose;
      for (std::size_t f = 0; f < table_.size(); ++f) {
        if (!has_pose_[f]) continue;
        for (const Rigid3& cam_from_body : table_[f][c]) {
          state_.cameras[c].cam_from_world = cam_from_body * state_.world_from_body[f].Inverse();
          const double cost = CostOverFrames(c);
          if (cost < best) {
            best = cost;
            best_pose = state_.cameras[c].cam_from_world;
          }
        }
      }
      if (!std::isfinite(best)) continue;
      state_.cameras[c].cam_from_world = best_pose;
      newly_placed_.push_back(c);
      ++count;
    }
    for (const std::size_t c : newly_placed_) placed_[c] = true;
    newly_placed_.clear();
    return count;
  }

  const std::vector<bool>& Placed() const { return placed_; }

 private:
  double CostOverFrames(std::size_t camera) const {
    std::vector<bool> only(placed_.size(), false);
    only[camera] = true;
    double cost = 0;
    for (std::size_t f = 0; f < table_.size(); ++f) {
      if (has_pose_[f]) {
        cost +=
            PoseCost(state_, observations_.frames[f], corners_, state_.world_from_body[f], only);
      }
    }
    return cost;
  }

  AdjustState& state_;
  const TakeObservations& observations_;
  const std::vector<Eigen::Vector3d>& corners_;
  std::vector<bool> placed_;
  std::vector<bool> has_pose_;
  PnpTable table_;
  std::vector<std::size_t> newly_placed_;
};

AdjustState NominalState(const RigConfig& config, std::size_t frames) {
  AdjustState state;
  state.plate = {config.plate.thickness_m, config.plate.index};
  state.world_from_body.resize(frames);
  state.fiducial_offset_m.assign(config.plate.fiducials.size(), Eigen::Vector2d::Zero());
  for (const CameraConfig& nominal : config.cameras) {
    Camera camera{nominal.serial, nominal.width, nominal.height, Intrinsics::Zero(), {}};
    camera.intrinsics.head<4>() << nominal.focal_px, nominal.focal_px, 0.5 * (nominal.width - 1),
        0.5 * (nominal.height - 1);
    state.cameras.push_back(camera);
  }
  return state;
}

}  // namespace

double PoseCost(const AdjustState& state, const std::vector<ViewObservations>& frame,
                const std::vector<Eigen::Vector3d>& target_corners, const Rigid3& world_from_body,
                const std::vector<bool>& use_camera) {
  double cost = 0;
  for (std::size_t c = 0; c < frame.size(); ++c) {
    if (!use_camera[c]) continue;
    for (const PointObservation& o : frame[c].target) {
      const Eigen::Vector3d& corner = target_corners[static_cast<std::size_t>(o.point)];
      cost += CostOf(state, c, world_from_body * corner, o.pixel);
    }
  }
  return cost;
}

void PlaceTargets(AdjustState& state, const TakeObservations& observations,
                  const std::vector<Eigen::Vector3d>& target_corners) {
  Placer(state, observations, target_corners, std::vector<bool>(state.cameras.size(), true))
      .PlaceTargets();
}

std::vector<bool> PlaceAll(AdjustState& state, const TakeObservations& observations,
                           const std::vector<Eigen::Vector3d>& target_corners,
                           const std::vector<bool>& placed) {
  Placer placer(state, observations, target_corners, placed);
  placer.PlaceTargets();
  while (placer.PlaceCameras() > 0) placer.PlaceTargets();
  return placer.Placed();
}

AdjustState StartValues(const RigConfig& config, const TakeObservations& observations,
                        const std::vector<Eigen::Vector3d>& target_corners,
                        const std::vector<Eigen::Vector3d>& fiducial_corners) {
  AdjustState state = NominalState(config, observations.frames.size());
  std::vector<bool> placed(state.cameras.size(), false);
  for (std::size_t c = 0; c < state.cameras.size(); ++c) {
    const auto pose =
        PoseFromFiducials(state, c, FiducialMedians(observations, c), fiducial_corners);
    if (!pose) continue;
    state.cameras[c].cam_from_world = *pose;
    placed[c] = true;
  }
  Require(
      std::find(placed.begin(), placed.end(), true) != placed.end(),
      "calibration: no camera sees two fiducials of the plate, which define the world frame; check "
      "[[plate.fiducial]] in the rig file, light and focus");
  placed = PlaceAll(state, observations, target_corners, placed);
  for (std::size_t c = 0; c < state.cameras.size(); ++c) {
    Require(placed[c],
            "calibration: camera " + state.cameras[c].serial +
                " sees no fiducials and no target pose that a placed camera sees; record "
                "poses that it shares with another camera");
  }
  return state;
}

}  // namespace sole::calib
