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
  const auto left = Prepare(PaintSpeckle(kSize, noise, 1, same));
  const auto right =
      Prepare(PaintSpeckle(kSize, noise, 2,
                           [&](const Vector2d& p) { return Vector2d(inverse * (p - shift)); }));
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
  const auto flat = Prepare(ImageU8(80, 80, 100));
  const SubsetMatch match =
      MatchSubset(flat, flat, nullptr, {40, 40}, {{40, 40}, Matrix2d::Identity()});
  EXPECT_EQ(match.status, SubsetStatus::kFlat);
}

TEST(MatchSubset, EdgeWithoutSecondDirectionIsRefused) {
  ImageU8 edge(80, 80, 30);
  for (int y = 0; y < 80; ++y) {
    for (int x = 40; x < 80; ++x) edge.At(x, y) = 200;
  }
  const auto prepared = Prepare(edge);
  const SubsetMatch match =
      MatchSubset(prepared, prepared, nullptr, {40, 40}, {{40, 40}, Matrix2d::Identity()});
  EXPECT_NE(match.status, SubsetStatus::kMatched);
}

TEST(MatchSubset, WindowOutsideTheImageIsRefused) {
  const auto image = Prepare(PaintSpeckle(80, 0, 1, [](const Vector2d& p) { return p; }));
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
  const auto left = Prepare(PaintSpeckle(120, 1, 1, [](const Vector2d& p) { return p; }));
  const auto right = Prepare(
      PaintSpeckle(120, 1, 2, [](const Vector2d& p) { return Vector2d(p.x() + 5000, p.y()); }));
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
  const auto left = Prepare(foreground(0)), right = Prepare(foreground(6));
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

TEST(Prepare, SplineInterpolates) {
  const ImageU8 image = PaintSpeckle(64, 3, 5, [](const Vector2d& p) { return p; });
  const PreparedImage prepared = Prepare(image);
  for (int y = 3; y < 60; y += 3) {
    for (int x = 3; x < 60; x += 3)
      EXPECT_NEAR(GreyAt(prepared, Vector2d(x, y)), image.At(x, y), 1e-3);
  }
  EXPECT_THROW(Prepare(ImageU8(8, 8)), Error);
}

TEST(Prepare, MaskLimitsTheWorkAndChangesNothingNearIt) {
  const ImageU8 image = PaintSpeckle(300, 3, 5, [](const Vector2d& p) { return p; });
  ImageU8 mask(300, 300);
  mask.At(150, 130) = mask.At(170, 160) = mask.At(3, 290) = 255;
  const PreparedImage whole = Prepare(image), part = Prepare(image, &mask);
  const auto near = [&](int x, int y) {
    return GreyAt(part, Vector2d(x + 0.4, y + 0.3)) - GreyAt(whole, Vector2d(x + 0.4, y + 0.3));
  };
  for (const auto& [cx, cy] : {std::pair(150, 130), {170, 160}}) {
    for (int y = cy - 24; y <= cy + 24; ++y) {
      for (int x = cx - 24; x <= cx + 24; ++x) ASSERT_NEAR(near(x, y), 0, 2e-2) << x << " " << y;
    }
  }
  for (int y = 140; y < 150; ++y) EXPECT_NEAR(near(155, y), 0, 1e-4);
  for (int x = 2; x < 27; ++x) EXPECT_NEAR(near(x, 280), 0, 2e-2);
  EXPECT_EQ(GreyAt(part, {250.5, 40.5}), 0);
  EXPECT_THROW(Prepare(image, &(mask = ImageU8(40, 40))), Error);
}

TEST(FillWindow, HoldsGreyLevelsAndDerivativesOfTheSpline) {
  const ImageU8 image = PaintSpeckle(64, 3, 5, [](const Vector2d& p) { return p; });
  const PreparedImage prepared = Prepare(image);
  ImageU8 mask(64, 64, 255);
  mask.At(33, 25) = 0;
  SubsetWindow window;
  FillWindow(prepared.coefficients, &mask, 30, 28, 5, window);
  EXPECT_EQ(window.count, 120);
  double mean = 0, sum = 0;
  for (int dy = -5; dy <= 5; ++dy) {
    for (int dx = -5; dx <= 5; ++dx) mean += mask.At(30 + dx, 28 + dy) ? image.At(30 + dx, 28 + dy) / 120.0 : 0;
  }
  for (int j = 0; j < 11; ++j) {
    for (int i = 0; i < window.stride; ++i) {
      const auto k = static_cast<std::size_t>(j * window.stride + i);
      const Vector2d at(25 + i, 23 + j);
      if (i >= 11 || (at.x() == 33 && at.y() == 25)) {
        EXPECT_EQ(window.weight[k], 0);
        EXPECT_EQ(window.grey[k], 0);
        EXPECT_EQ(window.gradient_x[k], 0);
        EXPECT_EQ(window.gradient_y[k], 0);
        continue;
      }
      EXPECT_EQ(window.weight[k], 1);
      EXPECT_NEAR(static_cast<double>(window.grey[k]), GreyAt(prepared, at) - mean, 1e-2);
      Eigen::MatrixXd jacobian(1, 2);
      jacobian << static_cast<double>(window.gradient_x[k]),
          static_cast<double>(window.gradient_y[k]);
      testing_support::ExpectJacobianNear(
          [&](const Eigen::VectorXd& p) {
            return Eigen::VectorXd::Constant(1, GreyAt(prepared, p.head<2>()));
          },
          at, jacobian, 2e-3, 1.0 / 64);
      sum += std::pow(static_cast<double>(window.grey[k]), 2);
    }
  }
  EXPECT_NEAR(static_cast<double>(window.norm), std::sqrt(sum), 1e-3);
}

TEST(FillWindow, ReadsNothingBeyondTheImage) {
  // The last window that is let in, in an image whose pixels end with it (the address sanitizer sees
  // what lies beyond).
  const PreparedImage prepared =
      Prepare(PaintSpeckle(40, 3, 5, [](const Vector2d& p) { return p; }));
  ImageU8 mask(40, 40, 255);
  SubsetWindow window;
  int in = 0;
  for (int r = 2; r <= kMaxRadius; ++r) {
    for (int at = 30; at < 40; ++at) {
      if (!WindowInside(prepared.coefficients, at, at, r)) continue;
      ++in;
      FillWindow(prepared.coefficients, &mask, at, at, r, window);
      EXPECT_EQ(window.count, (2 * r + 1) * (2 * r + 1));
    }
  }
  EXPECT_GT(in, 20);
  EXPECT_FALSE(WindowInside(prepared.coefficients, 20, 36, 2));
  EXPECT_TRUE(WindowInside(prepared.coefficients, 20, 35, 2));
  EXPECT_FALSE(WindowInside(prepared.coefficients, 2, 20, 2));
}

TEST(NormalMatrix, EqualsBruteForce) {
  std::mt19937_64 engine(7);
  std::uniform_real_distribution<float> uniform(-20, 20);
  ImageF coefficients(40, 40);
  for (float& c : coefficients.pixels) c = uniform(engine);
  SubsetWindow window;
  FillWindow(coefficients, nullptr, 20, 19, 7, window);
  Eigen::Matrix<double, 6, 6> expected = Eigen::Matrix<double, 6, 6>::Zero();
  for (int dy = -7; dy <= 7; ++dy) {
    for (int dx = -7; dx <= 7; ++dx) {
      const auto k = static_cast<std::size_t>((dy + 7) * window.stride + dx + 7);
      const auto u = static_cast<double>(window.gradient_x[k]),
                 v = static_cast<double>(window.gradient_y[k]);
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
