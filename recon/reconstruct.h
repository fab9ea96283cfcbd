#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/frame_set.h"
#include "core/point_cloud.h"
#include "core/rig.h"
#include "recon/fuse.h"
#include "recon/grid_match.h"
#include "recon/match.h"
#include "recon/rectify.h"
#include "recon/subset.h"
#include "recon/triangulate.h"

namespace sole::recon {

struct ReconstructOptions {
  CaptureVolume volume = {};  ///< takes the place of the volumes in rectify and triangulate
  /// How far surfaces that begin in the volume are followed along the walking direction, and upwards
  /// through the glass: a foot that comes down still has its heel behind.
  double follow_m = 0.04;
  RectifyOptions rectify = {};
  ForegroundOptions foreground = {};
  MatchOptions match = {};
  GridOptions grid = {};
  SubsetOptions subset = {};
  TriangulateOptions triangulate = {};
  FuseOptions fuse = {};
  /// Between matched points on the surface; sets grid.step_px of each pair, so that cameras of low
  /// resolution give as many points. 0: 1 mm, or 0.75 mm for a rig of up to four pairs, where no
  /// other pair fills in what one leaves out.
  double spacing_m = 0;
  double seeds_hold = 0.95;  ///< of the share that the last frame without seeds had
  double warn_offset_m = 0.0001;  ///< of a pair from the others: its calibration has drifted
  int min_matches = 200;  ///< a pair with fewer sees no foot
};

/// What became of one stereo pair in one frame.
struct PairStats {
  std::string name;
  int tried = 0;     ///< lit points of the left image's grid
  int matched = 0;   ///< sub-pixel matches that passed every gate in the images
  int kept = 0;      ///< triangulated points that passed every gate in space
  int in_cloud = 0;  ///< merged points of the foot that come mainly from this pair
  double mean_zncc = 0;
  double median_gap_px = 0;  ///< signed distance between the rays; a hint of a drifted calibration
  double seconds = 0;  ///< from beginning to end; other pairs are matched beside it
  double offset_m = 0;  ///< of its points from the other pairs', towards the cameras; taken away
  bool seeded = false;  ///< began at the seeds: semi-global matching was not needed
  std::string skipped;  ///< why the pair gave nothing; empty if it did
};

/// Where matching may begin, per pair of the rig: matches of the frame before or what a predicted
/// surface says.
struct FrameSeeds {
  struct Pair {
    std::vector<PixelMatch> matches;
    double share = 0;  ///< of the first points that must get a match for the seeds to hold, about
  };
  std::vector<Pair> pairs;
};

struct FrameReconstruction {
  PointCloud cloud;              ///< the foot, world frame; empty where there is none
  std::vector<std::uint8_t> piece;  ///< of every point: which of `pieces` it belongs to
  std::vector<CloudPiece> pieces;   ///< feet, largest first
  PointCloud platform;           ///< marks and dust on the glass top
  std::vector<PairStats> pairs;  ///< rig order
  std::vector<std::string> warnings;  ///< one line each, such as of a pair that contradicts others
  FrameSeeds seeds;              ///< for the next frame of the sequence
  double seconds = 0;
};

/// Turns frames of one rig into point clouds. Keeps the rectification maps; Reconstruct may be
/// called from several threads.
class Reconstructor {
 public:
  /// Throws Error if the rig has no pairs or a pair cannot be rectified.
  explicit Reconstructor(const Rig& rig, const ReconstructOptions& options = {});
  ~Reconstructor();
  Reconstructor(Reconstructor&&) noexcept;
  Reconstructor& operator=(Reconstructor&&) noexcept;

  /// Missing, dark, saturated or foot-less images give a reason in `pairs`, never an exception.
  /// Throws Error if an image's size or the number of images contradicts the rig.
  /// `seeds`, if given, shorten the search where they hold and change nothing else.
  FrameReconstruction Reconstruct(const FrameSet& frame, const FrameSeeds* seeds = nullptr) const;

  /// Seeds from a surface expected near the foot's, such as the fitted model's: points with normals,
  /// not more than a few millimetres apart. Throws Error if it has no normals.
  FrameSeeds SeedsFrom(const PointCloud& surface) const;

 private:
  struct State;
  std::unique_ptr<const State> state_;
};

}  // namespace sole::recon
