#include "calib/adjust.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>

#include "calib/refractive_cost_internal.h"
#include "calib/start_values.h"
#include "tests/calib/synthetic_rig.h"
#include "tests/support/jacobian_checker.h"

namespace sole::calib {
namespace {

using testing_support::MakeSyntheticRig;
using testing_support::ObserveSynthetic;
using testing_support::SyntheticRig;

struct Problem {
  std::vector<Eigen::Vector3d> corners, fiducials;
  AdjustState start;
};

Problem ProblemOf(const SyntheticRig& rig, const TakeObservations& take) {
  const TargetConfig& t = rig.config.target;
  Problem problem{TargetCorners(MakeCalibrationCube(t.edge_m, t.squares, t.square_m, t.marker_m)),
                  FiducialCornerPoints(rig.config.plate),
                  {}};
  problem.start = StartValues(rig.config, take, problem.corners, problem.fiducials);
  return problem;
}

AdjustResult AdjustTake(const SyntheticRig& rig, const TakeObservations& take,
                        const AdjustOptions& options = {}) {
  const Problem problem = ProblemOf(rig, take);
  return Adjust(problem.start, take, problem.corners, problem.fiducials, options);
}

Eigen::Vector3d CentreError(const SyntheticRig& rig, const AdjustResult& result, std::size_t c) {
  return result.state.cameras[c].CentreInWorld() - rig.Centre(c);
}

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// Covariance of a camera's centre -R^T t, from that of a small turn on the left and of t.
Eigen::Matrix3d CentreCovariance(const AdjustResult& result, std::size_t c) {
  const Rigid3& pose = result.state.cameras[c].cam_from_world;
  Eigen::Matrix<double, 3, 6> jacobian;
  jacobian << Cross(pose.translation), Eigen::Matrix3d::Identity();
  jacobian = -(pose.rotation.conjugate().toRotationMatrix() * jacobian).eval();
  const Eigen::Index at = 15 * static_cast<Eigen::Index>(c);
  return jacobian * result.covariance.block<6, 6>(at, at) * jacobian.transpose();
}

/// All parameters of a cost function as one vector, its Jacobian and values.
void ExpectCostJacobian(const ceres::CostFunction& cost, const Eigen::VectorXd& x) {
  const auto evaluate = [&](const Eigen::VectorXd& at, Eigen::MatrixXd* jacobian) {
    std::vector<const double*> blocks;
    std::vector<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> parts;
    std::vector<double*> pointers;
    Eigen::Index first = 0;
    for (const int size : cost.parameter_block_sizes()) {
      blocks.push_back(at.data() + first);
      parts.emplace_back(cost.num_residuals(), size);
      first += size;
    }
    for (auto& part : parts) pointers.push_back(part.data());
    Eigen::VectorXd residual(cost.num_residuals());
    EXPECT_TRUE(
        cost.Evaluate(blocks.data(), residual.data(), jacobian ? pointers.data() : nullptr));
    if (jacobian) {
      jacobian->resize(cost.num_residuals(), first);
      first = 0;
      for (const auto& part : parts) {
        jacobian->middleCols(first, part.cols()) = part;
        first += part.cols();
      }
    }
    return residual;
  };
  Eigen::MatrixXd jacobian;
  evaluate(x, &jacobian);
  sole::testing_support::ExpectJacobianNear(
      [&](const Eigen::VectorXd& at) { return evaluate(at, nullptr); }, x, jacobian, 1e-6, 1e-6);
}

TEST(RefractiveCost, JacobiansMatchDifferences) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  const RigConfig config = MakeDefaultRig(20);
  for (const std::size_t c : {std::size_t{0}, std::size_t{2}, std::size_t{12}}) {
    const CameraConfig& camera = config.cameras[c];
    const RefractedResidual projection{{700, 500}, 0.5, 1.52, NominalCamFromWorld(camera)};
    const Rigid3 body = testing_support::RandomTurn(random, 0.4, 0.02);
    const TargetCost target(projection, {body.rotation, {0.01, 0.02, 0.09}}, {0.02, -0.03, 0.05});
    Eigen::VectorXd x(22);
    for (double& value : x) value = 0.002 * normal(random);
    x.segment<4>(6) << camera.focal_px, camera.focal_px, 810, 610;
    x[10] = -0.1;
    x[21] = 0.0151;
    ExpectCostJacobian(target, x);
    const FiducialCost fiducial(projection, {0.05, -0.07, 0});
    Eigen::VectorXd y(18);
    y << x.head<15>(), 1e-5, -2e-5, 0.0149;
    ExpectCostJacobian(fiducial, y);
  }
}

TEST(Adjust, ExactObservationsGiveTheTrueRig) {
  SyntheticRig rig = MakeSyntheticRig(4, 8, 1);
  rig.thickness_m = rig.config.plate.thickness_m;
  const AdjustResult result = AdjustTake(rig, ObserveSynthetic(rig, 0, 1));
  EXPECT_TRUE(result.converged);
  EXPECT_EQ(result.outliers, 0);
  EXPECT_LT(result.reprojection_rms_px, 1e-5);
  for (std::size_t c = 0; c < 4; ++c) {
    EXPECT_LT(CentreError(rig, result, c).norm(), 1e-6) << c;
    EXPECT_LT(result.state.cameras[c].cam_from_world.rotation.angularDistance(
                  rig.cam_from_world[c].rotation),
              1e-6);
    EXPECT_NEAR(result.state.cameras[c].intrinsics[0], rig.lens[c][0], 0.01);
    EXPECT_NEAR(result.state.cameras[c].intrinsics[4], rig.lens[c][4], 1e-4);
  }
}

TEST(Adjust, ObliqueCamerasDetermineTheThickness) {
  const SyntheticRig rig = MakeSyntheticRig(testing_support::ObliqueRig(), 8, 4);
  AdjustOptions options;
  options.thickness_tolerance_m = 1;  // no help from the data sheet
  const AdjustResult result = AdjustTake(rig, ObserveSynthetic(rig, 0, 4), options);
  EXPECT_NEAR(result.state.plate.thickness_m, rig.thickness_m, 2e-6);
}

TEST(Adjust, NoisyObservationsGiveCentresWithinTheirCovariance) {
  double chi2 = 0;
  double air_rms = 0;
  int count = 0;
  for (std::uint64_t seed = 10; seed < 17; ++seed) {
    const SyntheticRig rig = MakeSyntheticRig(4, 9, seed);
    const AdjustResult result = AdjustTake(rig, ObserveSynthetic(rig, 0.02, seed));
    EXPECT_NEAR(result.sigma0, 1, 0.1);
    for (std::size_t c = 0; c < 4; ++c) {
      const Eigen::Vector3d error = CentreError(rig, result, c);
      chi2 += error.dot(CentreCovariance(result, c).ldlt().solve(error));
      if (c >= 2) air_rms += error.squaredNorm();
      ++count;
    }
  }
  // 3 degrees of freedom each; cameras of one rig are correlated, so the bounds are wide.
  EXPECT_GT(chi2 / count, 1.5);
  EXPECT_LT(chi2 / count, 5.0);
  EXPECT_LT(std::sqrt(air_rms / (count / 2)), 5e-5);
}

TEST(Adjust, WrongCornersAreDropped) {
  const SyntheticRig rig = MakeSyntheticRig(4, 10, 5);
  TakeObservations take = ObserveSynthetic(rig, 0.02, 5);
  int spoiled = 0;
  for (auto& frame : take.frames) {
    for (auto& view : frame) {
      for (std::size_t i = 0; i < view.target.size(); i += 20, ++spoiled)
        view.target[i].pixel.x() += 1 + 0.3 * spoiled;
    }
  }
  const AdjustResult result = AdjustTake(rig, take);
  EXPECT_GE(result.outliers, spoiled);
  EXPECT_LT(result.outliers, spoiled + 20);
  EXPECT_LT(result.reprojection_rms_px, 0.022);
}

TEST(Adjust, FiducialsDefineTheWorldFrame) {
  // Fiducials moved by 3 mm in x on paper: the whole rig follows, lengths stay.
  SyntheticRig rig = MakeSyntheticRig(4, 8, 6);
  rig.thickness_m = rig.config.plate.thickness_m;
  const TakeObservations take = ObserveSynthetic(rig, 0, 6);
  for (Fiducial& fiducial : rig.config.plate.fiducials) fiducial.centre_m.x() += 0.003;
  const AdjustResult result = AdjustTake(rig, take);
  for (std::size_t c = 0; c < 4; ++c) {
    EXPECT_LT((CentreError(rig, result, c) - Eigen::Vector3d(0.003, 0, 0)).norm(), 2e-6) << c;
  }
}

TEST(Adjust, OneMisplacedFiducialIsTakenForWhatItIs) {
  SyntheticRig rig = MakeSyntheticRig(4, 10, 7);
  rig.thickness_m = rig.config.plate.thickness_m;
  const TakeObservations take = ObserveSynthetic(rig, 0.02, 7);
  rig.config.plate.fiducials[3].centre_m.y() += 0.00004;  // two standard deviations of the etching
  const AdjustResult result = AdjustTake(rig, take);
  EXPECT_NEAR(result.state.fiducial_offset_m[3].y(), -0.00004, 0.00001);
}

TEST(Adjust, CameraWithoutFiducialsIsTiedByTheTarget) {
  SyntheticRig rig = MakeSyntheticRig(4, 10, 8);
  rig.thickness_m = rig.config.plate.thickness_m;
  TakeObservations take = ObserveSynthetic(rig, 0, 8);
  for (auto& frame : take.frames) frame[3].fiducials.clear();
  EXPECT_LT(CentreError(rig, AdjustTake(rig, take), 3).norm(), 2e-6);
}

}  // namespace
}  // namespace sole::calib
