#include "calib/colmap_rig.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <string>

#include "core/error.h"

namespace sole::calib {
namespace {

constexpr std::size_t kMinCorners = 8;  // of the target or the fiducials, to fit a frame to them

/// Part of an image's name that tells the pose: what follows the camera's prefix.
std::string PoseOf(const io::ColmapImage& image) { return image.name.substr(image.name.find('/') + 1); }

/// Which point of the problem each solved point is: the one that most of its pixels show; of several
/// solved points that are the same, only the one with most pixels counts. -1: of none.
std::vector<int> IdentifyPoints(const io::ColmapModel& solved,
                                const std::vector<const io::ColmapImage*>& given) {
  std::vector<std::map<int, int>> votes(solved.points.size());
  for (std::size_t i = 0; i < solved.images.size(); ++i) {
    for (std::size_t k = 0; k < given[i]->pixels.size(); ++k) {
      const int point = solved.images[i].pixels[k].point;
      if (point >= 0) ++votes[static_cast<std::size_t>(point)][given[i]->pixels[k].point];
    }
  }
  std::vector<int> identity(solved.points.size(), -1);
  std::map<int, std::pair<int, std::size_t>> best;  // problem point -> votes, solved point
  for (std::size_t p = 0; p < votes.size(); ++p) {
    for (const auto& [point, count] : votes[p]) {
      auto& found = best.try_emplace(point, 0, 0).first->second;
      if (count > found.first) found = {count, p};
    }
  }
  for (const auto& [point, found] : best) identity[found.second] = point;
  return identity;
}

/// Distances of a camera's pixels from where their points should be, over all its images.
std::vector<std::vector<double>> ResidualsOf(const io::ColmapModel& solved) {
  std::vector<std::vector<double>> residuals(solved.cameras.size());
  for (const io::ColmapImage& image : solved.images) {
    const auto camera = static_cast<std::size_t>(image.camera);
    for (const io::ColmapPixel& seen : image.pixels) {
      if (seen.point < 0) continue;
      const Eigen::Vector3d p = image.cam_from_world * solved.points[static_cast<std::size_t>(seen.point)].point_m;
      residuals[camera].push_back(
          (PixelFromPointInCam<double>(solved.cameras[camera].intrinsics.data(), p) - seen.pixel).norm());
    }
  }
  return residuals;
}

/// Per image coordinate; NaN for none.
double RmsPx(const std::vector<double>& residuals) {
  const double squares = std::inner_product(residuals.begin(), residuals.end(), residuals.begin(), 0.0);
  return std::sqrt(squares / (2 * static_cast<double>(residuals.size())));
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// known = scale * rotation * solved + translation, by least squares; points three times further off
/// than most are left out of a second fit.
struct Similarity {
  double scale = 1;
  Rigid3 known_from_solved;  ///< after scaling
  double rms_m = 0;

  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const {
    return known_from_solved * (scale * point);
  }
};

Similarity FitOnce(const std::vector<Eigen::Vector3d>& solved, const std::vector<Eigen::Vector3d>& known,
                   bool with_scale) {
  const auto n = static_cast<Eigen::Index>(solved.size());
  const Eigen::Map<const Eigen::Matrix3Xd> from(solved.front().data(), 3, n), to(known.front().data(), 3, n);
  const Eigen::Matrix4d m = Eigen::umeyama(from, to, with_scale);
  Similarity fit;
  fit.scale = std::cbrt(m.topLeftCorner<3, 3>().determinant());
  fit.known_from_solved = {Eigen::Quaterniond(Eigen::Matrix3d(m.topLeftCorner<3, 3>() / fit.scale)).normalized(),
                           m.topRightCorner<3, 1>()};
  for (std::size_t i = 0; i < solved.size(); ++i) fit.rms_m += (fit * solved[i] - known[i]).squaredNorm();
  fit.rms_m = std::sqrt(fit.rms_m / static_cast<double>(n));
  return fit;
}

Similarity Fit(const std::vector<Eigen::Vector3d>& solved, const std::vector<Eigen::Vector3d>& known,
               bool with_scale) {
  const Similarity first = FitOnce(solved, known, with_scale);
  std::vector<double> distances;
  for (std::size_t i = 0; i < solved.size(); ++i) distances.push_back((first * solved[i] - known[i]).norm());
  const double limit = 3 * Median(distances);
  std::vector<Eigen::Vector3d> good_solved, good_known;
  for (std::size_t i = 0; i < solved.size(); ++i) {
    if (distances[i] > limit) continue;
    good_solved.push_back(solved[i]);
    good_known.push_back(known[i]);
  }
  return good_solved.size() < kMinCorners ? first : FitOnce(good_solved, good_known, with_scale);
}

using PoseTable = std::map<std::string, std::map<int, Rigid3>>;  // pose -> camera -> cam_from_body

}  // namespace

std::optional<double> OutlierLimitPx(const io::ColmapModel& solved) {
  std::vector<double> all;
  for (const std::vector<double>& of_camera : ResidualsOf(solved)) all.insert(all.end(), of_camera.begin(), of_camera.end());
  if (all.empty()) return {};
  const double limit = std::max(5 * Median(all), 0.1);
  return *std::max_element(all.begin(), all.end()) > limit ? std::optional(limit) : std::nullopt;
}

int ReferenceCamera(const io::ColmapModel& solved) {
  std::map<std::string, std::set<int>> poses;
  for (const io::ColmapImage& image : solved.images) poses[PoseOf(image)].insert(image.camera);
  std::vector<std::pair<std::size_t, int>> score;  // cameras it shares a pose with, images
  for (int c = 0; c < static_cast<int>(solved.cameras.size()); ++c) {
    std::set<int> shared;
    int images = 0;
    for (const auto& [pose, cameras] : poses) {
      if (!cameras.contains(c)) continue;
      shared.insert(cameras.begin(), cameras.end());
      ++images;
    }
    score.emplace_back(shared.size(), images);
  }
  return static_cast<int>(std::max_element(score.begin(), score.end()) - score.begin());
}

ColmapRig ReadColmapRig(const io::ColmapModel& problem, const io::ColmapModel& solved,
                        const RigConfig& config) {
  std::map<std::string, const io::ColmapImage*> by_name;
  for (const io::ColmapImage& image : problem.images) by_name[image.name] = &image;
  std::vector<const io::ColmapImage*> given;
  for (const io::ColmapImage& image : solved.images) {
    const auto found = by_name.find(image.name);
    Require(found != by_name.end() && found->second->pixels.size() == image.pixels.size() &&
                found->second->camera == image.camera && solved.cameras.size() == problem.cameras.size(),
            "COLMAP's result has an image " + image.name + " that it was not given");
    given.push_back(found->second);
  }
  const std::vector<int> identity = IdentifyPoints(solved, given);
  const std::size_t corners = problem.points.size() - FiducialCornerPoints(config.plate).size();
  std::vector<Eigen::Vector3d> target, target_known, fiducials, fiducials_known;
  for (std::size_t p = 0; p < identity.size(); ++p) {
    if (identity[p] < 0) continue;
    const auto known = static_cast<std::size_t>(identity[p]);
    (known < corners ? target : fiducials).push_back(solved.points[p].point_m);
    (known < corners ? target_known : fiducials_known).push_back(problem.points[known].point_m);
  }
  Require(target.size() >= kMinCorners,
          "COLMAP found " + std::to_string(target.size()) + " corners of the target, needs " +
              std::to_string(kMinCorners) + "; record more poses, turned further");
  const Similarity body = Fit(target, target_known, true);

  // Poses in the target's frame and metres; what a pose of the target is to the first one.
  PoseTable poses;
  std::string fiducial_pose;
  for (std::size_t i = 0; i < solved.images.size(); ++i) {
    Rigid3 metric = solved.images[i].cam_from_world;
    metric.translation *= body.scale;
    poses[PoseOf(solved.images[i])][solved.images[i].camera] = metric * body.known_from_solved.Inverse();
    for (const io::ColmapPixel& seen : given[i]->pixels) {
      if (seen.point >= static_cast<int>(corners)) fiducial_pose = PoseOf(solved.images[i]);
    }
  }
  const int reference = ReferenceCamera(solved);
  std::vector<std::optional<Rigid3>> cam_from_reference(solved.cameras.size());
  std::string base;  // the pose in whose target frame the rig is described
  for (const auto& [pose, cameras] : poses) {
    const auto at = cameras.find(reference);
    if (at == cameras.end()) continue;
    if (base.empty() || pose == fiducial_pose) base = pose;
    for (const auto& [camera, cam_from_body] : cameras) {
      auto& relative = cam_from_reference[static_cast<std::size_t>(camera)];
      if (!relative) relative = cam_from_body * at->second.Inverse();
    }
  }
  const Rigid3 reference_from_base = poses.at(base).at(reference);

  ColmapRig rig;
  for (Eigen::Vector3d& point : fiducials) point = body * point;
  const bool in_world = base == fiducial_pose && fiducials.size() >= kMinCorners;
  Rigid3 world_from_base;
  rig.fiducial_rms_mm = std::numeric_limits<double>::quiet_NaN();
  if (in_world) {
    const Similarity fit = Fit(fiducials, fiducials_known, false);
    world_from_base = fit.known_from_solved;
    rig.fiducial_rms_mm = 1000 * fit.rms_m;
  }
  rig.in_world = in_world;
  rig.images = static_cast<int>(problem.images.size());
  rig.images_placed = static_cast<int>(solved.images.size());
  rig.target_rms_mm = 1000 * body.rms_m;
  const std::vector<std::vector<double>> residuals = ResidualsOf(solved);
  std::vector<double> all;
  for (std::size_t c = 0; c < solved.cameras.size(); ++c) {
    Require(cam_from_reference[c].has_value(),
            "COLMAP could not place camera " + problem.cameras[c].serial +
                " beside the others; record more poses that it shares with them");
    Camera camera = solved.cameras[c];
    camera.serial = problem.cameras[c].serial;
    camera.cam_from_world = *cam_from_reference[c] * reference_from_base * world_from_base.Inverse();
    rig.cameras.push_back(camera);
    rig.camera_points.push_back(static_cast<int>(residuals[c].size()));
    rig.camera_rms_px.push_back(RmsPx(residuals[c]));
    all.insert(all.end(), residuals[c].begin(), residuals[c].end());
  }
  rig.reprojection_rms_px = RmsPx(all);
  rig.seen_m.resize(solved.cameras.size());
  for (std::size_t i = 0; i < solved.images.size(); ++i) {
    const auto c = static_cast<std::size_t>(solved.images[i].camera);
    const Rigid3 frame_from_body = rig.cameras[c].cam_from_world.Inverse() *
                                   poses[PoseOf(solved.images[i])][solved.images[i].camera];
    for (const io::ColmapPixel& seen : given[i]->pixels) {
      if (seen.point < static_cast<int>(corners))
        rig.seen_m[c].push_back(frame_from_body * problem.points[static_cast<std::size_t>(seen.point)].point_m);
    }
  }
  return rig;
}

}  // namespace sole::calib
