#pragma once

#include <span>
#include <vector>

#include "core/point_cloud.h"
#include "recon/triangulate.h"

namespace sole::recon {

struct FuseOptions {
  double voxel_m = 0.001;                ///< points of one voxel are merged
  double min_offset_m = 0.000015;        ///< a pair's offset below this is left
  double max_offset_m = 0.0003;          ///< a pair further off is not moved, only reported
  double min_offset_cosine = 0.6;        ///< incidence at places where pairs are compared
  double max_disagreement_m = 0.0004;    ///< pairs that differ more in a voxel are not averaged
  int neighbours = 20;                   ///< for normals and outliers
  double outlier_deviations = 3.5;       ///< of the mean neighbour distance
  double max_plane_residual_m = 0.0006;  ///< of a point from the plane of its neighbours
  double connect_m = 0.003;              ///< points nearer than this belong together
  int min_component = 300;               ///< merged points of a separate piece of foot
  double min_foot_height_m = 0.004;      ///< a piece that stays below is platform, not foot
  double platform_height_m = 0.001;      ///< platform points lie within this of z = 0
};

/// A foot with its shin, or what is seen of it: parts of the cloud that are connected or stand over
/// each other.
struct CloudPiece {
  int points = 0;
  Eigen::Vector3d min_m = Eigen::Vector3d::Zero(), max_m = Eigen::Vector3d::Zero();
};

struct FusedClouds {
  PointCloud cloud;              ///< feet
  std::vector<std::uint8_t> piece;  ///< of every point of the cloud; at most 255 are told apart
  std::vector<CloudPiece> pieces;   ///< largest first
  PointCloud platform;           ///< marks and dust on the glass top
  std::vector<int> foot_points;  ///< merged points of the cloud by source pair
  int outliers = 0;              ///< merged points removed
  std::vector<double> offset_m;  ///< per pair, taken away: see SolvePairOffsets
};

/// One cloud from the points of all pairs: variance-weighted mean in small voxels (points of one
/// pair share their window's noise, so only different pairs reduce sigma), removal of statistical
/// outliers and of small separate pieces, normals towards the cameras. Pairs whose points lie nearer
/// to the cameras than those of other pairs are moved back along their rays first (offset_m). Pieces that lie flat on the
/// glass top go to `platform`.
FusedClouds Fuse(std::span<const PairPoint> points, int pairs, const FuseOptions& options = {});

}  // namespace sole::recon
