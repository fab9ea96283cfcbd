#include "app/take_extract.h"

#include <algorithm>
#include <mutex>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "app/console.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/image_file.h"
#include "io/take.h"

namespace sole::app {
namespace {

/// Places of the wanted cameras in the rig's order.
std::vector<std::size_t> WantedCameras(const io::TakeReader& take, const ExtractOptions& options,
                                       const std::filesystem::path& directory) {
  const std::vector<CameraConfig>& cameras = take.Config().cameras;
  std::vector<std::size_t> wanted;
  std::vector<std::string> serials;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    serials.push_back(cameras[c].serial);
    if (options.cameras.empty() || std::ranges::count(options.cameras, serials.back()) > 0) wanted.push_back(c);
  }
  for (const std::string& serial : options.cameras) {
    Require(std::ranges::count(serials, serial) > 0,
            fmt::format("{} has no camera '{}': its cameras are {}", directory.string(), serial, fmt::join(serials, ", ")));
  }
  return wanted;
}

}  // namespace

ExtractResult ExtractTake(const std::filesystem::path& directory, const ExtractOptions& options) {
  Require(options.format == "png" || options.format == "tiff",
          "images are extracted to png or tiff, not to '" + options.format + "'");
  const io::TakeReader take(directory, Log);
  const std::vector<std::size_t> cameras = WantedCameras(take, options, directory);
  std::vector<std::size_t> triggers;
  for (std::size_t t = 0; t < take.Triggers().size(); ++t) {
    const std::int64_t number = take.Triggers()[t].trigger;
    if (number >= options.first && number <= options.last) triggers.push_back(t);
  }
  Require(!triggers.empty(), fmt::format("{} has no trigger in that range: it has {}", directory.string(), take.Triggers().size()));
  for (const std::size_t c : cameras) io::MakeDirectory(options.out / take.Config().cameras[c].serial);
  ExtractResult result;
  std::mutex mutex;
  std::int64_t done = 0;
  tbb::parallel_for(std::size_t{0}, triggers.size(), [&](std::size_t i) {
    Require(options.stop == nullptr || !options.stop->load(), "stopped: the images that are there are whole");
    const FrameSet set = take.Read(triggers[i]);
    std::int64_t images = 0;
    for (const std::size_t c : cameras) {
      if (!set.images[c]) continue;
      io::WriteImage(options.out / take.Config().cameras[c].serial / fmt::format("{:06}.{}", set.trigger, options.format),
                     *set.images[c]);
      ++images;
    }
    const std::lock_guard lock(mutex);
    result.images += images;
    result.absent += static_cast<std::int64_t>(cameras.size()) - images;
    if (options.progress) options.progress(++done, static_cast<std::int64_t>(triggers.size()));
  });
  return result;
}

}  // namespace sole::app
