#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace sole::io {

struct RecoverOptions {
  double usable_loss = 0.02;  ///< largest share of a camera's frames that a usable take may lack
  std::function<void(std::int64_t done, std::int64_t total)> progress{};  ///< records checked
  const std::atomic<bool>* stop = nullptr;  ///< ends with an Error; what was done stays valid
};

/// What became of one camera's file.
struct CameraRecovery {
  std::string serial;
  std::int64_t kept = 0;        ///< records whose checksums hold
  std::int64_t incomplete = 0;  ///< of those: status 1
  std::int64_t dropped = 0;     ///< records with a sound header whose pixels are damaged
  std::int64_t torn = 0;        ///< 1 if the file ended inside a record
  bool changed = false;
  std::filesystem::path damaged_copy;  ///< where a file went that had to be rewritten; or empty
  std::vector<std::int64_t> lost_triggers;  ///< triggers of the take without a record
};

struct TakeRecovery {
  bool changed = false;  ///< false: there was nothing to recover
  std::string state;     ///< of take.json afterwards
  std::string verdict;
  std::vector<std::string> reasons;
  std::int64_t triggers = 0;        ///< of the take
  std::int64_t added_triggers = 0;  ///< lines that triggers.csv lacked
  std::vector<CameraRecovery> cameras;
};

/// Makes a take whole after its recorder was killed, the disk ran full or a file was cut or
/// damaged: every record whose checksums hold is kept, everything else goes; triggers.csv gets the
/// triggers it lacks (their times estimated from the cameras' clocks); take.json becomes
/// `recovered` with a verdict and reasons. A file that is damaged in its middle is rewritten and
/// its original kept as SERIAL.raw.damaged. A take without damage that was closed stays as it is.
/// Can be interrupted and repeated at any point. Throws Error if the take is being recorded, is no
/// take, or cannot be written.
TakeRecovery RecoverTake(const std::filesystem::path& directory,
                         const RecoverOptions& options = {});

}  // namespace sole::io
