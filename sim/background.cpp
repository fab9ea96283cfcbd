#include "sim/renderer_internal.h"

namespace sole::sim {

std::size_t Backgrounds::Index(const Kind& kind) {
  return (kind.exposure == ExposureKind::kTexture ? 1U : 0U) + (kind.fiducials ? 2U : 0U) +
         (kind.dust ? 4U : 0U);
}

// Both work without the lock, which others that run in the same pool may wait for; if two threads
// do the same work at once, both come to the same result.

std::shared_ptr<const PreparedScene> Backgrounds::Empty(const Renderer& renderer,
                                                        const Kind& kind) {
  std::shared_ptr<const PreparedScene>& kept = empty_[Index(kind)];
  {
    const std::lock_guard lock(mutex_);
    if (kept) return kept;
  }
  Scene scene;
  scene.exposure = kind.exposure;
  scene.fiducials = kind.fiducials;
  scene.dust = kind.dust;
  auto made = std::make_shared<const PreparedScene>(renderer.Prepare(scene));
  const std::lock_guard lock(mutex_);
  if (!kept) kept = std::move(made);
  return kept;
}

std::shared_ptr<const ImageF> Backgrounds::Of(const Renderer& renderer, const Kind& kind,
                                              int camera) {
  const TrueRig& rig = renderer.Rig();
  const auto index = static_cast<std::size_t>(camera);
  {
    const std::lock_guard lock(mutex_);
    images_[Index(kind)].resize(rig.cameras.size());
    if (images_[Index(kind)][index]) return images_[Index(kind)][index];
  }
  const std::shared_ptr<const PreparedScene> empty = Empty(renderer, kind);
  const TrueCamera& view = rig.cameras[index];
  auto image = std::make_shared<ImageF>(view.width, view.height);
  TraceBlocks(renderer.Get(), empty->Get(),
              ViewScene(renderer.Get(), empty->Get(), view, empty->Get().glass), view, {},
              kAllBlocks, *image);
  const std::lock_guard lock(mutex_);
  std::shared_ptr<const ImageF>& kept = images_[Index(kind)][index];
  if (!kept) kept = std::move(image);
  return kept;
}

}  // namespace sole::sim
