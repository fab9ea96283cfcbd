#include "core/frame_set.h"

#include "core/error.h"

namespace sole {

const char* ToString(ExposureKind kind) { return kind == ExposureKind::kSpeckle ? "speckle" : "texture"; }

ExposureKind ExposureKindFromString(const std::string& name) {
  if (name == "speckle") return ExposureKind::kSpeckle;
  if (name == "texture") return ExposureKind::kTexture;
  throw Error("unknown exposure kind '" + name + "': use speckle or texture");
}

}  // namespace sole
