#include "model/surface_system_internal.h"

#include <cmath>

#include <Eigen/LU>

namespace sole::model {
namespace {

void Multiply(const BlockSystem& system, const Eigen::Matrix3Xd& x, Eigen::Matrix3Xd& y) {
  for (std::size_t v = 0; v < system.diagonal.size(); ++v) {
    const auto column = static_cast<Eigen::Index>(v);
    y.col(column).noalias() = system.diagonal[v] * x.col(column);
  }
  for (std::size_t e = 0; e < system.edges.size(); ++e) {
    const auto [a, b] = system.edges[e];
    y.col(a).noalias() += system.coupling[e] * x.col(b);
    y.col(b).noalias() += system.coupling[e].transpose() * x.col(a);
  }
}

double Dot(const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b) { return a.cwiseProduct(b).sum(); }

}  // namespace

Eigen::Matrix3Xd Solve(const BlockSystem& system, const Eigen::Matrix3Xd& start, double tolerance,
                       int iterations) {
  std::vector<Eigen::Matrix3d> inverse;
  inverse.reserve(system.diagonal.size());
  for (const Eigen::Matrix3d& block : system.diagonal) inverse.push_back(block.inverse());
  const auto precondition = [&](const Eigen::Matrix3Xd& r, Eigen::Matrix3Xd& z) {
    for (std::size_t v = 0; v < inverse.size(); ++v) {
      const auto column = static_cast<Eigen::Index>(v);
      z.col(column).noalias() = inverse[v] * r.col(column);
    }
  };
  Eigen::Matrix3Xd x = start, product(3, start.cols()), z(3, start.cols());
  Multiply(system, x, product);
  Eigen::Matrix3Xd residual = system.right - product;
  precondition(residual, z);
  Eigen::Matrix3Xd direction = z;
  double energy = Dot(residual, z);
  const double enough = tolerance * system.right.norm();
  for (int i = 0; i < iterations && residual.norm() > enough; ++i) {
    Multiply(system, direction, product);
    const double step = energy / Dot(direction, product);
    x += step * direction;
    residual -= step * product;
    precondition(residual, z);
    const double next = Dot(residual, z);
    direction = z + (next / energy) * direction;
    energy = next;
  }
  return x;
}

}  // namespace sole::model
