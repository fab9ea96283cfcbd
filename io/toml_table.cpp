#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <fmt/format.h>

#include "core/error.h"
#include "io/shown_internal.h"
#include "io/toml_table_internal.h"

namespace sole::io {
namespace {

std::string Position(const std::string& file, const toml::source_region& source) {
  return fmt::format("{}:{}:{}: ", file, source.begin.line, source.begin.column);
}

/// Number of single-character edits between two words (Levenshtein).
std::size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = std::exchange(row[j], std::min({substituted, row[j] + 1, row[j - 1] + 1}));
    }
  }
  return row[b.size()];
}

std::string Suggestion(const std::string& key, const std::set<std::string>& known) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, key.size() / 2) + 1;
  for (const std::string& candidate : known) {
    const std::size_t distance = EditDistance(key.substr(0, 64), candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best.empty() ? fmt::format("known are {}", fmt::join(known, ", "))
                      : "did you mean " + best + "?";
}

}  // namespace

TomlTable::TomlTable(const toml::table& table, std::string file, std::string title)
    : table_(&table), file_(std::move(file)), title_(std::move(title)) {}

const toml::node* TomlTable::Find(const char* key) {
  known_.insert(key);
  return table_->get(key);
}

std::string TomlTable::Titled(const std::string& key) const {
  return "key '" + Shown(key) + "'" + (title_.empty() ? "" : " in " + title_);
}

std::string TomlTable::At(const char* key) const {
  const toml::node* node = table_->get(key);
  return Position(file_, node ? node->source() : table_->source());
}

void TomlTable::Fail(const char* key, const std::string& message) const {
  throw Error(At(key) + Titled(key) + " " + message);
}

void TomlTable::Read(const char* key, std::string& value) {
  const toml::node* node = Find(key);
  if (!node) return;
  if (!node->is_string()) Fail(key, "must be text in quotes");
  value = node->as_string()->get();
}

void TomlTable::Read(const char* key, std::vector<std::string>& value) {
  const toml::node* node = Find(key);
  if (!node) return;
  const toml::array* list = node->as_array();
  if (!list) Fail(key, "must be a list of texts in quotes");
  value.clear();
  for (const toml::node& item : *list) {
    if (!item.is_string()) Fail(key, "must be a list of texts in quotes");
    value.push_back(item.as_string()->get());
  }
}

void TomlTable::ReadNameOrNumber(const char* key, std::string& value) {
  const toml::node* node = Find(key);
  if (!node) return;
  if (node->is_integer() && node->as_integer()->get() >= 0) {
    value = std::to_string(node->as_integer()->get());
  } else if (node->is_string()) {
    value = node->as_string()->get();
  } else {
    Fail(key, "must be a number from 0 or a name in quotes");
  }
}

void TomlTable::Read(const char* key, std::uint32_t& value) {
  constexpr std::int64_t kMax = std::numeric_limits<std::uint32_t>::max();
  const toml::node* node = Find(key);
  if (!node) return;
  if (!node->is_integer()) Fail(key, "must be an integer");
  const std::int64_t read = node->as_integer()->get();
  if (read < 0 || read > kMax) Fail(key, fmt::format("is {}, allowed are 0 to {}", read, kMax));
  value = static_cast<std::uint32_t>(read);
}

void TomlTable::Read(const char* key, bool& value) {
  const toml::node* node = Find(key);
  if (!node) return;
  if (!node->is_boolean()) Fail(key, "must be true or false");
  value = node->as_boolean()->get();
}

void TomlTable::Read(const char* key, int& value, Range range) {
  const toml::node* node = Find(key);
  if (!node) return;
  if (!node->is_integer()) Fail(key, "must be an integer");
  const std::int64_t read = node->as_integer()->get();
  if (static_cast<double>(read) < range.low || static_cast<double>(read) > range.high) {
    Fail(key, fmt::format("is {}, allowed are {} to {}", read, range.low, range.high));
  }
  value = static_cast<int>(read);
}

void TomlTable::Read(const char* key, double& value, Range range) {
  const toml::node* node = Find(key);
  if (!node) return;
  ReadNumbers(key, &value, 1);
  if (value < range.low || value > range.high) {
    Fail(key, fmt::format("is {}, allowed are {} to {}", value, range.low, range.high));
  }
}

void TomlTable::ReadNumbers(const char* key, double* values, std::size_t count) {
  const toml::node* node = Find(key);
  if (!node) return;
  const std::string expected =
      count == 1 ? "must be a number" : fmt::format("must be a list of {} numbers", count);
  const toml::array* list = node->as_array();
  if (count > 1 && (!list || list->size() != count)) Fail(key, expected);
  for (std::size_t i = 0; i < count; ++i) {
    const toml::node& item = count == 1 ? *node : *list->get(i);
    if (!item.is_number()) Fail(key, expected);
    const double read = item.is_integer() ? static_cast<double>(item.as_integer()->get())
                                          : item.as_floating_point()->get();
    if (!std::isfinite(read)) Fail(key, "must be finite");
    values[i] = read;
  }
}

std::vector<TomlTable> TomlTable::Table(const char* key) {
  const toml::node* node = Find(key);
  if (!node) return {};
  if (!node->is_table()) Fail(key, fmt::format("must be a table: write [{}]", key));
  return {TomlTable(*node->as_table(), file_, fmt::format("[{}]", key))};
}

std::vector<TomlTable> TomlTable::Tables(const char* key) {
  const toml::node* node = Find(key);
  if (!node) return {};
  const std::string parent = title_.empty() ? "" : title_.substr(1, title_.size() - 2) + ".";
  const std::string title = fmt::format("[[{}{}]]", parent, key);
  const toml::array* list = node->as_array();
  const std::string expected = "must be a list of tables: write " + title;
  if (!list) Fail(key, expected);
  std::vector<TomlTable> tables;
  for (const toml::node& item : *list) {
    if (!item.is_table()) Fail(key, expected);
    tables.emplace_back(*item.as_table(), file_, title);
  }
  return tables;
}

void TomlTable::Finish() const {
  for (auto&& [key, node] : *table_) {
    const std::string name(key.str());
    if (known_.contains(name)) continue;
    throw Error(Position(file_, key.source()) + "unknown " + Titled(name) + ": " +
                Suggestion(name, known_));
  }
}

toml::table ParseToml(const std::string& text, const std::string& file) {
  try {
    return toml::parse(text);
  } catch (const toml::parse_error& error) {
    throw Error(Position(file, error.source()) + std::string(error.description()));
  }
}

}  // namespace sole::io
