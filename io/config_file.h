#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>

namespace sole::io {

/// A configuration in TOML: keys in tables, every one with a default. Errors are one line "file:line:column: ...";
/// keys that nobody asked for are errors with a suggestion.
class ConfigFile {
 public:
  /// Throws Error where the file cannot be read or is no TOML.
  explicit ConfigFile(const std::filesystem::path& path);
  /// From text; `name` stands for the path in messages.
  ConfigFile(const std::string& toml, const std::string& name);
  ~ConfigFile();
  ConfigFile(const ConfigFile&) = delete;
  ConfigFile& operator=(const ConfigFile&) = delete;

  /// Reads a key of a table ("" is the top of the file); absent, the value stays. Both bounds belong to the range.
  void Read(const char* table, const char* key, int& value, int low, int high);
  void Read(const char* table, const char* key, double& value, double low, double high);
  void Read(const char* table, const char* key, bool& value);
  /// One of some words.
  void Read(const char* table, const char* key, std::string& value, std::span<const char* const> allowed);
  /// To be called when every key was asked for: refuses the others.
  void Finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace sole::io
