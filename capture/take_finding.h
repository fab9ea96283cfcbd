#pragma once

#include <string>

namespace sole::capture {

/// One thing that is wrong with a take.
struct TakeFinding {
  std::string reason;   ///< one line: what, where, what to do
  bool repeat = false;  ///< the take is to be repeated; otherwise it is still usable
};

}  // namespace sole::capture
