#pragma once

#include <cstdint>

#include "core/image.h"
#include "sim/true_rig.h"

namespace sole::sim {

/// Full well of 10,000 electrons at grey level 255, read noise in electrons: an ordinary industrial
/// sensor.
inline constexpr double kElectronsPerLevel = 10000.0 / 255.0;
inline constexpr double kReadNoiseElectrons = 8;
/// Black level of the converter, grey levels.
inline constexpr double kBlackLevel = 3;

/// Standard deviation of the noise (grey levels, at noise scale 1) where the noise-free image has
/// `level`.
double NoiseSigma(double level);

/// What the camera delivers for an image of `radiance` (1 = grey level 255 for a camera of gain 1):
/// fog, Gaussian blur, vignetting, gain, photon and read noise scaled by `noise`, rounding to 8 bits, hot
/// pixels.
/// Deterministic for a seed, whatever the number of threads.
ImageU8 Expose(const TrueCamera& camera, const ImageF& radiance, double noise, std::uint64_t seed);

}  // namespace sole::sim
