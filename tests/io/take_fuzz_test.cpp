#include <sys/resource.h>

#include <gtest/gtest.h>

#include "tests/io/take_fuzz.h"

namespace sole::io {
namespace {

// The long run is `fuzz_take` (CONTRIBUTING.md).
TEST(TakeFuzz, DamagedTakesAreReadRightOrRefused) {
  const TakeFuzzResult result = FuzzTake({.seed = 5, .rounds = 1500});
  EXPECT_EQ(result.finding, "");
  EXPECT_EQ(result.rounds, 1500);
  for (const char* kind : {".raw", ".mkv", ".json", ".csv", ".toml"}) {
    EXPECT_GT(result.accepted.contains(kind) ? result.accepted.at(kind) : 0, 0) << kind;
    EXPECT_GT(result.refused.contains(kind) ? result.refused.at(kind) : 0, 0) << kind;
  }
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  EXPECT_LT(usage.ru_maxrss, 1024 * 1024) << "KiB";
}

}  // namespace
}  // namespace sole::io
