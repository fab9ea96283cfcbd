#include "sim/shape_solver.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <span>

#include <Eigen/Cholesky>

#include "sim/foot_measures.h"
#include "sim/reference_foot.h"
#include "sim/soft_contact.h"
#include "sim/subject_shape.h"

namespace sole::sim {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A handle, the measure that it moves most, its range and the spread of the measure among people.
struct SolvedHandle {
  double ShapeHandles::* handle;
  const char* measure;
  double low, high;
  double spread_mm;
};
constexpr SolvedHandle kSolved[] = {{&ShapeHandles::scale, "footlength", -0.28, 0.33, 12.8},
                                    {&ShapeHandles::ball_length_mm, "balloffootlength", -12, 14, 10},
                                    {&ShapeHandles::foot_breadth, "footbreadthhorizontal", -0.25, 0.3, 5},
                                    {&ShapeHandles::ball_height, "balloffootcircumference", -0.42, 0.4, 12.3},
                                    {&ShapeHandles::heel_breadth, "heelbreadth", -0.25, 0.4, 5.3},
                                    {&ShapeHandles::ankle_front_mm, "heelanklecircumference", -16, 20, 16},
                                    {&ShapeHandles::malleoli_breadth, "bimalleolarbreadth", -0.3, 0.3, 3.8},
                                    {&ShapeHandles::ankle_height, "lateralmalleolusheight", -0.48, 0.35, 5.4},
                                    {&ShapeHandles::shank_girth, "anklecircumference", -0.3, 0.4, 14.8},
                                    {&ShapeHandles::arch_height_mm, "navicular_height", -9, 10, 16}};
constexpr Index kNumSolved = std::size(kSolved);
constexpr double kGravity = 9.81;

VectorXd Wanted(const std::map<std::string, double>& measures_mm) {
  VectorXd values(kNumSolved);
  for (Index i = 0; i < kNumSolved; ++i) values[i] = measures_mm.at(kSolved[i].measure);
  return values;
}

/// The survey's measures of a standing foot, the navicular's height of the same foot at rest.
VectorXd SolvedMeasures(std::span<const Eigen::Vector3d> standing, std::span<const Eigen::Vector3d> rest) {
  std::map<std::string, double> measures = MeasureFoot(standing, Side::kRight);
  measures["navicular_height"] = NavicularHeight(rest);
  return Wanted(measures);
}

std::vector<Eigen::Vector3d> Carried(const ShapeHandles& handles) {
  return ShapedPoints(MeanAdultTable(), handles, Binding().shares, ReferenceFoot().vertices);
}

/// Measures of the mean foot where the handles carry it, before it is settled on the skin.
VectorXd CarriedMeasures(const ShapeHandles& handles) {
  const std::vector<Eigen::Vector3d> carried = Carried(handles);
  return SolvedMeasures(carried, carried);
}

/// Measures standing at half the body weight, as the survey's people did.
VectorXd StandingMeasures(Subject subject, std::shared_ptr<const SubjectShape> shape) {
  subject.side = Side::kRight;
  subject.shape = std::move(shape);
  const LoadedFoot standing = StandOnPlate(subject, 0.5 * kGravity * subject.weight_kg);
  return SolvedMeasures(standing.foot.vertices_m, subject.shape->rest);
}

/// What settling on the skin and standing add to the carried measures of the mean foot.
const VectorXd& StandingChange() {
  static const VectorXd change = StandingMeasures(MeanSubject(), MeanSubject().shape) - CarriedMeasures({});
  return change;
}

/// Derivative of the carried measures by the handles.
MatrixXd CarriedJacobian(const ShapeHandles& handles) {
  MatrixXd jacobian(kNumSolved, kNumSolved);
  const VectorXd here = CarriedMeasures(handles);
  for (Index i = 0; i < kNumSolved; ++i) {
    const double step = 0.04 * (kSolved[i].high - kSolved[i].low);
    ShapeHandles moved = handles;
    moved.*kSolved[i].handle += step;
    jacobian.col(i) = (CarriedMeasures(moved) - here) / step;
  }
  return jacobian;
}

VectorXd ValuesOf(const ShapeHandles& handles) {
  VectorXd values(kNumSolved);
  for (Index i = 0; i < kNumSolved; ++i) values[i] = handles.*kSolved[i].handle;
  return values;
}

ShapeHandles WithValues(ShapeHandles handles, const VectorXd& values) {
  for (Index i = 0; i < kNumSolved; ++i) handles.*kSolved[i].handle = values[i];
  return handles;
}

/// Damped least squares step towards what is missing (mm); handles that would leave their range stop at its end.
VectorXd Step(const MatrixXd& jacobian, const VectorXd& missing, const VectorXd& values, double damping) {
  VectorXd step = VectorXd::Zero(kNumSolved), range(kNumSolved), weight(kNumSolved);
  for (Index i = 0; i < kNumSolved; ++i) {
    range[i] = kSolved[i].high - kSolved[i].low;
    weight[i] = 1 / kSolved[i].spread_mm;
  }
  std::vector<bool> stopped(static_cast<std::size_t>(kNumSolved), false);
  for (bool again = true; again;) {
    again = false;
    MatrixXd columns = weight.asDiagonal() * jacobian * range.asDiagonal();
    VectorXd residual = weight.cwiseProduct(missing - jacobian * step);
    for (Index i = 0; i < kNumSolved; ++i) {
      if (stopped[static_cast<std::size_t>(i)]) columns.col(i).setZero();
      else residual += columns.col(i) * (step[i] / range[i]);
    }
    MatrixXd normal = columns.transpose() * columns;
    normal.diagonal().array() += damping;
    const VectorXd free = normal.ldlt().solve(columns.transpose() * residual).cwiseProduct(range);
    for (Index i = 0; i < kNumSolved; ++i) {
      if (stopped[static_cast<std::size_t>(i)]) continue;
      const double low = kSolved[i].low - values[i], high = kSolved[i].high - values[i];
      step[i] = std::clamp(free[i], low, high);
      if (free[i] >= low && free[i] <= high) continue;
      stopped[static_cast<std::size_t>(i)] = again = true;
    }
  }
  return step;
}

struct Solved {
  ShapeHandles handles;
  MatrixXd jacobian;
};

/// Broyden's method from `start` with a first derivative: measures until all are within `close_mm` or `evaluations` are used up, or
/// nothing is gained, and returns the best.
Solved Solve(const std::function<VectorXd(const ShapeHandles&)>& measure, const VectorXd& wanted_mm, Solved start, double close_mm,
             int evaluations) {
  VectorXd values = ValuesOf(start.handles), missing = wanted_mm - measure(start.handles), weight(kNumSolved);
  for (Index i = 0; i < kNumSolved; ++i) weight[i] = 1 / kSolved[i].spread_mm;
  const auto cost = [&](const VectorXd& m) { return m.cwiseProduct(weight).squaredNorm(); };
  double damping = 1e-6;
  for (int i = 1; i < evaluations && missing.cwiseAbs().maxCoeff() > close_mm; ++i) {
    const VectorXd step = Step(start.jacobian, missing, values, damping);
    const VectorXd next = wanted_mm - measure(WithValues(start.handles, values + step));
    VectorXd scaled(kNumSolved);  // Broyden's update in units of the handles' ranges
    for (Index k = 0; k < kNumSolved; ++k) scaled[k] = step[k] / std::pow(kSolved[k].high - kSolved[k].low, 2);
    const double length = scaled.dot(step);
    if (length < 1e-12) break;
    start.jacobian += (missing - next - start.jacobian * step) * scaled.transpose() / length;
    if (cost(next) < cost(missing)) {
      const bool settled = cost(next) > 0.95 * cost(missing);
      values += step;
      missing = next;
      if (settled) break;
      damping = std::max(0.1 * damping, 1e-6);
    } else {
      damping = std::max(30 * damping, 1e-3);
    }
  }
  start.handles = WithValues(start.handles, values);
  return start;
}

}  // namespace

std::shared_ptr<const SubjectShape> SolveShape(const ShapeHandles& habit, const Subject& subject) {
  static const MatrixXd mean_jacobian = CarriedJacobian({});
  const VectorXd wanted = Wanted(subject.measures_mm);
  ShapeHandles start = habit;
  start.scale = wanted[0] / CarriedMeasures({})[0] - 1;
  // First the cheap way, on vertices that are only carried along; then on the standing foot.
  Solved carried = Solve(CarriedMeasures, wanted - StandingChange(), {start, mean_jacobian}, 0.1, 14);
  const auto standing = [&](const ShapeHandles& handles) {
    SubjectShape shape{handles, ShapedTable(MeanAdultTable(), handles), Carried(handles)};
    return StandingMeasures(subject, std::make_shared<const SubjectShape>(std::move(shape)));
  };
  carried.jacobian = CarriedJacobian(carried.handles);
  const Solved solved = Solve(standing, wanted, carried, 0.5, 8);
  return std::make_shared<const SubjectShape>(MakeShape(solved.handles));
}

}  // namespace sole::sim
