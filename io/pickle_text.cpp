// How pickles of protocol 0 write text.
#include <algorithm>
#include <array>
#include <charconv>

#include "io/pickle_internal.h"

namespace sole::io {
namespace {

/// Value of hexadecimal or octal digits.
std::uint32_t Digits(std::string_view text, int base) {
  std::uint32_t value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value, base);
  return value;
}

void AppendUtf8(std::string& text, std::uint32_t c) {
  const auto put = [&](std::uint32_t byte) {
    text += static_cast<char>(static_cast<unsigned char>(byte));
  };
  if (c < 0x80) {
    put(c);
    return;
  }
  const int more = c < 0x800 ? 1 : c < 0x10000 ? 2 : 3;
  constexpr std::array<std::uint32_t, 4> kLead = {0, 0xc0, 0xe0, 0xf0};
  put(kLead[static_cast<std::size_t>(more)] | c >> (6 * more));
  for (int i = more - 1; i >= 0; --i) put(0x80 | (c >> (6 * i) & 0x3f));
}

}  // namespace

std::string Unquoted(std::string_view text) {
  if (text.size() >= 2) text = text.substr(1, text.size() - 2);
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '\\' || i + 1 == text.size()) {
      result += text[i];
      continue;
    }
    const char c = text[++i];
    constexpr std::string_view kNames = "abfnrtv", kValues = "\a\b\f\n\r\t\v";
    if (const std::size_t at = kNames.find(c); at != std::string_view::npos) {
      result += kValues[at];
    } else if (c == 'x') {
      result += static_cast<char>(Digits(text.substr(i + 1, 2), 16));
      i += std::min<std::size_t>(2, text.size() - i - 1);
    } else if (c >= '0' && c <= '7') {
      std::size_t length = 1;
      while (length < 3 && i + length < text.size() && text[i + length] >= '0' &&
             text[i + length] <= '7')
        ++length;
      result += static_cast<char>(Digits(text.substr(i, length), 8) & 0xff);
      i += length - 1;
    } else {
      result += c;
    }
  }
  return result;
}

std::string Unescaped(std::string_view text) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool escape = text[i] == '\\' && i + 1 < text.size();
    const std::size_t length = !escape ? 0 : text[i + 1] == 'u' ? 4 : text[i + 1] == 'U' ? 8 : 0;
    if (length > 0 && i + 2 + length <= text.size()) {
      AppendUtf8(result, Digits(text.substr(i + 2, length), 16) & 0x1fffff);
      i += 1 + length;
    } else {
      AppendUtf8(result, static_cast<unsigned char>(text[i]));
    }
  }
  return result;
}

}  // namespace sole::io
