#include "recon/texture.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>

#include "core/error.h"
#include "core/plate.h"

namespace sole::recon {
namespace {

/// Bilinear; empty outside.
std::optional<float> GreyBetween(const ImageU8& image, const Eigen::Vector2d& px) {
  if (!(px.x() >= 0 && px.y() >= 0 && px.x() <= image.width - 1 && px.y() <= image.height - 1))
    return {};
  const int x = std::min(static_cast<int>(px.x()), image.width - 2),
            y = std::min(static_cast<int>(px.y()), image.height - 2);
  const double fx = px.x() - x, fy = px.y() - y;
  const double above = (1 - fx) * image.At(x, y) + fx * image.At(x + 1, y),
               below = (1 - fx) * image.At(x, y + 1) + fx * image.At(x + 1, y + 1);
  return static_cast<float>((1 - fy) * above + fy * below);
}

}  // namespace

std::vector<float> TextureIntensity(const PointCloud& cloud, const Rig& rig,
                                    const FrameSet& texture) {
  Require(texture.kind == ExposureKind::kTexture,
          "trigger " + std::to_string(texture.trigger) + " is no texture exposure");
  Require(texture.images.size() == rig.cameras.size(),
          "trigger " + std::to_string(texture.trigger) + " has " +
              std::to_string(texture.images.size()) + " images, the calibration " +
              std::to_string(rig.cameras.size()) + " cameras: calibrate this rig");
  Require(cloud.pair.size() == cloud.Size() && cloud.intensity.size() == cloud.Size(),
          "texture: the cloud does not name its pairs and grey levels");
  std::vector<float> intensity = cloud.intensity;
  tbb::parallel_for(std::size_t{0}, cloud.Size(), [&](std::size_t i) {
    if (cloud.pair[i] >= rig.pairs.size()) return;
    const StereoPair& pair = rig.pairs[cloud.pair[i]];
    for (const int index : {pair.left, pair.right}) {
      const auto camera = static_cast<std::size_t>(index);
      if (!texture.images[camera]) continue;
      const Eigen::Vector2d px =
          PixelFromWorld(rig.cameras[camera], rig.plate, cloud.points_m[i].cast<double>());
      const std::optional<float> grey = GreyBetween(*texture.images[camera], px);
      if (!grey) continue;
      intensity[i] = *grey;
      return;
    }
  });
  return intensity;
}

}  // namespace sole::recon
