#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace sole::io {

using Bytes = std::vector<std::uint8_t>;

/// Entries of a zip archive held in `archive` by name. `where` starts every message. Throws Error
/// on a damaged archive, on encryption, zip64 and methods other than stored and deflated.
std::map<std::string, Bytes> ReadZip(const std::string& archive, const std::string& where);

/// A zip archive with these entries in order of name, deflated where that is smaller, dated
/// 1980-01-01. Throws Error if it would not fit into 4 GiB.
std::string FormatZip(const std::map<std::string, Bytes>& entries, const std::string& where);

}  // namespace sole::io
