#include "calib/edge_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace sole::calib {
namespace {

constexpr double kMinContrast = 8;  // grey levels, half the step

/// Brightness of a pixel, relative to the centre of the fit.
struct Sample {
  Eigen::Vector2d offset;
  double value;
};

template <int kParameters>
struct Fit {
  Eigen::Matrix<double, kParameters, 1> x;
  Eigen::Matrix<double, kParameters, kParameters> covariance;
  double residual_rms = 0;
};

/// Levenberg-Marquardt on brightness samples. `model(x, offset, gradient)` returns the brightness.
template <int kParameters, typename Model>
std::optional<Fit<kParameters>> FitSamples(const std::vector<Sample>& samples,
                                           Eigen::Matrix<double, kParameters, 1> x,
                                           const Model& model) {
  using Vector = Eigen::Matrix<double, kParameters, 1>;
  using Matrix = Eigen::Matrix<double, kParameters, kParameters>;
  const auto linearise = [&](const Vector& at, Matrix& normal, Vector& right) {
    normal.setZero();
    right.setZero();
    double cost = 0;
    for (const Sample& sample : samples) {
      Vector gradient;
      const double residual = model(at, sample.offset, gradient) - sample.value;
      normal.template selfadjointView<Eigen::Lower>().rankUpdate(gradient);
      right += gradient * residual;
      cost += residual * residual;
    }
    normal = Matrix(normal.template selfadjointView<Eigen::Lower>());
    return cost;
  };
  if (samples.size() < 3 * kParameters) return {};
  Matrix normal;
  Vector right;
  double cost = linearise(x, normal, right), damping = 1e-3;
  for (int iteration = 0; iteration < 30; ++iteration) {
    Matrix damped = normal;
    damped.diagonal() += damping * normal.diagonal();
    const Vector step = damped.ldlt().solve(right);
    if (!step.allFinite()) return {};
    Matrix next_normal;
    Vector next_right;
    const Vector next = x - step;
    const double next_cost = linearise(next, next_normal, next_right);
    if (next_cost <= cost) {
      const bool done = cost - next_cost < 1e-6 * cost;
      x = next;
      normal = next_normal;
      right = next_right;
      cost = next_cost;
      damping = std::max(1e-9, damping * 0.1);
      if (done) break;
    } else {
      damping *= 10;
      if (damping > 1e6) break;
    }
  }
  const double freedom = static_cast<double>(samples.size() - kParameters);
  Fit<kParameters> fit{x, normal.inverse() * (cost / freedom), std::sqrt(cost / freedom)};
  // Samples that do not determine all parameters: rounding can turn a variance negative.
  if (!fit.x.allFinite() || !fit.covariance.allFinite() || !(fit.covariance.diagonal().minCoeff() >= 0))
    return {};
  return fit;
}

double ErfSlope(double u) { return 2 / std::sqrt(std::numbers::pi) * std::exp(-u * u); }

/// x: a, g (2), b, centre (2), angle of the normals of both lines (2), blur.
double SaddleBrightness(const Eigen::Matrix<double, 9, 1>& x, const Eigen::Vector2d& p,
                        Eigen::Matrix<double, 9, 1>& gradient) {
  const Eigen::Vector2d q = p - x.segment<2>(4);
  const double blur = x[8];
  double value[2], slope[2], distance[2], turn[2];
  Eigen::Vector2d normal[2];
  for (int i = 0; i < 2; ++i) {
    normal[i] = {std::cos(x[6 + i]), std::sin(x[6 + i])};
    distance[i] = normal[i].dot(q);
    turn[i] = -normal[i].y() * q.x() + normal[i].x() * q.y();
    value[i] = std::erf(distance[i] / blur);
    slope[i] = ErfSlope(distance[i] / blur) / blur;
  }
  const double b = x[3];
  gradient[0] = 1;
  gradient.segment<2>(1) = p;
  gradient[3] = value[0] * value[1];
  gradient.segment<2>(4) = -b * (slope[0] * value[1] * normal[0] + value[0] * slope[1] * normal[1]);
  gradient[6] = b * slope[0] * turn[0] * value[1];
  gradient[7] = b * slope[1] * turn[1] * value[0];
  gradient[8] = -b * (slope[0] * distance[0] * value[1] + value[0] * slope[1] * distance[1]) / blur;
  return x[0] + x.segment<2>(1).dot(p) + b * gradient[3];
}

/// x: a, slope along the edge, b, distance of the edge, its angle, blur. `along` and `across` as
/// offset.
double EdgeBrightness(const Eigen::Matrix<double, 6, 1>& x, const Eigen::Vector2d& p,
                      Eigen::Matrix<double, 6, 1>& gradient) {
  const double distance = p.y() - x[3] - x[4] * p.x(), blur = x[5];
  const double value = std::erf(distance / blur), slope = ErfSlope(distance / blur) / blur;
  gradient << 1, p.x(), value, -x[2] * slope, -x[2] * slope * p.x(),
      -x[2] * slope * distance / blur;
  return x[0] + x[1] * p.x() + x[2] * value;
}

double Bilinear(const ImageU8& image, double x, double y) {
  const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
  const double fx = x - ix, fy = y - iy;
  return (1 - fy) * ((1 - fx) * image.At(ix, iy) + fx * image.At(ix + 1, iy)) +
         fy * ((1 - fx) * image.At(ix, iy + 1) + fx * image.At(ix + 1, iy + 1));
}

bool Inside(const ImageU8& image, const Eigen::Vector2d& p, double margin) {
  return p.x() >= margin && p.y() >= margin && p.x() <= image.width - 1 - margin &&
         p.y() <= image.height - 1 - margin;
}

/// Pixels around the guess that show nothing but the four squares.
std::vector<Sample> SaddleSamples(const ImageU8& image, const SaddleGuess& guess,
                                  double radius_px) {
  Eigen::Matrix2d image_from_board;
  image_from_board << guess.along_x, guess.along_y;
  const Eigen::Matrix2d board_from_image = image_from_board.inverse();
  const int reach = static_cast<int>(std::ceil(radius_px));
  const int cx = static_cast<int>(std::lround(guess.pixel.x())),
            cy = static_cast<int>(std::lround(guess.pixel.y()));
  std::vector<Sample> samples;
  for (int y = cy - reach; y <= cy + reach; ++y) {
    for (int x = cx - reach; x <= cx + reach; ++x) {
      const Eigen::Vector2d offset = Eigen::Vector2d(x, y) - guess.pixel;
      if (offset.norm() > radius_px) continue;
      const Eigen::Vector2d board = (board_from_image * offset).cwiseAbs();
      if (board.minCoeff() > guess.clear || board.maxCoeff() > 0.8) continue;
      samples.push_back({offset, static_cast<double>(image.At(x, y))});
    }
  }
  return samples;
}

/// An edge as a line in the image: point, unit direction, and the fit's covariance of distance and
/// angle.
struct EdgeLine {
  Eigen::Vector2d point, direction;
  double sigma_px;
};

std::optional<EdgeLine> FitEdge(const ImageU8& image, Eigen::Vector2d from, Eigen::Vector2d to,
                                double strip_px) {
  std::optional<EdgeLine> line;
  for (int pass = 0; pass < 2; ++pass) {
    const Eigen::Vector2d direction = (to - from).normalized(),
                          normal(-direction.y(), direction.x());
    const Eigen::Vector2d middle = 0.5 * (from + to);
    const double half = 0.5 * (to - from).norm() - 1.5 * strip_px;
    if (half < 2) return {};
    std::vector<Sample> samples;
    double low = 0, high = 0;
    int count = 0;
    for (double along = -half; along <= half; along += 1) {
      for (double across = -strip_px; across <= strip_px; across += 0.5) {
        const Eigen::Vector2d p = middle + along * direction + across * normal;
        if (!Inside(image, p, 1)) return {};
        samples.push_back({{along, across}, Bilinear(image, p.x(), p.y())});
        (across < 0 ? low : high) += samples.back().value;
        ++count;
      }
    }
    low /= 0.5 * count;
    high /= 0.5 * count;
    Eigen::Matrix<double, 6, 1> x;
    x << 0.5 * (low + high), 0, 0.5 * (high - low), 0, 0, 1.0;
    const auto fit = FitSamples<6>(samples, x, EdgeBrightness);
    if (!fit) return {};
    const double contrast = std::abs(fit->x[2]);
    if (contrast < kMinContrast || std::abs(fit->x[3]) > strip_px || std::abs(fit->x[4]) > 0.2 ||
        fit->residual_rms > 0.25 * contrast) {
      return {};
    }
    // Samples half a pixel apart and interpolated share noise: about four of them are worth one.
    const double sigma = 2 * std::sqrt(fit->covariance(3, 3) + fit->covariance(4, 4) * half * half);
    line =
        EdgeLine{middle + fit->x[3] * normal, (direction + fit->x[4] * normal).normalized(), sigma};
    // The second pass follows the edge that the first one found.
    const Eigen::Vector2d shift_from = fit->x[3] * normal - half * fit->x[4] * normal;
    const Eigen::Vector2d shift_to = fit->x[3] * normal + half * fit->x[4] * normal;
    from += shift_from;
    to += shift_to;
  }
  return line;
}

}  // namespace

std::optional<FittedPoint> FitSaddle(const ImageU8& image, const SaddleGuess& guess,
                                     double radius_px) {
  FittedPoint point{guess.pixel, 0};
  SaddleGuess current = guess;
  for (int pass = 0; pass < 2; ++pass) {
    if (!Inside(image, current.pixel, radius_px + 1)) return {};
    const std::vector<Sample> samples = SaddleSamples(image, current, radius_px);
    double mean = 0, square = 0;
    for (const Sample& sample : samples) {
      mean += sample.value;
      square += sample.value * sample.value;
    }
    if (samples.empty()) return {};
    mean /= static_cast<double>(samples.size());
    const double spread =
        std::sqrt(std::max(0.0, square / static_cast<double>(samples.size()) - mean * mean));
    // Normals of the lines: the line y = 0 runs along the rows; its normal points to positive y,
    // and so on.
    const auto normal_angle = [](const Eigen::Vector2d& along, const Eigen::Vector2d& towards) {
      Eigen::Vector2d normal(-along.y(), along.x());
      if (normal.dot(towards) < 0) normal = -normal;
      return std::atan2(normal.y(), normal.x());
    };
    Eigen::Matrix<double, 9, 1> x;
    x << mean, 0, 0, guess.white_first ? spread : -spread, 0, 0,
        normal_angle(current.along_x, current.along_y),
        normal_angle(current.along_y, current.along_x), 1.0;
    const auto fit = FitSamples<9>(samples, x, SaddleBrightness);
    if (!fit) return {};
    const double contrast = guess.white_first ? fit->x[3] : -fit->x[3];
    const bool turned = std::abs(fit->x[6] - x[6]) > 0.3 || std::abs(fit->x[7] - x[7]) > 0.3;
    point.pixel = current.pixel + fit->x.segment<2>(4);
    point.sigma_px = std::sqrt(0.5 * (fit->covariance(4, 4) + fit->covariance(5, 5)));
    if (contrast < kMinContrast || turned || fit->x[8] < 0.2 || fit->x[8] > radius_px ||
        fit->residual_rms > 0.2 * contrast || (point.pixel - guess.pixel).norm() > 3) {
      return {};
    }
    current.pixel = point.pixel;
  }
  return point;
}

std::optional<std::array<FittedPoint, 4>> FitSquare(const ImageU8& image,
                                                    const std::array<Eigen::Vector2d, 4>& corners,
                                                    double strip_px) {
  std::array<EdgeLine, 4> lines;  // edge i runs from corner i to corner i + 1
  for (std::size_t i = 0; i < 4; ++i) {
    const auto line = FitEdge(image, corners[i], corners[(i + 1) % 4], strip_px);
    if (!line) return {};
    lines[i] = *line;
  }
  std::array<FittedPoint, 4> fitted;
  for (std::size_t i = 0; i < 4; ++i) {
    const EdgeLine& before = lines[(i + 3) % 4];
    const EdgeLine& after = lines[i];
    Eigen::Matrix2d directions;
    directions << before.direction, -after.direction;
    const double sine = std::abs(directions.determinant());
    if (sine < 0.15) return {};
    const Eigen::Vector2d t = directions.inverse() * (after.point - before.point);
    fitted[i].pixel = before.point + t.x() * before.direction;
    fitted[i].sigma_px =
        std::sqrt(0.5 * (before.sigma_px * before.sigma_px + after.sigma_px * after.sigma_px)) /
        sine;
    if (!((fitted[i].pixel - corners[i]).norm() < 2 * strip_px)) return {};
  }
  return fitted;
}

}  // namespace sole::calib
