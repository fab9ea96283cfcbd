#include "core/ranges.h"

#include <vector>

#include <gtest/gtest.h>

namespace sole {
namespace {

using Numbers = std::vector<std::int64_t>;

TEST(FormatRanges, JoinsNeighboursAndCountsWhatItLeavesOut) {
  EXPECT_EQ(FormatRanges(Numbers{}), "");
  EXPECT_EQ(FormatRanges(Numbers{4}), "4");
  EXPECT_EQ(FormatRanges(Numbers{4, 5}), "4, 5");
  EXPECT_EQ(FormatRanges(Numbers{4, 7, 8, 9, 11}), "4, 7 to 9, 11");
  EXPECT_EQ(FormatRanges(Numbers{1, 3, 5, 7, 8, 9}, 3), "1, 3, 5 and 3 more");
}

}  // namespace
}  // namespace sole
