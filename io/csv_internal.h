#pragma once

#include <charconv>
#include <cstdint>
#include <string>
#include <vector>

namespace sole::io {

/// A CSV file with a header row (RFC 4180: fields with comma, quote or line break stand in quotes).
struct CsvTable {
  std::string where;  ///< the file's path, for messages
  struct Row {
    std::size_t line = 0;  ///< line of the file, counted from 1
    std::vector<std::string> fields;
  };
  std::vector<Row> rows;  ///< without the header row

  /// "path:line: column 'name'" for messages.
  std::string Place(const Row& row, std::size_t column) const;
  double Number(const Row& row, std::size_t column) const;
  std::int64_t Integer(const Row& row, std::size_t column) const;

  std::vector<std::string> columns;
};

/// Parses `text`. Throws Error with path and line unless the header row is exactly `columns` and
/// every row has as many fields.
CsvTable ParseCsv(const std::string& text, const std::vector<std::string>& columns,
                  const std::string& where);

/// Quotes a field where needed.
std::string CsvField(const std::string& text);

}  // namespace sole::io
