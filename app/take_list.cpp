#include "app/take_list.h"

#include "app/console.h"
#include "core/error.h"

namespace sole::app {

TakeList::TakeList(const std::vector<std::filesystem::path>& directories) {
  Require(!directories.empty(), "no take was given");
  for (const std::filesystem::path& directory : directories) {
    takes_.push_back(std::make_unique<io::TakeReader>(directory, Log));
    Require(RigIdentityHash(takes_.back()->Config()) == RigIdentityHash(Config()),
            directory.string() + " was recorded with another rig than " + directories.front().string() +
                ": calibrate them apart");
  }
}

std::optional<FrameSet> TakeList::Next() {
  for (; current_ < takes_.size(); ++current_) {
    if (std::optional<FrameSet> frame = takes_[current_]->Next()) return frame;
  }
  return {};
}

}  // namespace sole::app
