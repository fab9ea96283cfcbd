#pragma once

#include <cstdint>
#include <optional>

namespace sole::capture {

/// Unwraps GigE Vision block ids, which count 1 ... 65535, 1, ... (0 is reserved). Ids above 65535
/// come from devices with 64-bit ids and pass unchanged. Late frames (up to half a cycle back)
/// unwrap to their earlier number; repeated ids to the same one.
class FrameIdUnwrapper {
 public:
  std::int64_t Unwrap(std::uint64_t id);

 private:
  std::optional<std::int64_t> newest_;  ///< unwrapped
};

}  // namespace sole::capture
