#include <algorithm>
#include <cstdio>

#include "calib/colmap_rig.h"
#include "calib/detect.h"
#include "core/error.h"

namespace sole::calib {
namespace {

Camera NominalCamera(const CameraConfig& nominal) {
  Camera camera{nominal.serial, nominal.width, nominal.height, Intrinsics::Zero(), {}};
  camera.intrinsics.head<4>() << nominal.focal_px, nominal.focal_px, 0.5 * (nominal.width - 1),
      0.5 * (nominal.height - 1);
  return camera;
}

/// Frames that two or more of the cameras see well, evenly thinned.
std::vector<std::size_t> ChooseFrames(const TakeObservations& observations,
                                      const std::vector<std::size_t>& cameras,
                                      const ColmapProblemOptions& options) {
  std::vector<std::size_t> good;
  for (std::size_t f = 0; f < observations.frames.size(); ++f) {
    const auto views = std::count_if(cameras.begin(), cameras.end(), [&](std::size_t c) {
      return static_cast<int>(observations.frames[f][c].target.size()) >= options.min_points;
    });
    if (views >= 2) good.push_back(f);
  }
  const auto most = static_cast<std::size_t>(std::max(1, options.max_frames));
  if (good.size() <= most) return good;
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < most; ++i) chosen.push_back(good[i * good.size() / most]);
  return chosen;
}

}  // namespace

bool InAir(const CameraConfig& camera) { return camera.position_m.z() > 0; }

std::string ColmapImagePrefix(std::size_t camera) {
  char text[32];
  std::snprintf(text, sizeof text, "camera%03zu/", camera + 1);
  return text;
}

io::ColmapModel MakeColmapProblem(const RigConfig& config, const TakeObservations& observations,
                                  const ColmapProblemOptions& options) {
  io::ColmapModel problem;
  std::vector<std::size_t> cameras;
  for (std::size_t c = 0; c < config.cameras.size(); ++c) {
    if (!InAir(config.cameras[c])) continue;
    cameras.push_back(c);
    problem.cameras.push_back(NominalCamera(config.cameras[c]));
  }
  Require(cameras.size() >= 2, "COLMAP: " + std::to_string(cameras.size()) +
                                   " camera(s) above the plate, needs 2; it cannot look through glass");
  for (const Eigen::Vector3d& corner : TargetCorners(TargetOf(config).body))
    problem.points.push_back({corner});
  const int first_fiducial = static_cast<int>(problem.points.size());
  for (const Eigen::Vector3d& corner : FiducialCornerPoints(config.plate))
    problem.points.push_back({corner});

  const std::vector<std::size_t> frames = ChooseFrames(observations, cameras, options);
  std::size_t fiducial_frame = 0, most = 0;  // the one that most cameras see
  for (const std::size_t f : frames) {
    std::size_t seen = 0;
    for (const std::size_t c : cameras)
      seen += static_cast<int>(observations.frames[f][c].target.size()) >= options.min_points;
    if (seen > most) {
      most = seen;
      fiducial_frame = f;
    }
  }
  std::vector<int> images(cameras.size(), 0);
  for (const std::size_t f : frames) {
    for (std::size_t k = 0; k < cameras.size(); ++k) {
      const std::vector<PointObservation>& target = observations.frames[f][cameras[k]].target;
      if (static_cast<int>(target.size()) < options.min_points) continue;
      char number[32];
      std::snprintf(number, sizeof number, "%06zu.png", f + 1);
      io::ColmapImage image{ColmapImagePrefix(k) + number, static_cast<int>(k), {}, {}};
      for (const PointObservation& seen : target) image.pixels.push_back({seen.pixel, seen.point});
      if (f == fiducial_frame) {
        for (const PointObservation& seen :
             MeanFiducials(observations, cameras[k], options.fiducial_sigma_floor_px))
          image.pixels.push_back({seen.pixel, first_fiducial + seen.point});
      }
      problem.images.push_back(std::move(image));
      ++images[k];
    }
  }
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    Require(images[k] > 0, "COLMAP: camera " + problem.cameras[k].serial +
                               " shows the target together with no other camera above the plate; "
                               "record poses that both see");
  }
  return problem;
}

}  // namespace sole::calib
