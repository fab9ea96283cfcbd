#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <Eigen/Core>

#include "core/image.h"
#include "core/rig_config.h"
#include "sim/renderer.h"

namespace sole::sim {

/// What each pixel's central ray meets in the middle of the exposure: mesh (index in the scene, -1
/// where it meets none) and triangle, barycentric coordinates in it, world position and outward
/// normal (metres; NaN without a mesh), depth along the camera's axis (the refracted light's end
/// point; NaN). Marks and dust on the glass are not considered.
struct TruthMaps {
  Image<std::int32_t> mesh;
  Image<std::int32_t> triangle;
  Image<Eigen::Vector3f> barycentric;
  Image<Eigen::Vector3f> point_m;
  Image<Eigen::Vector3f> normal;
  ImageF depth_m;
  Image<std::uint8_t> projectors;  ///< how many light the point; of a speckle exposure only
  Image<std::uint8_t> partners;    ///< of how many `partners` the point is seen, see MapTruth
};

/// `partners`: other cameras, such as the other one of a stereo pair; a point counts as seen by one
/// if nothing hides it and the incidence is below 70 degrees, as VisibleToPairs has it. Throws
/// Error for unknown cameras.
TruthMaps MapTruth(const Renderer& renderer, const PreparedScene& scene, int camera,
                   const std::vector<int>& partners = {});

/// The other cameras of the pairs that `camera` (rig order) belongs to.
std::vector<int> PartnersOf(const RigConfig& config, int camera);

/// Writes the maps as npz (docs/formats.md, truth/maps), atomically, making the directory.
void WriteTruthMaps(const std::filesystem::path& path, const TruthMaps& maps);

}  // namespace sole::sim
