#include "sim/scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Geometry>

namespace sole::sim {

std::vector<Rigid3> CalibrationPoses(int count, double edge_m, std::uint64_t seed) {
  constexpr double kClearance = 0.004;
  constexpr double kDegree = std::numbers::pi / 180;
  std::mt19937_64 engine(seed * 31 + 17);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine);
  };
  std::vector<Rigid3> poses;
  while (static_cast<int>(poses.size()) < count) {
    // Turns about z are spread evenly, so that even a few poses show every face to every camera.
    const double turn =
        (360.0 * static_cast<double>(poses.size()) * 0.381966 + between(-20, 20)) * kDegree;
    const double tilt_axis = between(0, 2 * std::numbers::pi);
    const double tilt = between(5, 35) * kDegree;
    Rigid3 pose;
    pose.rotation =
        Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(tilt_axis), std::sin(tilt_axis), 0)) *
        Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ());
    const double x = between(-0.08, 0.08), y = between(-0.15, 0.15), z = between(0.075, 0.14);
    const double reach =  // height of the centre above the lowest corner
        0.5 * edge_m * pose.rotation.toRotationMatrix().row(2).cwiseAbs().sum();
    if (reach + kClearance > 0.14) continue;
    pose.translation = {x, y, std::max(z, reach + kClearance)};
    poses.push_back(pose);
  }
  return poses;
}

std::vector<ContactSheet> SheetPlaces(int count, std::uint64_t seed) {
  std::mt19937_64 engine(seed * 37 + 11);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<ContactSheet> places(static_cast<std::size_t>(std::max(count, 0)));
  for (ContactSheet& sheet : places) {
    const double x = unit(engine), y = unit(engine), turn = unit(engine);
    sheet.centre_m = {0.002 * x, 0.002 * y};
    sheet.turn_rad = 0.5 * turn * std::numbers::pi / 180;
  }
  return places;
}

}  // namespace sole::sim
