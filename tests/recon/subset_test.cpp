#include "recon/subset.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <random>

#include "core/error.h"
#include "recon/subset_kernel_internal.h"
#include "tests/recon/speckle_scene.h"
#include "tests/support/jacobian_checker.h"

namespace sole::recon {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

/// Speckle of about 4 px in the image plane, averaged over the pixel, with noise.
ImageU8 PaintSpeckle(int size, double noise, unsigned seed,
                     const std::function<Vector2d(const Vector2d&)>& texture_from_pixel) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal(0, 1);
  ImageU8 image(size, size);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      double sum = 0;
      for (int s = 0; s < 9; ++s) {
        const Vector2d q =
            texture_from_pixel(Vector2d(x + (s % 3 - 1) / 3.0, y + (s / 3 - 1) / 3.0));
        sum += testing_support::SolidSpeckle({q.x(), q.y(), 0.3}, 3.5);
      }
      const double grey = 30 + 170 * sum / 9 + noise * normal(engine);
      image.At(x, y) = static_cast<std::uint8_t>(std::clamp(std::lround(grey), 0L, 255L));
    }
  }
  return image;
}

struct Accuracy {
  int matched = 0;
  double rms_px = 0;          ///< per axis
  double normalized_rms = 0;  ///< error over predicted standard deviation
};

/// Matches a grid of points of a pair related by right = shift + gradient * left.
Accuracy MatchKnownWarp(const Vector2d& shift, const Matrix2d& gradient, double noise, int radius) {
  constexpr int kSize = 200;
  const Matrix2d inverse = gradient.inverse();
  const auto same = [](const Vector2d& p) { return p; };
  const auto left = Prepare(PaintSpeckle(kSize, noise, 1, same), true);
  const auto right =
      Prepare(PaintSpeckle(kSize, noise, 2,
                           [&](const Vector2d& p) { return Vector2d(inverse * (p - shift)); }),
              false);
  Accuracy result;
  double squares = 0, normalized = 0;
  for (int y = 40; y <= 160; y += 10) {
    for (int x = 40; x <= 160; x += 10) {
      const Vector2d truth = shift + gradient * Vector2d(x, y);
      SubsetWarp start{truth + Vector2d(0.8, -0.6), Matrix2d::Identity()};
      const SubsetMatch match =
          MatchSubset(left, right, nullptr, {x, y}, start, {.radius_px = radius});
      if (match.status != SubsetStatus::kMatched) continue;
      ++result.matched;
      const Vector2d error = match.warp.position_px - truth;
      squares += error.squaredNorm() / 2;
      normalized += error.dot(match.covariance_px2.inverse() * error) / 2;
    }
  }
  result.rms_px = std::sqrt(squares / result.matched);
  result.normalized_rms = std::sqrt(normalized / result.matched);
  return result;
}

TEST(MatchSubset, SubPixelShiftsWithNoise) {
  for (const double shift : {0.0, 0.25, 0.5, 0.77}) {
    const Accuracy a = MatchKnownWarp({3 + shift, -2 + 0.5 * shift}, Matrix2d::Identity(), 2, 10);
    EXPECT_EQ(a.matched, 169) << shift;
    EXPECT_LT(a.rms_px, 0.02) << shift;
  }
}

TEST(MatchSubset, AffineWarpWithNoise) {
  Matrix2d gradient;
  gradient << 1.06, 0.05, -0.04, 0.96;
  const Accuracy a = MatchKnownWarp({-4.3, 5.6}, gradient, 2, 10);
  EXPECT_GE(a.matched, 165);
  EXPECT_LT(a.rms_px, 0.02);
}

TEST(MatchSubset, CovarianceTellsTheError) {
  const Accuracy a = MatchKnownWarp({2.4, 1.3}, Matrix2d::Identity(), 5, 8);
  EXPECT_GT(a.matched, 150);
  EXPECT_GT(a.normalized_rms, 0.75);
  EXPECT_LT(a.normalized_rms, 1.35);
}

TEST(MatchSubset, FlatWindowIsRefused) {
  const auto flat = Prepare(ImageU8(80, 80, 100), true);
  const SubsetMatch match =
      MatchSubset(flat, flat, nullptr, {40, 40}, {{40, 40}, Matrix2d::Identity()});
  EXPECT_EQ(match.status, SubsetStatus::kFlat);
}

TEST(MatchSubset, EdgeWithoutSecondDirectionIsRefused) {
  ImageU8 edge(80, 80, 30);
  for (int y = 0; y < 80; ++y) {
    for (int x = 40; x < 80; ++x) edge.At(x, y) = 200;
  }
  const auto prepared = Prepare(edge, true);
  const SubsetMatch match =
      MatchSubset(prepared, prepared, nullptr, {40, 40}, {{40, 40}, Matrix2d::Identity()});
  EXPECT_NE(match.status, SubsetStatus::kMatched);
}

TEST(MatchSubset, WindowOutsideTheImageIsRefused) {
  const auto image = Prepare(PaintSpeckle(80, 0, 1, [](const Vector2d& p) { return p; }), true);
  const auto at = [&](int x, int y, double right_x, double right_y) {
    return MatchSubset(image, image, nullptr, {x, y}, {{right_x, right_y}, Matrix2d::Identity()})
        .status;
  };
  EXPECT_EQ(at(5, 40, 5, 40), SubsetStatus::kOutside);
  EXPECT_EQ(at(40, 75, 40, 75), SubsetStatus::kOutside);
  EXPECT_EQ(at(40, 40, 6, 40), SubsetStatus::kOutside);
  EXPECT_EQ(at(40, 40, 40, 74), SubsetStatus::kOutside);
  EXPECT_EQ(at(40, 40, 1e9, std::nan("")), SubsetStatus::kOutside);
}

TEST(MatchSubset, UnrelatedTextureIsRefused) {
  const auto left = Prepare(PaintSpeckle(120, 1, 1, [](const Vector2d& p) { return p; }), true);
  const auto right = Prepare(
      PaintSpeckle(120, 1, 2, [](const Vector2d& p) { return Vector2d(p.x() + 5000, p.y()); }),
      false);
  int matched = 0;
  for (int y = 30; y < 90; y += 6) {
    for (int x = 30; x < 90; x += 6) {
      const SubsetWarp start{Vector2d(x, y), Matrix2d::Identity()};
      matched +=
          MatchSubset(left, right, nullptr, {x, y}, start).status == SubsetStatus::kMatched ? 1 : 0;
    }
  }
  EXPECT_EQ(matched, 0);
}

/// A foreground in front of another background: with the mask the background does not pull the
/// match.
TEST(MatchSubset, MaskKeepsTheBackgroundOut) {
  const int size = 160, edge = 80;
  const auto foreground = [&](double shift) {
    ImageU8 image =
        PaintSpeckle(size, 1, 3, [&](const Vector2d& p) { return Vector2d(p.x() - shift, p.y()); });
    const ImageU8 behind =
        PaintSpeckle(size, 1, 4, [](const Vector2d& p) { return Vector2d(p.x() + 900, p.y()); });
    for (int y = 0; y < size; ++y) {
      for (int x = edge + static_cast<int>(shift); x < size; ++x) image.At(x, y) = behind.At(x, y);
    }
    return image;
  };
  ImageU8 mask(size, size);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < edge; ++x) mask.At(x, y) = 255;
  }
  const auto left = Prepare(foreground(0), true), right = Prepare(foreground(6), false);
  double squares = 0;
  int matched = 0;
  for (int y = 30; y < 130; y += 5) {
    const SubsetWarp start{Vector2d(edge - 3 + 6.5, y + 0.4), Matrix2d::Identity()};
    const SubsetMatch match = MatchSubset(left, right, &mask, {edge - 3, y}, start);
    if (match.status != SubsetStatus::kMatched) continue;
    ++matched;
    squares += (match.warp.position_px - Vector2d(edge - 3 + 6, y)).squaredNorm() / 2;
  }
  EXPECT_GE(matched, 16);
  EXPECT_LT(std::sqrt(squares / matched), 0.03);
}

TEST(Prepare, SplineInterpolatesAndGradientsAreItsDerivatives) {
  const ImageU8 image = PaintSpeckle(64, 3, 5, [](const Vector2d& p) { return p; });
  const PreparedImage prepared = Prepare(image, true);
  for (int y = 3; y < 60; y += 3) {
    for (int x = 3; x < 60; x += 3) {
      EXPECT_NEAR(GreyAt(prepared, Vector2d(x, y)), image.At(x, y), 1e-3);
      Eigen::MatrixXd jacobian(1, 2);
      jacobian << static_cast<double>(prepared.gradient_x.At(x, y)),
          static_cast<double>(prepared.gradient_y.At(x, y));
      testing_support::ExpectJacobianNear(
          [&](const Eigen::VectorXd& p) {
            return Eigen::VectorXd::Constant(1, GreyAt(prepared, p.head<2>()));
          },
          Vector2d(x, y), jacobian, 2e-3, 1.0 / 64);
    }
  }
  EXPECT_THROW(Prepare(ImageU8(8, 8), false), Error);
}

TEST(NormalMatrix, EqualsBruteForce) {
  std::mt19937_64 engine(7);
  std::uniform_real_distribution<float> uniform(-20, 20);
  ImageF grey(40, 40), gx(40, 40), gy(40, 40);
  for (std::size_t i = 0; i < grey.pixels.size(); ++i) {
    grey.pixels[i] = uniform(engine);
    gx.pixels[i] = uniform(engine);
    gy.pixels[i] = uniform(engine);
  }
  SubsetWindow window;
  FillWindow(grey, gx, gy, nullptr, 20, 19, 7, window);
  Eigen::Matrix<double, 6, 6> expected = Eigen::Matrix<double, 6, 6>::Zero();
  for (int dy = -7; dy <= 7; ++dy) {
    for (int dx = -7; dx <= 7; ++dx) {
      const auto u = static_cast<double>(gx.At(20 + dx, 19 + dy)),
                 v = static_cast<double>(gy.At(20 + dx, 19 + dy));
      Eigen::Matrix<double, 6, 1> j;
      j << u, u * dx, u * dy, v, v * dx, v * dy;
      expected += j * j.transpose();
    }
  }
  const auto matrix = NormalMatrix(window);
  const Eigen::Map<const Eigen::Matrix<double, 6, 6>> actual(matrix.data());
  EXPECT_LT((actual - expected).cwiseAbs().maxCoeff(), 1e-5 * expected.cwiseAbs().maxCoeff());
}

}  // namespace
}  // namespace sole::recon
