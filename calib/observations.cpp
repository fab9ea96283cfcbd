#include "calib/observations.h"

namespace sole::calib {

std::vector<Eigen::Vector3d> TargetCorners(const CalibrationBody& body) {
  std::vector<Eigen::Vector3d> corners;
  for (const CharucoFace& face : body.faces) {
    const int count = (face.squares_x - 1) * (face.squares_y - 1);
    for (int corner = 0; corner < count; ++corner) corners.push_back(CornerInBody(face, corner));
  }
  return corners;
}

std::vector<Eigen::Vector3d> FiducialCornerPoints(const PlateConfig& plate) {
  std::vector<Eigen::Vector3d> corners;
  for (const Fiducial& fiducial : plate.fiducials) {
    for (const Eigen::Vector3d& corner : FiducialCorners(fiducial)) corners.push_back(corner);
  }
  return corners;
}

}  // namespace sole::calib
