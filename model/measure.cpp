#include "model/measure.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <Eigen/SVD>

namespace sole::model {
namespace {

/// Registered vertices in the foot's frame (see the header); x lateral on either side.
Eigen::MatrixX3d InFootFrame(const FootModel& model, const Eigen::MatrixX3d& vertices, const GroundPlane& ground) {
  const Eigen::Index n = model.NumVertices();
  const Eigen::MatrixX3d& rest = model.coarse.template_m;
  const Eigen::RowVector3d rest_mean = rest.colwise().mean(), mean = vertices.topRows(n).colwise().mean();
  const Eigen::Matrix3d cross = (vertices.topRows(n).rowwise() - mean).transpose() * (rest.rowwise() - rest_mean);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d turn = svd.matrixU() *
                               Eigen::Vector3d(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant()).asDiagonal() *
                               svd.matrixV().transpose();
  const Eigen::Vector3d up = Eigen::Vector3d(-ground.slope_x, -ground.slope_y, 1).normalized();
  Eigen::Vector3d forward = turn * Eigen::Vector3d::UnitY();
  forward = (forward - forward.dot(up) * up).normalized();
  Eigen::Matrix3d axes;
  axes << forward.cross(up), forward, up;
  Eigen::MatrixX3d result = (vertices.rowwise() - Eigen::RowVector3d(0, 0, ground.offset_m)) * axes;
  // x is measured from the template's own axis (x = 0 of its frame).
  const Eigen::RowVector3d origin = mean - (turn * rest_mean.transpose()).transpose();
  result.col(0).array() -= (origin - Eigen::RowVector3d(0, 0, ground.offset_m)).dot(axes.col(0));
  result.col(1).array() -= result.col(1).minCoeff();
  if (model.side == Side::kLeft) result.col(0) *= -1;
  return result;
}

/// Points where the mesh's edges cross the plane on which coordinate `axis` is `value`.
std::vector<Eigen::Vector3d> Slice(const ModelSurface& surface, const Eigen::MatrixX3d& vertices, double value,
                                   int axis = 1) {
  std::vector<Eigen::Vector3d> points;
  for (Eigen::Index t = 0; t < surface.triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d a = vertices.row(surface.triangles(t, k)), b = vertices.row(surface.triangles(t, (k + 1) % 3));
      if ((a[axis] < value) == (b[axis] < value)) continue;
      points.push_back(a + (value - a[axis]) / (b[axis] - a[axis]) * (b - a));
    }
  }
  return points;
}

struct Extent {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  void Add(double value) { low = std::min(low, value), high = std::max(high, value); }
  double Size() const { return high - low; }
};

/// Standard deviation of the coarse vertex nearest to a foot-frame point.
double DeviationNear(const Eigen::MatrixX3d& vertices, const FrameFit& frame, const Eigen::Vector3d& point) {
  Eigen::Index nearest = 0;
  (vertices.topRows(frame.vertex_sd_m.size()).rowwise() - point.transpose()).rowwise().squaredNorm().minCoeff(&nearest);
  const double registered = nearest < frame.registration_sd_m.size() ? frame.registration_sd_m[nearest] : 1.0;
  return std::min(frame.vertex_sd_m[nearest], registered);
}

}  // namespace

std::vector<FootMeasure> MeasureFrame(const FootModel& model, const FrameFit& frame, const GroundPlane& ground) {
  if (!frame.found) return {};
  const bool fine = frame.registration_fine_m.rows() > 0;
  const ModelSurface& surface = fine ? model.fine : model.coarse;
  const Eigen::MatrixX3d v = InFootFrame(model, fine ? frame.registration_fine_m : frame.registration_m, ground);
  const auto sd = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return std::hypot(DeviationNear(v, frame, a), DeviationNear(v, frame, b));
  };

  Eigen::Index heel = -1, toe = -1;
  for (Eigen::Index i = 0; i < v.rows(); ++i) {
    if (v(i, 2) > 0.06) continue;
    if (heel < 0 || v(i, 1) < v(heel, 1)) heel = i;
    if (toe < 0 || v(i, 1) > v(toe, 1)) toe = i;
  }
  if (heel < 0) return {};
  const double length = v(toe, 1) - v(heel, 1), start = v(heel, 1);
  std::vector<FootMeasure> measures{{"length", length, sd(v.row(heel), v.row(toe))}};

  Extent ball;
  Eigen::Vector3d medial = Eigen::Vector3d::Zero(), lateral = medial;
  for (double share = 0.55; share <= 0.80; share += 0.01) {
    for (const Eigen::Vector3d& p : Slice(surface, v, start + share * length)) {
      if (p.z() > 0.06) continue;
      if (p.x() < ball.low) medial = p;
      if (p.x() > ball.high) lateral = p;
      ball.Add(p.x());
    }
  }
  measures.push_back({"ball_width", ball.Size(), sd(medial, lateral)});

  double heel_sum = 0;
  int slices = 0;
  Eigen::Vector3d side = Eigen::Vector3d::Zero();
  for (double share = 0.13; share < 0.195; share += 0.01, ++slices) {
    Extent width;
    for (const Eigen::Vector3d& p : Slice(surface, v, start + share * length)) {
      if (p.z() > 0.04) continue;
      width.Add(p.x());
      side = p;
    }
    heel_sum += width.Size();
  }
  measures.push_back({"heel_width", heel_sum / slices, sd(side, side)});

  Extent instep;
  Eigen::Vector3d top = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : Slice(surface, v, start + 0.5 * length)) {
    if (p.z() > instep.high) top = p;
    instep.Add(p.z());
  }
  measures.push_back({"instep_height", instep.high, std::hypot(DeviationNear(v, frame, top), ground.sigma_m)});

  Extent arch;
  Eigen::Vector3d vault = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : Slice(surface, v, -0.02, 0)) {  // medial is negative x
    const double share = (p.y() - start) / length;
    if (share < 0.36 || share > 0.52 || p.z() > 0.04) continue;
    if (p.z() > arch.high) vault = p;
    arch.Add(p.z());
  }
  if (std::isfinite(arch.high)) {
    measures.push_back({"arch_height", arch.high, std::hypot(DeviationNear(v, frame, vault), ground.sigma_m)});
  }
  std::erase_if(measures, [](const FootMeasure& m) { return !std::isfinite(m.value_m); });
  return measures;
}

bool StandsOnGround(const FootModel& model, const FrameFit& frame, const GroundPlane& ground) {
  constexpr double kNear_m = 0.004;
  if (!frame.found) return false;
  const bool fine = frame.registration_fine_m.rows() > 0;
  const Eigen::MatrixX3d v =
      InFootFrame(model, fine ? frame.registration_fine_m : frame.registration_m, ground);
  const double length = v.col(1).maxCoeff();  // from the heel or the shank behind it
  Extent heel, ball;
  for (Eigen::Index i = 0; i < v.rows(); ++i) {
    const double share = v(i, 1) / length;
    if (share < 0.3) heel.Add(v(i, 2));
    if (share > 0.55 && share < 0.85) ball.Add(v(i, 2));
  }
  return heel.low < kNear_m && ball.low < kNear_m;
}

}  // namespace sole::model
