#pragma once

#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

namespace sole::app {

struct ChildOptions {
  std::filesystem::path log = {};     ///< where the program's output goes
  std::filesystem::path folder = {};  ///< working folder, also for its temporary files; empty: ours
  double timeout_s = 600;
  int threads = 0;               ///< cores it may use; 0: all
  const std::atomic<bool>* stop = nullptr;
  std::vector<std::string> environment = {};  ///< NAME=VALUE, on top of ours
};

/// Where PATH has this program; empty if nowhere.
std::filesystem::path FindProgram(const std::string& name);

/// Runs a program and waits for it; returns its exit status, or 128 + the signal that ended it. It dies
/// with us, and nothing that it started outlives it. Throws Error if it cannot be started, exceeds the
/// time or `stop` is set.
int RunChild(const std::filesystem::path& program, const std::vector<std::string>& arguments,
             const ChildOptions& options);

}  // namespace sole::app
