#include "model/foot_start.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "model/mesh_topology.h"
#include "model/surface_query.h"

namespace sole::model {
namespace {

constexpr int kHeadings = 12;
constexpr double kPitches_rad[] = {-0.7, -0.25, 0.2, 0.6};  // tiptoe to toes up

struct Points {
  Eigen::Matrix3Xd places, normals;  ///< normals without columns if the scan has none
};

Points Thin(const PointCloud& scan, std::size_t count) {
  std::vector<std::size_t> finite;
  for (std::size_t i = 0; i < scan.Size(); ++i) {
    if (scan.points_m[i].allFinite()) finite.push_back(i);
  }
  const std::size_t kept = std::min(count, finite.size());
  Points points;
  points.places.resize(3, static_cast<Eigen::Index>(kept));
  if (!scan.normals.empty()) points.normals.resize(3, static_cast<Eigen::Index>(kept));
  for (std::size_t k = 0; k < kept; ++k) {
    const std::size_t i = finite[k * finite.size() / kept];
    const auto column = static_cast<Eigen::Index>(k);
    points.places.col(column) = scan.points_m[i].cast<double>();
    if (!scan.normals.empty()) points.normals.col(column) = scan.normals[i].cast<double>();
  }
  return points;
}

/// The resting foot and what the search needs of it.
struct Resting {
  TriangleMesh mesh;
  std::vector<Eigen::Vector3d> normals;
  std::vector<bool> boundary;
  RimPlane rim;
  SurfaceQuery query;
  Eigen::Vector2d middle;  ///< of the lower 60 mm
  double lowest = 0;
};

Resting RestingOf(const FootModel& model, const Eigen::VectorXd& beta) {
  ModelParameters rest = RestParameters(model);
  rest.beta = beta;
  TriangleMesh mesh = MeshOf(model, Variant::kCoarse, Forward(model, rest).vertices_m);
  std::vector<bool> boundary = BoundaryVertices(mesh);
  const RimPlane rim = RimPlaneOf(mesh, boundary);
  std::vector<Eigen::Vector3d> normals = VertexNormals(mesh);
  SurfaceQuery query(mesh);
  Resting resting{std::move(mesh), std::move(normals), std::move(boundary), rim, std::move(query),
                  Eigen::Vector2d::Zero()};
  resting.lowest = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& v : resting.mesh.vertices)
    resting.lowest = std::min(resting.lowest, v.z());
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector3d& v : resting.mesh.vertices) {
    if (v.z() < resting.lowest + 0.06) box.extend(Eigen::Vector2d(v.head<2>()));
  }
  resting.middle = box.center();
  return resting;
}

/// Model from world so that, in the foot's frame, the scan's lower part lies over the foot's and its
/// sole at the foot's height.
Eigen::Isometry3d Place(const Resting& foot, const Points& scan, const Eigen::Matrix3d& turn) {
  const Eigen::Matrix3Xd turned = turn * scan.places;
  std::vector<double> heights(static_cast<std::size_t>(turned.cols()));
  for (Eigen::Index i = 0; i < turned.cols(); ++i)
    heights[static_cast<std::size_t>(i)] = turned(2, i);
  const auto low = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 50);
  std::nth_element(heights.begin(), low, heights.end());
  Eigen::AlignedBox2d box;
  for (Eigen::Index i = 0; i < turned.cols(); ++i) {
    if (turned(2, i) < *low + 0.06) box.extend(Eigen::Vector2d(turned.col(i).head<2>()));
  }
  Eigen::Isometry3d placed = Eigen::Isometry3d::Identity();
  placed.linear() = turn;
  placed.translation() << foot.middle - box.center(), foot.lowest - *low;
  return placed;
}

struct Found {
  double distance_m = -1;  ///< -1: nothing near
  bool counts = true;      ///< false: beyond the rim
  Eigen::Vector3d normal;
  double signed_m = 0;     ///< along the normal
};

Found FindOne(const Resting& foot, const Eigen::Vector3d& p, const Eigen::Vector3d* scan_normal,
              double radius_m) {
  Found found;
  if (foot.rim.Beyond(p)) {
    found.counts = false;
    return found;
  }
  const auto hit = foot.query.Closest(p, radius_m);
  if (!hit) return found;
  const Eigen::Vector3i& t = foot.mesh.triangles[static_cast<std::size_t>(hit->point.triangle)];
  found.normal.setZero();
  for (int k = 0; k < 3; ++k)
    found.normal += hit->point.barycentric[k] * foot.normals[static_cast<std::size_t>(t[k])];
  found.normal.normalize();
  if (scan_normal && scan_normal->dot(found.normal) < 0.2) return found;
  found.distance_m = hit->distance_m;
  found.signed_m = (p - hit->position).dot(found.normal);
  return found;
}

/// One step of iterative closest points; false if too few points pull.
bool Step(const Resting& foot, const Points& scan, double radius_m, double kernel_m,
          Eigen::Isometry3d& model_from_world) {
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Identity() * 1e-6;
  Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
  int pulling = 0;
  for (Eigen::Index i = 0; i < scan.places.cols(); ++i) {
    const Eigen::Vector3d p = model_from_world * scan.places.col(i);
    const Eigen::Vector3d n = scan.normals.cols()
                                  ? Eigen::Vector3d(model_from_world.linear() * scan.normals.col(i))
                                  : Eigen::Vector3d::Zero();
    const Found found = FindOne(foot, p, scan.normals.cols() ? &n : nullptr, radius_m);
    if (found.distance_m < 0) continue;
    const double scale = kernel_m * kernel_m,
                 weight = std::pow(scale / (scale + found.distance_m * found.distance_m), 2);
    Eigen::Matrix<double, 6, 1> row;
    row << p.cross(found.normal), found.normal;
    normal += weight * row * row.transpose();
    right -= weight * found.signed_m * row;
    ++pulling;
  }
  if (pulling < 20) return false;
  const Eigen::Matrix<double, 6, 1> step = normal.ldlt().solve(right);
  const Eigen::Vector3d turn = step.head<3>();
  const double angle = std::min(turn.norm(), 0.3);
  Eigen::Isometry3d move = Eigen::Isometry3d::Identity();
  if (angle > 0) move.linear() = Eigen::AngleAxisd(angle, turn.normalized()).toRotationMatrix();
  move.translation() = step.tail<3>();
  model_from_world = move * model_from_world;
  return true;
}

/// How badly scan and foot cover each other: mean robust distance of the scan's points to the foot,
/// and half of that of the foot's vertices to the scan (half, as parts of a foot may be unseen).
double Cost(const Resting& foot, const Points& scan, const Eigen::Isometry3d& model_from_world,
            const FootStartOptions& options) {
  const double scale = options.kernel_m * options.kernel_m;
  const Eigen::Matrix3Xd placed = model_from_world * scan.places;
  double sum = 0;
  int counted = 0;
  for (Eigen::Index i = 0; i < placed.cols(); ++i) {
    const Eigen::Vector3d n = scan.normals.cols()
                                  ? Eigen::Vector3d(model_from_world.linear() * scan.normals.col(i))
                                  : Eigen::Vector3d::Zero();
    const Found found = FindOne(foot, placed.col(i), scan.normals.cols() ? &n : nullptr, 0.03);
    if (!found.counts) continue;
    ++counted;
    const double d2 = found.distance_m * found.distance_m;
    sum += found.distance_m < 0 ? 1 : d2 / (d2 + scale);
  }
  if (4 * counted < placed.cols()) return 1.5;
  double back = 0;
  int vertices = 0;
  for (std::size_t v = 0; v < foot.mesh.vertices.size(); ++v) {
    if (foot.boundary[v]) continue;
    // The scan is thinned to points some 10 mm apart: half of that is no distance.
    const double d =
        std::max(0.0, std::sqrt((placed.colwise() - foot.mesh.vertices[v]).colwise().squaredNorm()
                                    .minCoeff()) - 0.006);
    back += d * d / (d * d + scale);
    ++vertices;
  }
  return sum / counted + 0.5 * back / std::max(vertices, 1);
}

ModelParameters ParametersOf(const FootModel& model, const Eigen::VectorXd& beta,
                             const Eigen::Isometry3d& world_from_model) {
  ModelParameters parameters = RestParameters(model);
  parameters.beta = beta;
  const Eigen::AngleAxisd turn(world_from_model.rotation());
  parameters.theta.row(0) = turn.angle() * turn.axis().transpose();
  // Forward turns about the root joint.
  const Eigen::Vector3d root = RestJoints(model, beta).row(0).transpose();
  parameters.translation_m = world_from_model * root - root;
  return parameters;
}

double AngleBetween(double a, double b) { return std::abs(std::remainder(a - b, 2 * M_PI)); }

struct Placement {
  Eigen::Isometry3d model_from_world;
  double cost = 2;
};

double HeadingOf(const Eigen::Isometry3d& model_from_world) {
  const Eigen::Vector3d toes = model_from_world.linear().transpose() * Eigen::Vector3d::UnitY();
  return std::atan2(-toes.x(), toes.y());
}

/// Improves all in parallel and sorts them by cost.
void Align(const Resting& foot, const Points& scan, int rounds, double radius_m, double kernel_m,
           const FootStartOptions& options, std::vector<Placement>& placements) {
  tbb::parallel_for(std::size_t{0}, placements.size(), [&](std::size_t i) {
    for (int round = 0; round < rounds; ++round) {
      if (!Step(foot, scan, radius_m, kernel_m, placements[i].model_from_world)) break;
    }
    placements[i].cost = Cost(foot, scan, placements[i].model_from_world, options);
  });
  std::stable_sort(placements.begin(), placements.end(),
                   [](const Placement& a, const Placement& b) { return a.cost < b.cost; });
}

std::vector<Placement> SearchSide(const Resting& foot, const Points& scan,
                                  std::optional<double> heading, const FootStartOptions& options) {
  std::vector<Placement> placements;
  for (int h = 0; h < kHeadings; ++h) {
    const double yaw = 2 * M_PI * h / kHeadings;
    if (heading && AngleBetween(yaw, *heading) > M_PI / 3) continue;
    for (const double pitch : kPitches_rad) {
      const Eigen::Matrix3d world_from_model =
          (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
           Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()))
              .toRotationMatrix();
      placements.push_back({Place(foot, scan, world_from_model.transpose())});
    }
  }
  Align(foot, scan, 6, options.radius_m, 0.02, options, placements);
  placements.resize(std::min<std::size_t>(placements.size(), 4 * options.keep));
  Align(foot, scan, 8, 0.6 * options.radius_m, 0.01, options, placements);
  std::vector<Placement> distinct;
  for (const Placement& p : placements) {
    const bool known = std::any_of(distinct.begin(), distinct.end(), [&](const Placement& d) {
      const Eigen::Isometry3d between = d.model_from_world * p.model_from_world.inverse();
      return Eigen::AngleAxisd(between.rotation()).angle() < 0.1 && between.translation().norm() < 0.01;
    });
    if (!known && distinct.size() < options.keep) distinct.push_back(p);
  }
  return distinct;
}

}  // namespace

RimPlane RimPlaneOf(const TriangleMesh& surface, const std::vector<bool>& boundary) {
  RimPlane plane;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> rim;
  for (std::size_t v = 0; v < surface.vertices.size(); ++v) {
    middle += surface.vertices[v];
    if (boundary[v]) rim.push_back(surface.vertices[v]);
  }
  if (rim.size() < 3) return plane;
  middle /= static_cast<double>(surface.vertices.size());
  for (const Eigen::Vector3d& p : rim) plane.point += p / static_cast<double>(rim.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : rim)
    scatter += (p - plane.point) * (p - plane.point).transpose();
  plane.normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvectors().col(0);
  if (plane.normal.dot(plane.point - middle) < 0) plane.normal = -plane.normal;
  return plane;
}

double HeadingOf(const ModelParameters& parameters) {
  const Eigen::Vector3d turn = parameters.theta.row(0).transpose();
  const double angle = turn.norm();
  const Eigen::Vector3d toes =
      angle > 0 ? Eigen::Vector3d(Eigen::AngleAxisd(angle, turn / angle) * Eigen::Vector3d::UnitY())
                : Eigen::Vector3d(Eigen::Vector3d::UnitY());
  return std::atan2(-toes.x(), toes.y());
}

std::vector<FootStart> FindFootStarts(const FootModel& right, const FootModel& left,
                                      const PointCloud& scan, const Eigen::VectorXd& beta,
                                      std::optional<Side> side, std::optional<double> heading_rad,
                                      const FootStartOptions& options) {
  const Points points = Thin(scan, options.points);
  std::vector<FootStart> starts;
  if (points.places.cols() < 50) return starts;
  for (const Side s : {Side::kRight, Side::kLeft}) {
    if (side && *side != s) continue;
    const FootModel& model = s == Side::kRight ? right : left;
    const Resting foot = RestingOf(model, beta);
    for (const Placement& p : SearchSide(foot, points, heading_rad, options)) {
      starts.push_back({s, ParametersOf(model, beta, p.model_from_world.inverse()),
                        HeadingOf(p.model_from_world), p.cost});
    }
  }
  std::stable_sort(starts.begin(), starts.end(),
                   [](const FootStart& a, const FootStart& b) { return a.cost < b.cost; });
  return starts;
}

}  // namespace sole::model
