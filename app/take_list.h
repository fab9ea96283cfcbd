#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "io/take.h"

namespace sole::app {

/// Several takes of one rig, one after the other, as one source of frame sets.
class TakeList : public FrameSource {
 public:
  /// Throws Error if a take cannot be opened or was recorded with another rig than the first.
  explicit TakeList(const std::vector<std::filesystem::path>& directories);

  const RigConfig& Config() const { return takes_.front()->Config(); }
  std::optional<FrameSet> Next() override;

 private:
  std::vector<std::unique_ptr<io::TakeReader>> takes_;
  std::size_t current_ = 0;
};

}  // namespace sole::app
