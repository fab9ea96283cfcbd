#pragma once

#include "calib/observations.h"
#include "core/frame_set.h"
#include "core/image.h"
#include "core/rig_config.h"
#include "core/target.h"

namespace sole::calib {

struct DetectOptions {
  double saddle_radius_px = 8;  ///< largest radius of the neighbourhood a corner is fitted to
  double sigma_floor_px =
      0.012;  ///< of target corners: what a fit cannot see (sampling, print, blur)
  double fiducial_sigma_floor_px =
      0.04;                    ///< of fiducials, whose edges may run along the pixels' grid
  double max_sigma_px = 0.15;  ///< worse fits are left out
  double blur_px = 0;          ///< smooths images first; makes marks legible under projected speckle
  int min_markers = 2;         ///< of a face, to trust it
};

/// What to look for. The marker dictionary is OpenCV's DICT_5X5_250.
struct DetectTarget {
  CalibrationBody body;
  std::vector<Fiducial> fiducials;
};

DetectTarget TargetOf(const RigConfig& config);

/// For marks lit by projected speckle: smoothed, wider strips, and no better than that light allows.
DetectOptions SpeckleDetectOptions();

/// Corners of the target and of the fiducials in one image. `mirrored_fiducials`: the camera looks
/// at the fiducials from below, where they appear mirrored. Markers with foreign ids, at places
/// that contradict their neighbours, and corners that do not look like corners are left out.
ViewObservations DetectInImage(const ImageU8& image, const DetectTarget& target,
                               bool mirrored_fiducials, const DetectOptions& options = {});

/// The same for all images of one trigger, in parallel. Throws Error if an image has not the size
/// of the rig file. A camera whose nominal position is below the plate sees the fiducials mirrored.
std::vector<ViewObservations> DetectInFrame(const FrameSet& frame, const RigConfig& config,
                                            const DetectTarget& target,
                                            const DetectOptions& options = {});

}  // namespace sole::calib
