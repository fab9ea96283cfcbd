#include "app/pseudonym.h"

#include <string_view>
#include <vector>

namespace sole::app {

bool LooksLikeFullName(const std::string& subject) {
  constexpr std::string_view kJoints = " ,._-\t'";
  const auto is_upper = [](char c) { return c >= 'A' && c <= 'Z'; };
  const auto is_lower = [](char c) {
    return (c >= 'a' && c <= 'z') || static_cast<unsigned char>(c) >= 0x80;  // letters of UTF-8
  };
  int words = 0, longer = 0;
  std::size_t length = 0;
  const auto end_word = [&] {
    words += length > 0 ? 1 : 0;
    longer += length > 1 ? 1 : 0;
    length = 0;
  };
  char before = 0;
  for (const char c : subject) {
    if (kJoints.find(c) != std::string_view::npos) {
      end_word();
    } else if (is_upper(c) || is_lower(c)) {
      if (is_upper(c) && is_lower(before)) end_word();
      ++length;
    } else {
      return false;  // digits and signs are a pseudonym's
    }
    before = c;
  }
  end_word();
  return words >= 2 && words <= 4 && longer >= 1;
}

}  // namespace sole::app
