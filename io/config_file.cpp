#include "io/config_file.h"

#include <algorithm>
#include <map>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/toml_table_internal.h"

namespace sole::io {

struct ConfigFile::State {
  toml::table parsed;
  std::optional<TomlTable> top;
  std::map<std::string, std::vector<TomlTable>> tables;

  State(const std::string& text, const std::string& name) : parsed(ParseToml(text, name)) {
    top.emplace(parsed, name, "");
  }

  /// The table; null if the file has none of that name.
  TomlTable* Find(const std::string& name) {
    if (name.empty()) return &*top;
    auto found = tables.find(name);
    if (found == tables.end()) found = tables.emplace(name, top->Table(name.c_str())).first;
    return found->second.empty() ? nullptr : &found->second.front();
  }
};

ConfigFile::ConfigFile(const std::filesystem::path& path)
    : state_(std::make_unique<State>(ReadFile(path), path.string())) {}

ConfigFile::ConfigFile(const std::string& toml, const std::string& name)
    : state_(std::make_unique<State>(toml, name)) {}

ConfigFile::~ConfigFile() = default;

void ConfigFile::Read(const char* table, const char* key, int& value, int low, int high) {
  if (TomlTable* found = state_->Find(table)) found->Read(key, value, {static_cast<double>(low), static_cast<double>(high)});
}

void ConfigFile::Read(const char* table, const char* key, double& value, double low, double high) {
  if (TomlTable* found = state_->Find(table)) found->Read(key, value, {low, high});
}

void ConfigFile::Read(const char* table, const char* key, bool& value) {
  if (TomlTable* found = state_->Find(table)) found->Read(key, value);
}

void ConfigFile::Read(const char* table, const char* key, std::string& value,
                      std::span<const char* const> allowed) {
  TomlTable* found = state_->Find(table);
  if (!found) return;
  found->Read(key, value);
  if (std::find(allowed.begin(), allowed.end(), value) == allowed.end())
    found->Fail(key, fmt::format("must be one of {}", fmt::join(allowed, ", ")));
}

void ConfigFile::Finish() {
  state_->top->Finish();
  for (const auto& [name, some] : state_->tables) {
    for (const TomlTable& table : some) table.Finish();
  }
}

}  // namespace sole::io
