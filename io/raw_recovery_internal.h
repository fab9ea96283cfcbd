#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "io/raw_file.h"

namespace sole::io {

struct RawRecovery {
  std::vector<RawRecord> records;  ///< those that were kept, where they now lie
  std::int64_t dropped = 0;        ///< records with a sound header that `keep` refused
  bool torn = false;               ///< the file ended inside a record
  bool changed = false;
  std::filesystem::path damaged_copy;  ///< the original, if it had to be rewritten; or empty
};

/// Makes `path` (or `path`.partial) a closed file that holds exactly the records that `keep`
/// accepts. Cuts a torn tail off in place; rewrites a file that is damaged elsewhere. A missing
/// file becomes one without records. Throws Error if another program is writing it, or on file
/// errors.
RawRecovery RecoverRawFile(
    const std::filesystem::path& path, const std::string& serial,
    const std::function<bool(const std::filesystem::path& file, const RawRecord& record)>& keep);

}  // namespace sole::io
