// The short version of bench_record: every frame triggered is stored and is the one that was
// served.
#include <gtest/gtest.h>

#include "bench/runtime/record_run.h"
#include "tests/support/temp_dir.h"

namespace sole::bench {
namespace {

RecordRunOptions Small(int net) {
  return {.cameras = 4,
          .rate_hz = 20,
          .seconds = 3,
          .width = 640,
          .height = 480,
          .drop = 0.005,
          .packet_size = 1500,
          .net = net,
          .own_process = false};
}

void ExpectNothingLost(const RecordRunResult& result) {
  EXPECT_EQ(result.expected, 240);
  EXPECT_EQ(result.verified, 240) << testing::PrintToString(result.reasons);
  EXPECT_EQ(result.wrong, 0);
  EXPECT_EQ(result.lost + result.incomplete, 0);
  EXPECT_GT(result.resent_packets, 0U);  // about 250 of 50,000 were dropped
  EXPECT_NEAR(result.megabytes_per_s, 1e-6 * 80 * 640 * 480, 5);
}

TEST(RecordRate, ChecksummedEveryFrameIsTheOneThatWasServed) {
  ExpectNothingLost(RunRecording(Small(101)));
}

TEST(RecordRate, FromTheDiskToo) {
  const testing_support::TempDir dir;
  RecordRunOptions options = Small(102);
  options.directory = dir.Path();
  const RecordRunResult result = RunRecording(options);
  ExpectNothingLost(result);
  EXPECT_EQ(result.reread, 240);
}

}  // namespace
}  // namespace sole::bench
