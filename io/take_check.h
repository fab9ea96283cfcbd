#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace sole::io {

struct TakeCheckOptions {
  bool pixels = true;  ///< reads every image and checks its CRC; false: headers only
  int threads = 0;     ///< 0: all cores
  std::function<void(std::int64_t done, std::int64_t total)> progress{};  ///< records, any thread
  const std::atomic<bool>* stop = nullptr;
};

struct CameraCheck {
  std::string serial;
  std::string storage;  ///< raw, partial (not closed), archive or missing
  std::uint64_t bytes = 0;
  std::int64_t records = 0;
  std::int64_t incomplete = 0;              ///< of those: packets missing
  std::vector<std::int64_t> lost_triggers;  ///< triggers of triggers.csv without a record
  std::vector<std::string> faults;
};

struct TakeCheck {
  std::int64_t triggers = 0;
  std::vector<CameraCheck> cameras;
  std::vector<std::string>
      faults;  ///< one line each: file, what, what to do; those of the cameras included
  bool Ok() const { return faults.empty(); }
};

/// Looks for damage and contradictions: every record's CRC, torn and stray bytes, sizes, serials,
/// triggers that triggers.csv does not know or that appear twice, a take that was not closed, a
/// verdict that the files do not bear out. Lost frames as such are no fault. Throws Error only if
/// the directory is no take at all.
TakeCheck CheckTake(const std::filesystem::path& directory, const TakeCheckOptions& options = {});

}  // namespace sole::io
