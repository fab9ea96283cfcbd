#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "core/image.h"

namespace sole::calib {

/// A crossing of two black-white edges: where four squares of a chessboard meet.
struct SaddleGuess {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Vector2d along_x =
      Eigen::Vector2d::UnitX();  ///< image of one board unit along the rows, pixels
  Eigen::Vector2d along_y = Eigen::Vector2d::UnitY();  ///< and along the columns
  double clear = 0.1;       ///< where |x| and |y| both exceed this (board units) other print begins
  bool white_first = true;  ///< the quadrant x, y > 0 is white
};

struct FittedPoint {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double sigma_px = 0;  ///< standard deviation of each coordinate, from the fit's residuals
};

/// Fits brightness = a + g.p + b erf(l1(p) / s) erf(l2(p) / s) to the pixels within `radius_px` of
/// the guess, with the two lines l1, l2 and the blur s free. Point-symmetric, hence unbiased by
/// blur and saturation. Empty where the picture does not look like that, has the opposite sign or
/// moves more than 3 px from the guess.
std::optional<FittedPoint> FitSaddle(const ImageU8& image, const SaddleGuess& guess,
                                     double radius_px);

/// Corners of a square marker (approximate `corners`, in order around it) as intersections of its
/// four outer edges, each fitted to the brightness in a strip along it of half-width `strip_px`.
/// Empty if an edge is not there.
std::optional<std::array<FittedPoint, 4>> FitSquare(const ImageU8& image,
                                                    const std::array<Eigen::Vector2d, 4>& corners,
                                                    double strip_px);

}  // namespace sole::calib
