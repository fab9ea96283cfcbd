// Ctrl-C, once, on a command that takes long and does not wait for a clean end.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include <gtest/gtest.h>

#include "io/atomic_file.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

TEST(Interrupt, OneEndsARenderingThatWritesNothing) {
  const testing_support::TempDir directory;
  const std::string log = (directory / "log").string();
  const pid_t child = fork();
  if (child == 0) {
    const std::string command =
        "exec " SOLE_PROGRAM " demo --frames 20 --poses 40 --out " + (directory / "demo").string() + " > " + log + " 2>&1";
    execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    _exit(127);
  }
  // Its first file shows that it is at work; the rendering that follows takes minutes.
  while (!std::filesystem::exists(directory / "demo/rig.toml") && waitpid(child, nullptr, WNOHANG) == 0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  kill(child, SIGINT);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child) << io::ReadFile(log);
  EXPECT_TRUE(WIFSIGNALED(status)) << "it went on, and ended by itself";
  EXPECT_EQ(WTERMSIG(status), SIGINT);
  EXPECT_FALSE(std::filesystem::exists(directory / "demo/summary.json"));
}

}  // namespace
}  // namespace sole::app
