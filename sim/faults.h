#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/fault.h"
#include "core/image.h"
#include "sim/renderer.h"
#include "sim/true_rig.h"

namespace sole::sim {

/// Whether the fault shows in the images; otherwise it shows on the wire.
bool ShowsInImages(const FaultConfig& fault);

/// The faults of `faults` that show in the images at trigger `trigger`: bumped-camera, fog,
/// hot-pixels, projector-off, lights-on. Two triggers with equal lists look through the same rig.
std::vector<FaultConfig> ImageFaultsAt(const std::vector<FaultConfig>& faults,
                                       std::int64_t trigger);

/// The rig that `faults` (from ImageFaultsAt) make of a healthy one: cameras moved, turned, fogged
/// or with hot pixels. A bumped camera moves by that many millimetres across its line of sight, or
/// turns by that many degrees about an axis across it; which way depends on its serial only.
TrueRig ApplyFaults(const TrueRig& rig, const std::vector<FaultConfig>& faults);
/// The same for the light.
RenderOptions ApplyFaults(RenderOptions options, const std::vector<FaultConfig>& faults);

/// What a fogged lens makes of the radiance: the share `fog` of all light is scattered widely,
/// some of it over the whole image.
ImageF Fogged(const ImageF& radiance, double fog);

/// Sets the share `hot` of the pixels to full level; which ones depends on the serial only.
void AddHotPixels(const std::string& serial, double hot, ImageU8& image);

}  // namespace sole::sim
