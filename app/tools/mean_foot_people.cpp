#include "app/tools/mean_foot_people.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "sim/reference_foot.h"
#include "sim/subject_shape.h"

namespace sole::tools {
namespace {

constexpr std::uint64_t kSeed = 1;

/// How an invented foot differs from the mean one; all are shares (0.05: five per cent) but the arch.
struct Proportions {
  double size, width, height, ball, heel, ankle, toes, instep;
  double arch_m;
};

Proportions Draw(std::mt19937_64& engine) {
  std::normal_distribution<double> normal(0, 1);
  const auto next = [&](double sd) { return sd * std::clamp(normal(engine), -2.5, 2.5); };
  Proportions p{};
  p.size = next(0.06);
  p.width = next(0.04);
  p.height = next(0.05);
  p.ball = next(0.03);
  p.heel = next(0.03);
  p.ankle = next(0.04);
  p.toes = next(0.06);
  p.instep = next(0.05);
  p.arch_m = next(0.003);
  return p;
}

double Bump(double x, double centre, double width) {
  return std::exp(-0.5 * (x - centre) * (x - centre) / (width * width));
}

/// Smooth step from 0 to 1.
double Rise(double x, double begin, double end) {
  const double t = std::clamp((x - begin) / (end - begin), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// Where the mean foot is; its toes are towards +y.
struct Place {
  double heel_y, length, middle_x;
};

Eigen::Vector3d Deformed(const Eigen::Vector3d& at, const Proportions& p, const Place& foot) {
  const double along = (at.y() - foot.heel_y) / foot.length, up = at.z();
  const double sole = 1 - Rise(up, 0.0, 0.05);
  const double leg = Rise(up, 0.04, 0.1) * (1 - Rise(along, 0.4, 0.7));
  const double wide = (1 + p.width) * (1 + p.ball * Bump(along, 0.7, 0.12)) *
                      (1 + p.heel * Bump(along, 0.1, 0.1) * (1 - leg)) * (1 + p.ankle * leg);
  const double ankle_y = foot.heel_y + 0.22 * foot.length;
  const double toes_y = foot.heel_y + 0.72 * foot.length;
  Eigen::Vector3d moved = at;
  moved.x() = foot.middle_x + wide * (at.x() - foot.middle_x);
  moved.y() += leg * p.ankle * (at.y() - ankle_y) + p.toes * std::max(0.0, at.y() - toes_y);
  moved.z() *= 1 + p.height + p.instep * Bump(along, 0.5, 0.15);
  moved.z() += p.arch_m * sole * Bump(along, 0.42, 0.1);
  return (1 + p.size) * moved;
}

}  // namespace

std::vector<Person> DeformMeanFoot(std::span<const SurfacePoint> points, int count) {
  const sim::Subject mean = sim::MeanSubject();
  const Eigen::MatrixX3d rest = PointsOn(sim::SubjectRestMesh(mean).vertices, points);
  const Eigen::MatrixX3d joints = JointCentres(mean);
  const double heel_y = rest.col(1).minCoeff();
  const Place place{heel_y, rest.col(1).maxCoeff() - heel_y, rest.col(0).mean()};
  std::mt19937_64 engine(kSeed);
  std::vector<Person> people(static_cast<std::size_t>(count));
  for (Person& person : people) {
    const Proportions proportions = Draw(engine);
    const auto deform = [&](Eigen::MatrixX3d all) {
      for (Eigen::Index i = 0; i < all.rows(); ++i)
        all.row(i) = Deformed(all.row(i), proportions, place);
      return all;
    };
    person.rest_m = deform(rest);
    person.joints_m = deform(joints);
  }
  return people;
}

Eigen::MatrixXd FourInfluences(Eigen::MatrixXd weights) {
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    std::vector<double> row(static_cast<std::size_t>(weights.cols()));
    for (Eigen::Index j = 0; j < weights.cols(); ++j) row[static_cast<std::size_t>(j)] = weights(i, j);
    std::sort(row.begin(), row.end(), std::greater<>());
    const double least = row.size() > 4 ? row[3] : 0;
    for (Eigen::Index j = 0; j < weights.cols(); ++j) {
      if (weights(i, j) < least) weights(i, j) = 0;
    }
    weights.row(i) /= weights.row(i).sum();
  }
  return weights;
}

}  // namespace sole::tools
