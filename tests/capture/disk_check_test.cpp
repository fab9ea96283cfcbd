#include "capture/disk_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::capture {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

TEST(WriteRateNeeded, CountsCamerasExposuresAndRate) {
  RigConfig config = MakeDefaultRig(20);
  const double one = WriteRateNeeded(config);
  EXPECT_NEAR(one, 20 * 1624 * 1236 * 10.0, 0.01 * one);
  config.trigger.exposures = {ExposureKind::kSpeckle, ExposureKind::kTexture};
  EXPECT_EQ(WriteRateNeeded(config), 2 * one);
}

TEST(RequireDisk, TooSlowAndTooFullAreTold) {
  const TempDir scratch;
  RigConfig config = MakeDefaultRig(20);
  config.trigger.rate_hz = 1000;  // 40 GB/s
  config.disk.write_test_mb = 8;
  EXPECT_THAT(ErrorOf([&] { RequireDisk(scratch.Path(), config, 0); }),
              AllOf(HasSubstr("too slow"), HasSubstr("MB/s")));
  config.disk.write_test_mb = 0;
  RequireDisk(scratch.Path(), config, 0);
  config.disk.reserve_mb = 1e9;
  EXPECT_THAT(ErrorOf([&] { RequireDisk(scratch.Path(), config, 0); }), HasSubstr("too little room"));
  EXPECT_TRUE(std::filesystem::is_empty(scratch.Path()));
}

}  // namespace
}  // namespace sole::capture
