#include "app/child_process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <string>
#include <thread>

#include "io/atomic_file.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

class ChildProcess : public testing::Test {
 protected:
  int Run(const std::string& script, ChildOptions options = {}) {
    options.log = folder / "log";
    return RunChild("/bin/sh", {"-c", script}, options);
  }
  /// The process whose number the script wrote ends (it may wait for its parent to notice).
  void ExpectGone() {
    const std::string stat = "/proc/" + std::to_string(std::stoi(io::ReadFile(folder / "pid"))) + "/stat";
    const auto gone = [&] {
      std::ifstream file(stat);
      std::string number, name, state;
      return !(file >> number >> name >> state) || state == "Z";
    };
    for (int i = 0; i < 500 && !gone(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    EXPECT_TRUE(gone());
  }
  TempDir folder;
};

TEST_F(ChildProcess, GivesStatusOutputFolderAndEnvironment) {
  EXPECT_EQ(Run("exit 3"), 3);
  EXPECT_EQ(Run("kill -9 $$"), 128 + 9);
  EXPECT_EQ(Run("echo $GREETING >&2; pwd; cat; echo $HOME", {.folder = folder.Path(), .environment = {"GREETING=good day"}}), 0);
  EXPECT_EQ(io::ReadFile(folder / "log"), "good day\n" + folder.Path().string() + "\n" + std::getenv("HOME") + "\n");
}

TEST_F(ChildProcess, MayUseSoManyCores) {
  EXPECT_EQ(Run("nproc", {.threads = 1, .environment = {"OMP_NUM_THREADS="}}), 0);
  EXPECT_EQ(io::ReadFile(folder / "log"), "1\n");
}

TEST_F(ChildProcess, IsStoppedWithAllItStarted) {
  const std::string forever = "sleep 1000 & echo $! > " + (folder / "pid").string() + "; wait";
  EXPECT_THAT(ErrorOf([&] { Run(forever, {.timeout_s = 0.5}); }), HasSubstr("took longer than 0.5 s"));
  ExpectGone();
  std::atomic<bool> stop = false;
  std::thread hand([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    stop = true;
  });
  EXPECT_THAT(ErrorOf([&] { Run(forever, {.stop = &stop}); }), HasSubstr("was interrupted"));
  hand.join();
  ExpectGone();
  EXPECT_EQ(Run("sleep 1000 & echo $! > " + (folder / "pid").string()), 0);
  ExpectGone();
}

TEST_F(ChildProcess, SaysIfThereIsNoSuchProgram) {
  EXPECT_THAT(ErrorOf([&] { RunChild("/no/such/program", {}, {.log = folder / "log"}); }), HasSubstr("cannot start /no/such/program"));
  EXPECT_TRUE(FindProgram("no-such-program").empty());
  EXPECT_EQ(FindProgram("sh").filename(), "sh");
}

}  // namespace
}  // namespace sole::app
