#include "tests/app/recorder_crash.h"

namespace sole::app {
namespace {

TEST(RecorderCrash, Kill9TwentyTimesLosesNothingThatWasWritten) {
  std::mt19937 random(4);
  for (int round = 0; round < 20; ++round) {
    SCOPED_TRACE("round " + std::to_string(round));
    testing_support::KillAndRecover(150 + round, random);
  }
}

}  // namespace
}  // namespace sole::app
