#include <cmath>
#include <limits>

#include "core/error.h"
#include "io/csv_internal.h"
#include "io/shown_internal.h"

namespace sole::io {
namespace {

std::string Joined(const std::vector<std::string>& columns) {
  std::string text;
  for (const std::string& column : columns) text += (text.empty() ? "" : ",") + column;
  return text;
}

/// Splits into rows of fields; blank lines are skipped.
std::vector<CsvTable::Row> Split(const std::string& text, const std::string& where) {
  std::vector<CsvTable::Row> rows;
  std::size_t line = 1;
  for (std::size_t i = 0; i < text.size();) {
    CsvTable::Row row{line, {""}};
    bool quoted = false;
    for (; i < text.size(); ++i) {
      const char c = text[i];
      if (c == '\n') ++line;
      if (quoted) {
        if (c != '"')
          row.fields.back() += c;
        else if (i + 1 < text.size() && text[i + 1] == '"')
          row.fields.back() += text[++i];
        else
          quoted = false;
      } else if (c == '"' && row.fields.back().empty()) {
        quoted = true;
      } else if (c == ',') {
        row.fields.emplace_back();
      } else if (c == '\n') {
        break;
      } else if (c != '\r') {
        row.fields.back() += c;
      }
    }
    ++i;
    if (quoted) throw Error(where + ":" + std::to_string(row.line) + ": a quoted field has no end");
    if (row.fields.size() > 1 || !row.fields[0].empty()) rows.push_back(row);
  }
  return rows;
}

}  // namespace

std::string CsvTable::Place(const Row& row, std::size_t column) const {
  return where + ":" + std::to_string(row.line) + ": column '" + columns[column] + "'";
}

double CsvTable::Number(const Row& row, std::size_t column) const {
  const std::string& text = row.fields[column];
  double value = std::numeric_limits<double>::quiet_NaN();
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size()) {
    throw Error(Place(row, column) + ": '" + Shown(text) + "' is not a number");
  }
  return value;
}

std::int64_t CsvTable::Integer(const Row& row, std::size_t column) const {
  const std::string& text = row.fields[column];
  std::int64_t value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size()) {
    throw Error(Place(row, column) + ": '" + Shown(text) + "' is not an integer");
  }
  return value;
}

CsvTable ParseCsv(const std::string& text, const std::vector<std::string>& columns,
                  const std::string& where) {
  CsvTable table{where, Split(text, where), columns};
  Require(!table.rows.empty() && table.rows[0].fields == columns,
          where + ":1: the first line must be '" + Joined(columns) + "'");
  table.rows.erase(table.rows.begin());
  for (const CsvTable::Row& row : table.rows) {
    Require(row.fields.size() == columns.size(),
            where + ":" + std::to_string(row.line) + ": has " + std::to_string(row.fields.size()) +
                " fields, expected " + std::to_string(columns.size()));
  }
  return table;
}

std::string CsvField(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

}  // namespace sole::io
