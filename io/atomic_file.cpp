#include "io/atomic_file.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

#include "core/error.h"

namespace sole::io {

namespace fs = std::filesystem;

void WriteAtomically(const fs::path& path,
                     const std::function<void(const fs::path& temporary)>& write) {
  fs::path temporary = path;
  temporary.replace_filename("." + path.filename().string() + ".tmp" + std::to_string(getpid()) +
                             path.extension().string());
  try {
    write(temporary);
    fs::rename(temporary, path);
  } catch (const fs::filesystem_error& error) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    throw Error("cannot write " + path.string() + ": " + error.code().message() +
                ": check that the folder exists, is writable and has room");
  } catch (...) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    throw;
  }
}

void WriteStringAtomically(const fs::path& path, const std::string& content) {
  WriteAtomically(path, [&](const fs::path& temporary) {
    errno = 0;
    std::ofstream file(temporary, std::ios::binary);
    file.write(content.data(), static_cast<std::streamsize>(content.size()));
    file.close();
    Require(bool(file), "cannot write " + path.string() + ": " + std::strerror(errno) +
                            ": check that the folder exists, is writable and has room");
  });
}

std::string ReadFile(const fs::path& path) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  std::ostringstream content;
  if (file) content << file.rdbuf();
  Require(bool(file) && !fs::is_directory(path),
          "cannot read " + path.string() + ": " +
              (fs::is_directory(path) ? "it is a folder" : std::strerror(errno ? errno : EIO)));
  return content.str();
}

void MakeDirectory(const fs::path& path) {
  std::error_code code;
  fs::create_directories(path, code);
  Require(!code && fs::is_directory(path),
          "cannot create folder " + path.string() + ": " +
              (code ? code.message() : "a file of that name is in the way"));
}

}  // namespace sole::io
