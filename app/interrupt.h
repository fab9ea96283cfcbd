#pragma once

#include <atomic>

namespace sole::app {

/// For commands that end cleanly on Ctrl-C or SIGTERM: from this call on the first of them sets the flag returned and
/// the second ends the program at once (exit 130). Every other command ends at the first; what it writes
/// has temporary names until it is whole.
const std::atomic<bool>* StopOnInterrupt();

}  // namespace sole::app
