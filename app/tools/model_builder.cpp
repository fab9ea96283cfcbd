#include "app/tools/model_builder.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

#include "app/tools/landmarks.h"
#include "app/tools/mean_foot_people.h"
#include "app/tools/motion_training.h"
#include "app/tools/simulated_people.h"
#include "model/joint_regressor_fit.h"
#include "model/shape_space.h"
#include "model/triangle_topology.h"
#include "model/upsampling.h"

namespace sole::tools {
namespace {

Eigen::MatrixX3i TriangleMatrix(const std::vector<Eigen::Vector3i>& triangles) {
  Eigen::MatrixX3i matrix(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    matrix.row(static_cast<Eigen::Index>(t)) = triangles[t];
  return matrix;
}

void Move(const Rigid3& motion, Eigen::MatrixX3d& points) {
  points = (points * motion.rotation.toRotationMatrix().transpose()).rowwise() +
           motion.translation.transpose();
}

/// Brings all rest shapes (and their joints) into one place, that of the reference foot:
/// generalised Procrustes without scale.
void AlignPeople(const Eigen::MatrixX3d& reference, std::vector<Person>& people) {
  Eigen::MatrixX3d mean = reference;
  for (int round = 0; round < 3; ++round) {
    Eigen::MatrixX3d sum = Eigen::MatrixX3d::Zero(mean.rows(), 3);
    for (Person& person : people) {
      const Rigid3 motion = model::AlignRigidly(person.rest_m, mean);
      Move(motion, person.rest_m);
      Move(motion, person.joints_m);
      sum += person.rest_m;
    }
    mean = sum / static_cast<double>(people.size());
    Move(model::AlignRigidly(mean, reference), mean);
  }
}

Eigen::VectorXd Stacked(const Eigen::MatrixX3d& points) {
  const Eigen::Matrix3Xd transposed = points.transpose();
  return Eigen::Map<const Eigen::VectorXd>(transposed.data(), transposed.size());
}

/// Components point to larger feet, so that the first one grows with foot length.
void OrientComponents(model::ShapeSpace& space) {
  const Eigen::Map<const Eigen::Matrix3Xd> mean(space.mean.data(), 3, space.mean.size() / 3);
  const Eigen::Matrix3Xd radial = mean.colwise() - mean.rowwise().mean();
  for (Eigen::Index c = 0; c < space.components.cols(); ++c) {
    if (space.components.col(c).dot(
            Eigen::Map<const Eigen::VectorXd>(radial.data(), radial.size())) < 0)
      space.components.col(c) *= -1;
  }
}

void AddShape(const std::vector<Person>& people, int betas, model::FootModel& foot,
              const BuilderLog& log) {
  Eigen::MatrixXd shapes(people[0].rest_m.size(), static_cast<Eigen::Index>(people.size()));
  for (std::size_t p = 0; p < people.size(); ++p)
    shapes.col(static_cast<Eigen::Index>(p)) = Stacked(people[p].rest_m);
  model::ShapeSpace space = model::LearnShapeSpace(shapes, betas);
  OrientComponents(space);
  const Eigen::Index n = foot.NumVertices(), fine = space.mean.size() / 3;
  foot.fine.template_m = Eigen::Map<const Eigen::Matrix3Xd>(space.mean.data(), 3, fine).transpose();
  foot.fine.shapedirs = space.components;
  foot.coarse.template_m = foot.fine.template_m.topRows(n);
  foot.coarse.shapedirs = foot.fine.shapedirs.topRows(3 * n);
  log(fmt::format("shape space: {} components hold {:.2f} % of the variance", betas,
                  100 * space.variances.head(betas).sum() / space.variances.sum()));
}

/// The root turns about the middle of the rim.
Eigen::VectorXd RimWeights(const std::vector<Eigen::Vector3i>& triangles, Eigen::Index n) {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(n);
  const std::vector<std::vector<int>> loops = model::BoundaryLoops(triangles);
  for (const int v : loops.at(0)) weights[v] = 1;
  return weights / weights.sum();
}

void AddJoints(std::vector<Person>& people, const TemplateMesh& mesh, model::FootModel& foot) {
  const auto n = static_cast<Eigen::Index>(foot.coarse.template_m.rows());
  const Eigen::VectorXd rim = RimWeights(mesh.coarse_triangles, n);
  std::vector<Eigen::MatrixX3d> vertices, joints;
  for (Person& person : people) {
    person.joints_m.row(0) = rim.transpose() * person.rest_m.topRows(n);
    vertices.push_back(person.rest_m.topRows(n));
    joints.push_back(person.joints_m);
  }
  foot.joint_regressor = model::FitJointRegressor(vertices, joints);
  foot.joint_regressor.row(0) = rim;
}

std::vector<Person> DrawTrainingPeople(const BuilderOptions& options,
                                       std::span<const SurfacePoint> points, std::size_t movers,
                                       const BuilderLog& log) {
  std::vector<std::uint64_t> seeds(static_cast<std::size_t>(options.shape_people));
  std::iota(seeds.begin(), seeds.end(), options.first_seed);
  std::vector<Person> people =
      DrawPeople(std::span(seeds).first(movers), points, {.poses = options.poses});
  log(fmt::format("posed {} people {} times", movers, options.poses));
  const std::vector<Person> others = DrawPeople(std::span(seeds).subspan(movers), points, {});
  people.insert(people.end(), others.begin(), others.end());
  log(fmt::format("drew {} people", people.size()));
  return people;
}

}  // namespace

model::FootModel BuildFootModel(const BuilderOptions& options, const BuilderLog& log) {
  const TemplateMesh mesh = MakeTemplateMesh(options.mesh);
  log(fmt::format("template: {} and {} vertices", options.mesh.coarse_vertices,
                  mesh.points.size()));
  const auto coarse = static_cast<std::size_t>(options.mesh.coarse_vertices);
  model::FootModel foot;
  foot.licence = "Apache-2.0";
  foot.material.assign(mesh.points.begin(),
                       mesh.points.begin() + static_cast<std::ptrdiff_t>(coarse));
  for (const ModelJoint& joint : ModelJoints()) {
    foot.parents.push_back(joint.parent);
    foot.joint_names.push_back(joint.name);
  }
  foot.coarse.triangles = TriangleMatrix(mesh.coarse_triangles);
  foot.fine.triangles = TriangleMatrix(mesh.fine_triangles);
  foot.coarse.template_m.resize(options.mesh.coarse_vertices, 3);

  const auto movers =
      static_cast<std::size_t>(std::min(options.motion_people, options.shape_people));
  std::vector<Person> people = options.mean_foot
                                   ? DeformMeanFoot(mesh.points, options.shape_people)
                                   : DrawTrainingPeople(options, mesh.points, movers, log);

  AlignPeople(PointsOn(sim::ReferenceFoot().vertices, mesh.points), people);
  AddShape(people, options.betas, foot, log);
  AddJoints(people, mesh, foot);
  foot.upsampling = model::HarmonicUpsampling(
      {PointsToVector(foot.fine.template_m), mesh.fine_triangles}, options.mesh.coarse_vertices);
  if (options.mean_foot) {
    foot.fine.weights = FourInfluences(JointShares(mesh.points));
    foot.coarse.weights = foot.fine.weights.topRows(foot.NumVertices());
  } else {
    LearnMotion(std::span(people).first(movers), JointShares(mesh.points),
                options.skinning_rounds, options.correctives, foot, log);
  }
  foot.landmarks = FindLandmarks(foot);
  Prepare(foot);
  return foot;
}

}  // namespace sole::tools
