#include "io/disk_rate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

using testing_support::ErrorOf;
using testing_support::TempDir;

TEST(MeasureWriteRate, MeasuresWithinItsBoundsAndLeavesNothing) {
  const TempDir dir;
  const double rate =
      MeasureWriteRate(dir.Path(), {.files = 3, .frame_bytes = 1 << 16, .max_bytes = 3 << 20});
  EXPECT_GT(rate, 1e5);   // a floppy disk
  EXPECT_LT(rate, 1e11);  // memory
  EXPECT_TRUE(std::filesystem::is_empty(dir.Path()));
}

TEST(MeasureWriteRate, NamesAFolderThatIsNotThere) {
  const TempDir dir;
  EXPECT_THAT(ErrorOf([&] { MeasureWriteRate(dir / "none"); }), testing::HasSubstr("none"));
}

}  // namespace
}  // namespace sole::io
