#include "bench/accuracy/error_covariance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>

namespace sole::bench {
namespace {

constexpr std::array kLimits_m = {0.0005, 0.001, 0.0015, 0.002, 0.003, 0.004,
                                  0.006,  0.008, 0.012,  0.016, 0.024, 0.032};
constexpr std::array kLengths_m = {0.0, 0.001, 0.002, 0.004, 0.008, 0.016};

std::uint64_t CellKey(std::int64_t x, std::int64_t y, std::int64_t z) {
  constexpr std::int64_t kOffset = 1 << 20, kMask = 0x1FFFFF;
  return static_cast<std::uint64_t>((((x + kOffset) & kMask) << 42) |
                                    (((y + kOffset) & kMask) << 21) | ((z + kOffset) & kMask));
}

std::array<std::int64_t, 3> CellOf(const Eigen::Vector3d& p, double cell_m) {
  std::array<std::int64_t, 3> cell{};
  for (int axis = 0; axis < 3; ++axis)
    cell[static_cast<std::size_t>(axis)] = static_cast<std::int64_t>(std::floor(p[axis] / cell_m));
  return cell;
}

}  // namespace

Covariance MeasureCovariance(const std::vector<FieldSample>& samples) {
  std::map<int, std::vector<const FieldSample*>> frames;
  Covariance result;
  for (const FieldSample& s : samples) {
    frames[s.frame].push_back(&s);
    result.variance += s.value * s.value / static_cast<double>(samples.size());
  }
  std::array<double, kLimits_m.size()> products{}, distances{}, counts{};
  for (const auto& [frame, of_frame] : frames) {
    // Every point against a tenth of the others is plenty.
    for (std::size_t i = 0; i < of_frame.size(); i += 10) {
      for (const FieldSample* other : of_frame) {
        const double distance = (other->point_m - of_frame[i]->point_m).norm();
        if (other == of_frame[i] || distance >= kLimits_m.back()) continue;
        const auto bin = static_cast<std::size_t>(
            std::upper_bound(kLimits_m.begin(), kLimits_m.end(), distance) - kLimits_m.begin());
        products[bin] += other->value * of_frame[i]->value;
        distances[bin] += distance;
        ++counts[bin];
      }
    }
  }
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] < 100) continue;
    result.distance_m.push_back(distances[i] / counts[i]);
    result.value.push_back(products[i] / counts[i]);
  }
  return result;
}

std::vector<sim::NoiseComponent> FitComponents(const Covariance& covariance) {
  // Coordinate descent on |A x - b|^2 with x >= 0 and sum x = variance; the last row asks for the
  // sum.
  const auto rows = static_cast<Eigen::Index>(covariance.value.size());
  const auto columns = static_cast<Eigen::Index>(kLengths_m.size());
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(rows + 1, columns);
  Eigen::VectorXd b(rows + 1);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double d = covariance.distance_m[static_cast<std::size_t>(i)];
    for (Eigen::Index k = 1; k < columns; ++k) {
      const double length = kLengths_m[static_cast<std::size_t>(k)];
      a(i, k) = std::exp(-d * d / (2 * length * length));
    }
    b[i] = covariance.value[static_cast<std::size_t>(i)] / covariance.variance;
  }
  constexpr double kSumWeight = 100;
  a.row(rows).setConstant(kSumWeight);
  b[rows] = kSumWeight;
  Eigen::VectorXd x = Eigen::VectorXd::Constant(columns, 1.0 / static_cast<double>(columns));
  for (int round = 0; round < 20000; ++round) {
    for (Eigen::Index k = 0; k < columns; ++k) {
      const double step = a.col(k).dot(b - a * x) / a.col(k).squaredNorm();
      x[k] = std::max(0.0, x[k] + step);
    }
  }
  x /= x.sum();
  std::vector<sim::NoiseComponent> components;
  for (Eigen::Index k = 0; k < columns; ++k) {
    if (x[k] > 0.005) components.push_back({kLengths_m[static_cast<std::size_t>(k)], x[k]});
  }
  double sum = 0;
  for (const sim::NoiseComponent& c : components) sum += c.share;
  for (sim::NoiseComponent& c : components) c.share /= sum;
  return components;
}

double FallLength(const Covariance& covariance) {
  const double limit = std::exp(-0.5) * covariance.value.front();
  for (std::size_t i = 1; i < covariance.value.size(); ++i) {
    if (covariance.value[i] > limit) continue;
    const double share =
        (covariance.value[i - 1] - limit) / (covariance.value[i - 1] - covariance.value[i]);
    return covariance.distance_m[i - 1] +
           share * (covariance.distance_m[i] - covariance.distance_m[i - 1]);
  }
  return covariance.distance_m.back();
}

PointGrid::PointGrid(const std::vector<Eigen::Vector3f>& points_m, double cell_m)
    : cell_m_(cell_m) {
  for (const Eigen::Vector3f& p : points_m) {
    const auto cell = CellOf(p.cast<double>(), cell_m);
    sorted_.emplace_back(CellKey(cell[0], cell[1], cell[2]), p);
  }
  std::sort(sorted_.begin(), sorted_.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
}

bool PointGrid::HasNear(const Eigen::Vector3d& point_m, double radius_m) const {
  const auto cell = CellOf(point_m, cell_m_);
  const auto less = [](const auto& entry, std::uint64_t key) { return entry.first < key; };
  for (int i = 0; i < 27; ++i) {
    const std::uint64_t key =
        CellKey(cell[0] + i % 3 - 1, cell[1] + i / 3 % 3 - 1, cell[2] + i / 9 - 1);
    for (auto at = std::lower_bound(sorted_.begin(), sorted_.end(), key, less);
         at != sorted_.end() && at->first == key; ++at) {
      if ((at->second.cast<double>() - point_m).norm() <= radius_m) return true;
    }
  }
  return false;
}

}  // namespace sole::bench
