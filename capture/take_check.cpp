#include <algorithm>

#include "capture/image_check.h"
#include "capture/take_folder_internal.h"
#include "core/error.h"
#include "io/take.h"

namespace sole::capture {
namespace {

constexpr std::size_t kSets = 4;  // enough for medians, and read within a second or two

/// Some frame sets spread over the take, first and last included; all kinds of light.
std::vector<FrameSet> SomeSets(const io::TakeReader& take) {
  std::vector<FrameSet> sets;
  std::size_t last = take.Triggers().size();
  const std::size_t count = std::min(kSets, take.Triggers().size());
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t index = count == 1 ? 0 : i * (take.Triggers().size() - 1) / (count - 1);
    if (index == last) continue;
    last = index;
    sets.push_back(take.Read(index));
  }
  const bool speckle = std::any_of(sets.begin(), sets.end(), [](const FrameSet& set) {
    return set.kind == ExposureKind::kSpeckle;
  });
  // An even cycle may have hidden every speckle exposure from the even steps.
  for (std::size_t i = 0; !speckle && i < take.Triggers().size(); ++i) {
    if (take.Triggers()[i].kind != ExposureKind::kSpeckle) continue;
    sets.push_back(take.Read(i));
    break;
  }
  return sets;
}

/// The first complete speckle set.
std::optional<FrameSet> ReferenceSet(const std::filesystem::path& directory,
                                     const RigConfig& config) {
  const io::TakeReader take(directory);
  Require(take.Info().rig_hash == RigIdentityHash(config),
          "reference take " + directory.string() +
              " was recorded with another rig: choose an earlier take of this one");
  for (std::size_t i = 0; i < take.Triggers().size(); ++i) {
    if (take.Triggers()[i].kind == ExposureKind::kSpeckle) return take.Read(i);
  }
  throw Error("reference take " + directory.string() + " has no exposure with speckle light");
}

}  // namespace

void RequireReference(const std::filesystem::path& directory, const RigConfig& config) {
  ReferenceSet(directory, config);
}

std::vector<TakeFinding> CheckTakeImages(const std::filesystem::path& directory,
                                         const RigConfig& config,
                                         const std::filesystem::path& reference) {
  const io::TakeReader take(directory);
  if (take.Triggers().empty()) return {};
  std::optional<FrameSet> earlier;
  if (!reference.empty()) earlier = ReferenceSet(reference, config);
  return CheckImages(config, SomeSets(take), earlier ? &*earlier : nullptr).findings;
}

}  // namespace sole::capture
