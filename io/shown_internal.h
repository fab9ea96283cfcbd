#pragma once

#include <string>
#include <string_view>

namespace sole::io {

/// Text from a file as it may stand in an error message: one line, no control characters, at most
/// 60 bytes.
inline std::string Shown(std::string_view text) {
  constexpr std::size_t kLongest = 60;
  std::string shown;
  for (const char c : text.substr(0, kLongest)) {
    const auto byte = static_cast<unsigned char>(c);
    shown += byte < 0x20 || byte == 0x7f ? '?' : c;
  }
  return text.size() > kLongest ? shown + "..." : shown;
}

}  // namespace sole::io
