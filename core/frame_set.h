#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/image.h"

namespace sole {

/// What lit the scene during an exposure.
enum class ExposureKind { kSpeckle, kTexture };

const char* ToString(ExposureKind kind);
/// Throws Error for an unknown name.
ExposureKind ExposureKindFromString(const std::string& name);

/// The images of one trigger, in the rig's camera order; absent where a camera delivered none.
struct FrameSet {
  std::int64_t trigger = 0;  ///< counts from 1
  double time_s = 0;         ///< host clock, relative to the first trigger
  ExposureKind kind = ExposureKind::kSpeckle;
  std::vector<std::optional<ImageU8>> images;
};

/// A source of frame sets: cameras, the simulated rig or a recorded take. The one virtual interface that
/// crosses stages.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// The next trigger's images; empty when there are no more.
  virtual std::optional<FrameSet> Next() = 0;
};

}  // namespace sole
