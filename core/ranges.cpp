#include "core/ranges.h"

namespace sole {

std::string FormatRanges(std::span<const std::int64_t> numbers, int shown) {
  std::string text;
  std::size_t i = 0;
  for (int count = 0; i < numbers.size() && count < shown; ++count) {
    std::size_t end = i;
    while (end + 1 < numbers.size() && numbers[end + 1] == numbers[end] + 1) ++end;
    text += (count == 0 ? "" : ", ") + std::to_string(numbers[i]);
    if (end > i) text += (end == i + 1 ? ", " : " to ") + std::to_string(numbers[end]);
    i = end + 1;
  }
  if (i < numbers.size()) text += " and " + std::to_string(numbers.size() - i) + " more";
  return text;
}

}  // namespace sole
