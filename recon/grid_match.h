#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

#include "recon/rectify.h"
#include "recon/subset.h"

namespace sole::recon {

struct GridOptions {
  int step_px = 4;          ///< between points of the left raw image
  int plane_radius_px = 4;  ///< neighbourhood of the start values, rectified pixels
  int max_rounds = 40;      ///< of growing into points without start value
  double agreement_px =
      0.5;               ///< between a neighbour's match and what the own affine warp says of it
  int min_agreeing = 3;  ///< of eight neighbours
  int curvature_reach =
      2;  ///< nodes on each side from which the warp's curvature is taken; 0: affine only
};

/// The curvature that a warp takes from its neighbours is noisy too: on speckle with noise of 1 to 5
/// grey levels it adds about as much variance to the match.
inline constexpr double kCurvatureVarianceFactor = 1.7;

/// Sub-pixel match of one left pixel.
struct PixelMatch {
  Eigen::Vector2i left_px;
  SubsetMatch match;
};

struct GridMatches {
  int tried = 0;                    ///< lit grid points
  std::vector<PixelMatch> matches;  ///< row by row
};

/// Start of a left pixel's match; empty where nothing is known. Called from several threads.
using StartFunction = std::function<std::optional<SubsetWarp>(const Eigen::Vector2i& left_px)>;

/// Starts from the disparity (rectified pixels, NaN where unknown) and its slope within `radius_px`.
/// Both arguments must outlive the function.
StartFunction StartsFromDisparity(const Rectification& rectification, const ImageF& disparity,
                                  int radius_px);
/// The same for a pair that is rectified already: right x = left x - disparity, same row.
StartFunction StartsFromDisparity(const ImageF& disparity, int radius_px);

/// Matches a grid of left pixels inside `mask`: begins where `start` knows something, grows from
/// matched points into their unmatched neighbours, repeats each match with the curvature of the warp
/// that its neighbours' slopes imply (an affine warp alone is biased towards the camera on curved
/// surfaces), and drops matches that their neighbours contradict. The result does not depend on the
/// number of threads.
GridMatches MatchOnGrid(const PreparedImage& left, const PreparedImage& right, const ImageU8& mask,
                        const StartFunction& start, const GridOptions& grid = {},
                        const SubsetOptions& subset = {});

/// The same for a raw pair that begins at the disparity of its rectified images.
GridMatches MatchOnGrid(const PreparedImage& left, const PreparedImage& right, const ImageU8& mask,
                        const Rectification& rectification, const ImageF& disparity,
                        const GridOptions& grid = {}, const SubsetOptions& subset = {});

}  // namespace sole::recon
