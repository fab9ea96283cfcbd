#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace sole::io {

/// Writes a file so that it is either whole or absent: `write` fills a temporary name beside
/// `path`, which is then renamed. Throws Error (naming the path and the reason) and removes the
/// temporary file on failure; an earlier file of that name stays untouched.
void WriteAtomically(const std::filesystem::path& path,
                     const std::function<void(const std::filesystem::path& temporary)>& write);

/// The same for a text or binary string.
void WriteStringAtomically(const std::filesystem::path& path, const std::string& content);

/// Whole file as a string. Throws Error if it cannot be read.
std::string ReadFile(const std::filesystem::path& path);

/// Creates a directory (and parents). Throws Error saying why it cannot.
void MakeDirectory(const std::filesystem::path& path);

}  // namespace sole::io
