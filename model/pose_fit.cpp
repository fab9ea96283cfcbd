#include "model/pose_fit.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Dense>
#include <ceres/ceres.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/error.h"
#include "model/foot_start.h"
#include "model/jacobian.h"
#include "model/mesh_topology.h"
#include "model/surface_cost_internal.h"
#include "model/surface_query.h"

namespace sole::model {
namespace {

/// The posed surface, moved from round to round.
struct PosedSurface {
  const FootModel& model;
  Variant variant;
  TriangleMesh mesh;
  std::vector<bool> boundary;
  SurfaceQuery query;

  PosedSurface(const FootModel& of, const ModelParameters& parameters)
      : model(of),
        variant(of.HasFine() ? Variant::kFine : Variant::kCoarse),
        mesh(MeshOf(of, variant, Forward(of, parameters, variant).vertices_m)),
        boundary(BoundaryVertices(mesh)),
        query(mesh) {}

  void Move(const ModelParameters& parameters) {
    const Eigen::MatrixX3d vertices = Forward(model, parameters, variant).vertices_m;
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
      mesh.vertices[v] = vertices.row(static_cast<Eigen::Index>(v));
    query.Move(mesh.vertices);
  }
};

Correspondences FindCorrespondences(const PosedSurface& posed, const PointCloud& scan,
                                    const PoseFitStage& stage, const PoseFitOptions& options) {
  const TriangleMesh& surface = posed.mesh;
  const std::vector<Eigen::Vector3d> normals = VertexNormals(surface);
  const RimPlane rim = RimPlaneOf(surface, posed.boundary);
  struct Found {
    SurfacePoint place;
    Eigen::Vector3d normal;
    double distance_m = -1;
    bool beyond = false;
    bool pressed = false;
  };
  std::vector<Found> found(scan.Size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, scan.Size(), 128), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      found[i].beyond = rim.Beyond(scan.points_m[i].cast<double>());
      if (found[i].beyond) continue;
      const auto hit = posed.query.Closest(scan.points_m[i].cast<double>(), stage.radius_m);
      if (!hit) continue;
      const Eigen::Vector3i& t = surface.triangles[static_cast<std::size_t>(hit->point.triangle)];
      Eigen::Vector3d normal = Eigen::Vector3d::Zero();
      for (int k = 0; k < 3; ++k) {
        const auto v = static_cast<std::size_t>(t[k]);
        normal += hit->point.barycentric[k] * normals[v];
      }
      normal.normalize();
      if (!scan.normals.empty() &&
          scan.normals[i].cast<double>().dot(normal) < options.minimum_normal_cosine) {
        continue;
      }
      const bool on_glass = scan.points_m[i].z() < options.glass_height_m;
      found[i].pressed = on_glass && hit->position.z() < scan.points_m[i].z();
      found[i].place = hit->point;
      found[i].normal = normal;
      found[i].distance_m = hit->distance_m;
    }
  });

  Correspondences result;
  const double kernel2 = stage.kernel_m * stage.kernel_m;
  std::size_t considered = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (found[i].beyond || found[i].pressed) continue;  // shank above the model, flesh flattened by the glass
    ++considered;
    if (found[i].distance_m < 0) {
      result.cost += 1;
      continue;
    }
    const double r2 = found[i].distance_m * found[i].distance_m;
    result.cost += r2 / (r2 + kernel2);
    result.residual_m += found[i].distance_m;
    result.places.push_back(found[i].place);
    result.targets.push_back(scan.points_m[i].cast<double>());
    result.normals.push_back(found[i].normal);
    result.weights.push_back(kernel2 / (r2 + kernel2));  // square root of the IRLS weight
  }
  const auto count = static_cast<double>(result.places.size());
  result.matched = considered ? count / static_cast<double>(considered) : 0;
  result.cost = considered ? result.cost / static_cast<double>(considered) : 1;
  if (count > 0) {
    result.residual_m /= count;
    const double scale = std::sqrt(options.effective_points / count) / stage.sigma_m;
    for (double& w : result.weights) w *= scale;
  }
  return result;
}

}  // namespace

PoseFit FitPose(const FootModel& model, const PointCloud& scan, const ModelParameters& start,
                const PoseFitStage& stage, const PoseFitOptions& options) {
  CheckParameters(model, start);
  Require(stage.rounds >= 1 && stage.radius_m > 0 && stage.kernel_m > 0 && stage.sigma_m > 0,
          "pose fit: rounds, radius, kernel and sigma must be positive");
  PoseFit fit{start, 1, 0, 0, {}};
  const Eigen::Index joints = model.NumJoints();
  const PosePrior prior = PosePriorOf(model, options.prior);
  PosedSurface surface(model, fit.parameters);
  for (int round = 0; round < stage.rounds; ++round) {
    if (round > 0) surface.Move(fit.parameters);
    const Correspondences matches = FindCorrespondences(surface, scan, stage, options);
    if (matches.places.size() < 50) return fit;
    Eigen::VectorXd theta(3 * joints);
    for (Eigen::Index j = 0; j < joints; ++j) theta.segment<3>(3 * j) = fit.parameters.theta.row(j);
    Eigen::VectorXd beta = fit.parameters.beta;
    Eigen::Vector3d translation = fit.parameters.translation_m;

    ceres::Problem problem;
    problem.AddResidualBlock(new SurfaceCost(model, fit.parameters, matches, options.solver_iterations), nullptr, theta.data(),
                             beta.data(), translation.data());
    problem.AddResidualBlock(new PriorCost(prior.root, prior.mean), nullptr, theta.data());
    problem.AddResidualBlock(new PriorCost(Eigen::MatrixXd::Identity(beta.size(), beta.size()), Eigen::VectorXd::Zero(beta.size())), nullptr, beta.data());
    if (!stage.free_joints) {
      std::vector<int> held;
      for (int i = 3; i < 3 * joints; ++i) held.push_back(i);
      problem.SetManifold(theta.data(), new ceres::SubsetManifold(static_cast<int>(3 * joints), held));
    }
    if (!stage.free_shape) problem.SetParameterBlockConstant(beta.data());
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    solver.max_num_iterations = options.solver_iterations;
    solver.logging_type = ceres::SILENT;
    solver.num_threads = 1;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);

    const double moved = (translation - fit.parameters.translation_m).norm();
    double turned = 0;
    for (Eigen::Index j = 0; j < joints; ++j) {
      turned = std::max(turned, (theta.segment<3>(3 * j) - fit.parameters.theta.row(j).transpose()).norm());
      fit.parameters.theta.row(j) = theta.segment<3>(3 * j);
    }
    const double reshaped = (beta - fit.parameters.beta).lpNorm<Eigen::Infinity>();
    fit.parameters.beta = beta;
    fit.parameters.translation_m = translation;
    if (moved < options.still_m && turned < options.still_rad && reshaped < options.still_beta) break;
  }
  surface.Move(fit.parameters);
  const Correspondences last = FindCorrespondences(surface, scan, stage, options);
  fit.cost = last.cost;
  fit.residual_m = last.residual_m;
  fit.matched = last.matched;
  return fit;
}

void AddCovariance(const FootModel& model, const PointCloud& scan, const PoseFitStage& stage,
                   const PoseFitOptions& options, PoseFit& fit) {
  const Correspondences matches =
      FindCorrespondences(PosedSurface(model, fit.parameters), scan, stage, options);
  const Variant variant = model.HasFine() ? Variant::kFine : Variant::kCoarse;
  const PointsJacobian points = SurfacePointJacobian(model, fit.parameters, variant, matches.places);
  const ParameterColumns columns = ColumnsOf(model, fit.parameters);
  // Where the model does not reach the scan to within the stage's sigma, its misfit is the noise.
  const double information =
      std::min(1.0, std::pow(stage.sigma_m / std::max(MisfitOf(matches.residual_m), 1e-9), 2));
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(columns.count, columns.count);
  for (std::size_t i = 0; i < matches.places.size(); ++i) {
    const Eigen::RowVectorXd row = std::sqrt(information) * matches.weights[i] *
                                   matches.normals[i].transpose() *
                                   points.jacobian.middleRows<3>(static_cast<Eigen::Index>(3 * i));
    normal.selfadjointView<Eigen::Lower>().rankUpdate(row.transpose());
  }
  normal = normal.selfadjointView<Eigen::Lower>();
  const Eigen::Index values = 3 * model.NumJoints();
  const Eigen::MatrixXd root = PosePriorOf(model, options.prior).root;
  normal.block(columns.theta, columns.theta, values, values) += root.transpose() * root;
  normal.diagonal().segment(columns.beta, fit.parameters.beta.size()).array() += 1;
  // Root and translation carry no prior; a hair of one keeps the matrix invertible without points.
  normal.diagonal().array() += 1e-9;
  fit.covariance = normal.ldlt().solve(Eigen::MatrixXd::Identity(columns.count, columns.count));
}

}  // namespace sole::model
