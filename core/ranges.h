#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace sole {

/// Ascending numbers for people: "4, 7 to 9 and 2 more" shows at most `shown` ranges.
std::string FormatRanges(std::span<const std::int64_t> numbers, int shown = 5);

}  // namespace sole
