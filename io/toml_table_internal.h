#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <toml++/toml.h>

namespace sole::io {

/// Bounds of a number; both ends belong to it.
struct Range {
  double low;
  double high;
};

/// Reads one table of a TOML file key by key. Every error says "file:line:column:". A key that is
/// absent leaves the value as it is. Finish() refuses keys that nobody asked for and suggests the
/// nearest one.
class TomlTable {
 public:
  /// `title` is how users write the table: "[plate]" or "[[camera]]"; empty for the top of the
  /// file.
  TomlTable(const toml::table& table, std::string file, std::string title);

  void Read(const char* key, std::string& value);
  void Read(const char* key, std::vector<std::string>& value);
  void Read(const char* key, bool& value);
  void Read(const char* key, int& value, Range range);
  void Read(const char* key, std::uint32_t& value);
  void Read(const char* key, double& value, Range range);
  void Read(const char* key, Eigen::Vector2d& value) { ReadNumbers(key, value.data(), 2); }
  void Read(const char* key, Eigen::Vector3d& value) { ReadNumbers(key, value.data(), 3); }
  /// Text, or an integer from 0 as its digits.
  void ReadNameOrNumber(const char* key, std::string& value);
  /// A sub-table; none if absent.
  std::vector<TomlTable> Table(const char* key);
  /// An array of tables; empty if absent.
  std::vector<TomlTable> Tables(const char* key);
  void Finish() const;

  bool Has(const char* key) const { return table_->contains(key); }
  /// "file:line:column: " of a key's value, or of the table if the key is absent.
  std::string At(const char* key) const;
  [[noreturn]] void Fail(const char* key, const std::string& message) const;

 private:
  const toml::node* Find(const char* key);
  void ReadNumbers(const char* key, double* values, std::size_t count);
  std::string Titled(const std::string& key) const;

  const toml::table* table_;
  std::string file_;
  std::string title_;
  std::set<std::string> known_;
};

/// Parses TOML; throws Error "file:line:column: ..." on a syntax error.
toml::table ParseToml(const std::string& text, const std::string& file);

}  // namespace sole::io
