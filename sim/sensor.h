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
/// `level`. Analogue gain makes fewer electrons of a level, and amplifies the read noise.
double NoiseSigma(double level, double analogue_gain = 1);

/// Standard deviation of a camera's blur (px) at a distance along its axis: the lens' own and the
/// circle of confusion of what is out of focus.
double BlurAt(const TrueCamera& camera, double depth_m);

/// What the camera delivers for an image of `radiance` (1 = grey level 255 for a camera of gain 1):
/// fog, Gaussian blur, vignetting, gain, photon and read noise scaled by `noise`, rounding to 8
/// bits, hot pixels. `depth_m`: distance along the axis of what each block of `block` x `block`
/// pixels shows, 0 where there is nothing; without it everything is in focus. Deterministic for a
/// seed, whatever the number of threads.
ImageU8 Expose(const TrueCamera& camera, const ImageF& radiance, double noise, std::uint64_t seed,
               const ImageF& depth_m = {}, int block = 8);

}  // namespace sole::sim
