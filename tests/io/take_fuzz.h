#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace sole::io {

struct TakeFuzzOptions {
  std::uint64_t seed = 1;
  std::int64_t rounds = INT64_MAX;  ///< ends after that many ...
  double seconds = 1e9;             ///< ... or after that time
};

struct TakeFuzzResult {
  std::int64_t rounds = 0;
  std::map<std::string, std::int64_t> accepted;  ///< by kind of file: damaged ones that were read
  std::map<std::string, std::int64_t> refused;   ///< by kind of file: Error
  std::string finding;  ///< empty: none; else what went wrong in the last round
};

/// Damages the files of a small take, one at a time, and reads, checks, recovers and restores it.
/// Headers of recordings are often sealed anew, so that damage gets past their checksums. A finding
/// is: an exception other than Error, an Error of more than one line, an image that is not the one
/// that was recorded although nothing was sealed anew, or a recovered take that fails its check.
TakeFuzzResult FuzzTake(const TakeFuzzOptions& options);

}  // namespace sole::io
