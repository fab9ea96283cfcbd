#include "calib/summary.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace sole::calib {
namespace {

constexpr std::array kNinths{"upper left", "upper middle", "upper right", "middle left", "middle",
                             "middle right", "lower left", "lower middle", "lower right"};
constexpr std::array kParameters{"turn about x", "turn about y", "turn about z",
                                 "shift along x", "shift along y", "shift along z",
                                 "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"};
constexpr Eigen::Index kSize = static_cast<Eigen::Index>(kParameters.size());
constexpr std::size_t kWantedPoses = 20;

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace

std::array<int, 9> Coverage(const TakeObservations& observations, std::size_t camera, int width,
                            int height) {
  std::array<int, 9> counts{};
  for (const auto& frame : observations.frames) {
    for (const PointObservation& o : frame[camera].target) {
      const int column = std::clamp(static_cast<int>(3 * o.pixel.x() / width), 0, 2);
      const int row = std::clamp(static_cast<int>(3 * o.pixel.y() / height), 0, 2);
      ++counts[static_cast<std::size_t>(3 * row + column)];
    }
  }
  return counts;
}

std::vector<std::string> Advice(const Rig& rig, const TakeObservations& observations) {
  std::vector<std::string> advice;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const Camera& camera = rig.cameras[c];
    const auto counts = Coverage(observations, c, camera.width, camera.height);
    std::string empty;
    for (std::size_t i = 0; i < counts.size(); ++i) {
      if (counts[i] > 0) continue;
      empty += (empty.empty() ? "" : ", ") + std::string(kNinths[i]);
    }
    if (empty.empty()) continue;
    advice.push_back("camera " + camera.serial + " has no corner in its " + empty +
                     " third: hold the target there");
  }
  if (observations.frames.size() < kWantedPoses) {
    advice.push_back("only " + std::to_string(observations.frames.size()) + " poses: record " +
                     std::to_string(kWantedPoses) + " or more, tilted and turned differently");
  }
  return advice;
}

std::vector<CameraSigmas> Sigmas(const Calibration& calibration) {
  std::vector<CameraSigmas> sigmas;
  if (calibration.covariance.size() == 0) return sigmas;
  for (std::size_t c = 0; c < calibration.rig.cameras.size(); ++c) {
    const Rigid3& pose = calibration.rig.cameras[c].cam_from_world;
    const Eigen::MatrixXd block = calibration.covariance.block<kSize, kSize>(
        kSize * static_cast<Eigen::Index>(c), kSize * static_cast<Eigen::Index>(c));
    // The centre is -R^T t; a turn w on the left moves it by R^T (w x t), a shift s by -R^T s.
    Eigen::Matrix<double, 3, 6> centre;
    centre << -Cross(pose.translation), -Eigen::Matrix3d::Identity();
    CameraSigmas s;
    s.centre_mm = 1000 * std::sqrt((centre * block.topLeftCorner<6, 6>() * centre.transpose()).trace());
    s.direction_deg = std::sqrt(block(0, 0) + block(1, 1)) * 180 / M_PI;
    s.focal_px = std::sqrt(block(6, 6));
    s.principal_px = std::sqrt(block(8, 8) + block(9, 9));
    sigmas.push_back(s);
  }
  return sigmas;
}

std::vector<std::string> StrongCorrelations(const Calibration& calibration, double limit,
                                            std::size_t most) {
  const Eigen::MatrixXd& covariance = calibration.covariance;
  std::vector<std::pair<double, std::string>> found;
  if (covariance.size() == 0) return {};
  const Eigen::VectorXd sd = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  const Eigen::Index thickness = covariance.rows() - 1;
  const auto add = [&](Eigen::Index i, Eigen::Index j, const std::string& words) {
    if (!(sd[i] > 0 && sd[j] > 0)) return;
    const double r = covariance(i, j) / (sd[i] * sd[j]);
    if (std::abs(r) < limit) return;
    char number[16];
    std::snprintf(number, sizeof number, " (%+.3f)", r);
    found.emplace_back(std::abs(r), words + " can hardly be told apart" + number);
  };
  for (std::size_t c = 0; c < calibration.rig.cameras.size(); ++c) {
    const Eigen::Index first = kSize * static_cast<Eigen::Index>(c);
    const std::string camera = "camera " + calibration.rig.cameras[c].serial + ": ";
    for (Eigen::Index i = 0; i < kSize; ++i) {
      const std::string name = kParameters[static_cast<std::size_t>(i)];
      for (Eigen::Index j = i + 1; j < kSize; ++j) {
        add(first + i, first + j, camera + name + " and " + kParameters[static_cast<std::size_t>(j)]);
      }
      add(first + i, thickness, camera + name + " and the plate's thickness");
    }
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<std::string> words;
  for (std::size_t i = 0; i < std::min(most, found.size()); ++i) words.push_back(found[i].second);
  return words;
}

}  // namespace sole::calib
