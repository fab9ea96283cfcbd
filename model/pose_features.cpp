#include "model/pose_features.h"

#include <cmath>

namespace sole::model {
namespace {

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// Below this squared angle the power series are exact to double precision.
constexpr double kSmallSquaredAngle = 1e-6;

/// sin(a) / a, (1 - cos(a)) / a^2 and (a - sin(a)) / a^3 from the squared angle.
struct AngleTerms {
  double sine, cosine, cubic;
};

AngleTerms TermsOf(double squared) {
  if (squared < kSmallSquaredAngle) {
    return {1 - squared / 6 * (1 - squared / 20), 0.5 - squared / 24 * (1 - squared / 30),
            1.0 / 6 - squared / 120 * (1 - squared / 42)};
  }
  const double angle = std::sqrt(squared), half = std::sin(angle / 2);
  const double sine = 2 * half * std::cos(angle / 2);
  return {sine / angle, 2 * half * half / squared, (angle - sine) / (angle * squared)};
}

}  // namespace

Eigen::Index NumPoseFeatures(Family family, Eigen::Index num_joints) {
  switch (family) {
    case Family::kSupr:
      return 4 * num_joints;
    case Family::kStar:
      return 4 * (num_joints - 1) + 1;
    case Family::kSmpl:
      return 9 * (num_joints - 1);
  }
  return 0;
}

Eigen::Matrix3d RotationFrom(const Eigen::Vector3d& theta) {
  const AngleTerms terms = TermsOf(theta.squaredNorm());
  const Eigen::Matrix3d cross = Cross(theta);
  return Eigen::Matrix3d::Identity() + terms.sine * cross + terms.cosine * cross * cross;
}

Eigen::Matrix3d LeftJacobian(const Eigen::Vector3d& theta) {
  const AngleTerms terms = TermsOf(theta.squaredNorm());
  const Eigen::Matrix3d cross = Cross(theta);
  return Eigen::Matrix3d::Identity() + terms.cosine * cross + terms.cubic * cross * cross;
}

Eigen::Vector4d QuaternionFeature(const Eigen::Vector3d& theta) {
  const double squared = theta.squaredNorm(), angle = std::sqrt(squared);
  const double quarter = std::sin(angle / 4);
  const double sine = squared / 4 < kSmallSquaredAngle
                          ? 0.5 * TermsOf(squared / 4).sine
                          : 2 * quarter * std::cos(angle / 4) / angle;
  Eigen::Vector4d feature;
  feature << sine * theta, -2 * quarter * quarter;
  return feature;
}

Eigen::Matrix<double, 4, 3> QuaternionFeatureJacobian(const Eigen::Vector3d& theta) {
  // With h = |theta| / 2: vector part s theta, s = sin(h) / (2 h); ds/dtheta = slope * theta.
  const double squared = theta.squaredNorm();
  const double s = 0.5 * TermsOf(squared / 4).sine;
  double slope = 0;
  if (squared < kSmallSquaredAngle) {
    slope = -1.0 / 24 + squared / 960;
  } else {
    slope = (0.5 * std::cos(0.5 * std::sqrt(squared)) - s) / squared;
  }
  Eigen::Matrix<double, 4, 3> jacobian;
  jacobian.topRows<3>() = s * Eigen::Matrix3d::Identity() + slope * theta * theta.transpose();
  jacobian.row(3) = -0.5 * s * theta.transpose();
  return jacobian;
}

Eigen::VectorXd QuaternionFeatures(const Eigen::MatrixX3d& theta) {
  Eigen::VectorXd features(4 * theta.rows());
  for (Eigen::Index j = 0; j < theta.rows(); ++j)
    features.segment<4>(4 * j) = QuaternionFeature(theta.row(j));
  return features;
}

Eigen::VectorXd PoseFeatures(Family family, const Eigen::MatrixX3d& theta,
                             const Eigen::VectorXd& beta) {
  const Eigen::Index joints = theta.rows();
  if (family == Family::kSupr) return QuaternionFeatures(theta);
  Eigen::VectorXd features = Eigen::VectorXd::Zero(NumPoseFeatures(family, joints));
  for (Eigen::Index j = 1; j < joints; ++j) {
    if (family == Family::kStar) {
      features.segment<4>(4 * (j - 1)) = QuaternionFeature(theta.row(j));
    } else {
      const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> difference =
          RotationFrom(theta.row(j)) - Eigen::Matrix3d::Identity();
      features.segment<9>(9 * (j - 1)) =
          Eigen::Map<const Eigen::Matrix<double, 9, 1>>(difference.data());
    }
  }
  if (family == Family::kStar && beta.size() > 1) features[features.size() - 1] = beta[1];
  return features;
}

FeatureBlock PoseFeatureBlock(Family family, const Eigen::MatrixX3d& theta, Eigen::Index joint) {
  FeatureBlock block;
  block.jacobian.resize(0, 3);
  if (family == Family::kSupr) {
    block.first = 4 * joint;
    block.jacobian = QuaternionFeatureJacobian(theta.row(joint));
  } else if (joint > 0 && family == Family::kStar) {
    block.first = 4 * (joint - 1);
    block.jacobian = QuaternionFeatureJacobian(theta.row(joint));
  } else if (joint > 0) {
    block.first = 9 * (joint - 1);
    block.jacobian.resize(9, 3);
    const Eigen::Matrix3d rotation = RotationFrom(theta.row(joint)),
                          left = LeftJacobian(theta.row(joint));
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> change = Cross(left.col(axis)) * rotation;
      block.jacobian.col(axis) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(change.data());
    }
  }
  return block;
}

}  // namespace sole::model
