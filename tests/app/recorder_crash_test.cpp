#include "tests/app/recorder_crash.h"

namespace sole::app {
namespace {

TEST(RecorderCrash, Kill9LosesNothingThatWasWritten) {
  std::mt19937 random(3);
  for (int round = 0; round < 2; ++round) testing_support::KillAndRecover(141 + round, random);
}

}  // namespace
}  // namespace sole::app
