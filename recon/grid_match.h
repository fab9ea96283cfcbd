#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "recon/match_starts.h"
#include "recon/rectify.h"
#include "recon/subset.h"

namespace sole::recon {

struct GridOptions {
  int step_px = 4;          ///< between points of the left raw image
  int plane_radius_px = 4;  ///< neighbourhood of the start values, rectified pixels
  int max_rounds = 40;      ///< of growing into points without start value
  double agreement_px =
      0.25;              ///< between a neighbour's match and what the own affine warp says of it
  int min_agreeing = 3;  ///< of eight neighbours
  int curvature_reach =
      2;  ///< nodes on each side from which the warp's curvature is taken; 0: affine only
  int wide_radius_px = 10;  ///< of windows where smaller ones fail; up to subset.radius_px: none are
};

/// The curvature that a warp takes from its neighbours is noisy too: on speckle with noise of 1 to 5
/// grey levels it adds as much variance to the match.
inline constexpr double kCurvatureVarianceFactor = 2;

/// Wider windows stand where the surface moved or bends: the warp errs there, not the noise alone.
inline constexpr double kWideVarianceFactor = 2;
/// The less certain a match, the further least squares is from the truth (smeared dots, edges of
/// depth in the window): at this standard deviation the variance is twice what it says.
inline constexpr double kDoubtfulSigma_px = 0.055;

struct GridMatches {
  int tried = 0;                    ///< lit grid points
  std::vector<PixelMatch> matches;  ///< row by row
  double first_share = 0;           ///< of the lit points that are matched first: those with a match
  bool cold = true;                 ///< false: seeds held, no other starts were asked for
};

/// Every so many grid points of a row or column are matched first.
inline constexpr int kFirstLevel = 2;

/// Matches a grid of left pixels inside `mask`. First every second point of every second row with an
/// affine warp: where `start` knows something, then growing from matched points into their unmatched
/// neighbours. Then all points, each from the warp of the first ones around it with the curvature
/// that their slopes imply (an affine warp alone is biased towards the camera on curved surfaces),
/// and by growing again, at last with wider windows. Drops matches that their neighbours contradict
/// by more than they are uncertain. The result does not depend on the number of threads.
GridMatches MatchOnGrid(const PreparedImage& left, const PreparedImage& right, const ImageU8& mask,
                        const StartFunction& start, const GridOptions& grid = {},
                        const SubsetOptions& subset = {});

/// The same for a sequence: begins at `seeds`, say of the frame before. Where these hold, at least
/// `min_share` of the points that are matched first have a match (counted after growing); else
/// `cold` gives starts for the others.
GridMatches MatchOnGrid(const PreparedImage& left, const PreparedImage& right, const ImageU8& mask,
                        const StartFunction& seeds, double min_share,
                        const std::function<StartFunction()>& cold, const GridOptions& grid = {},
                        const SubsetOptions& subset = {});

/// The same for a raw pair that begins at the disparity of its rectified images.
GridMatches MatchOnGrid(const PreparedImage& left, const PreparedImage& right, const ImageU8& mask,
                        const Rectification& rectification, const ImageF& disparity,
                        const GridOptions& grid = {}, const SubsetOptions& subset = {});

}  // namespace sole::recon
