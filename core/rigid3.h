#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace sole {

/// Rigid motion x -> R x + t. Named `b_from_a` where it maps points of frame a to frame b.
template <typename T>
struct Rigid3T {
  Eigen::Quaternion<T> rotation = Eigen::Quaternion<T>::Identity();
  Eigen::Matrix<T, 3, 1> translation = Eigen::Matrix<T, 3, 1>::Zero();

  Eigen::Matrix<T, 3, 1> operator*(const Eigen::Matrix<T, 3, 1>& point) const {
    return rotation * point + translation;
  }
  Rigid3T operator*(const Rigid3T& other) const {
    return {(rotation * other.rotation).normalized(), rotation * other.translation + translation};
  }
  Rigid3T Inverse() const {
    const Eigen::Quaternion<T> inverse = rotation.conjugate();
    return {inverse, -(inverse * translation)};
  }
};

using Rigid3 = Rigid3T<double>;

}  // namespace sole
