#pragma once

#include <stdlib.h>

#include <filesystem>
#include <string>

namespace sole::testing_support {

/// A folder of its own for one test, removed at the end.
class TempDir {
 public:
  /// Below `parent` if that is a folder (/dev/shm: in memory), else where temporary files go.
  explicit TempDir(const std::filesystem::path& parent = {}) {
    const auto below = std::filesystem::is_directory(parent) ? parent : std::filesystem::temp_directory_path();
    std::string name = (below / "sole-test-XXXXXX").string();
    path_ = ::mkdtemp(name.data());
  }
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;
  ~TempDir() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  const std::filesystem::path& Path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

}  // namespace sole::testing_support
