#pragma once

#include <Eigen/Core>
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

/// Sub-pixel match of one left pixel.
struct PixelMatch {
  Eigen::Vector2i left_px;
  SubsetMatch match;
};

struct GridMatches {
  int tried = 0;                    ///< lit grid points
  std::vector<PixelMatch> matches;  ///< row by row
};

/// Matches a grid of left raw pixels inside `mask`: starts from the disparity (rectified pixels,
/// NaN where unknown) and its local slope, grows from matched points into their unmatched
/// neighbours, repeats each match with the curvature of the warp that its neighbours' slopes imply
/// (an affine warp alone is biased towards the camera on curved surfaces), and drops matches that
/// their neighbours contradict. The result does not depend on the number of threads.
GridMatches MatchOnGrid(const PreparedImage& left, const PreparedImage& right, const ImageU8& mask,
                        const Rectification& rectification, const ImageF& disparity,
                        const GridOptions& grid = {}, const SubsetOptions& subset = {});

}  // namespace sole::recon
