// `sole sim serve` beside the programs that use its cameras.

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <sstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/raw_file.h"
#include "io/rig_file.h"
#include "io/take.h"
#include "tests/app/run_program.h"
#include "tests/app/small_take.h"
#include "tests/support/temp_dir.h"

namespace sole {
namespace {

using testing::HasSubstr;
using testing_support::ProgramResult;
using testing_support::RunSole;
using testing_support::TempDir;

/// `sole sim serve` as a child process, from "serving" on its stderr until destruction.
class Server {
 public:
  Server(const std::string& rig, const std::filesystem::path& log) {
    const std::string command = std::string("exec ") + SOLE_PROGRAM + " sim serve " + rig +
                                " --calibration --frames 2 --seed 5 > " + log.string() + " 2>&1";
    process_ = fork();
    if (process_ == 0) {
      execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
      _exit(127);
    }
    for (int i = 0; i < 1200 && !serving_; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      std::ostringstream text;
      text << std::ifstream(log).rdbuf();
      serving_ = text.str().find("serving 4 cameras") != std::string::npos;
    }
  }
  ~Server() { Stop(); }
  /// Ctrl-C; the exit status.
  int Stop() {
    if (process_ <= 0) return -1;
    kill(process_, SIGINT);
    int status = 0;
    waitpid(process_, &status, 0);
    process_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  bool Serving() const { return serving_; }

 private:
  pid_t process_ = 0;
  bool serving_ = false;
};

ProgramResult Shell(const std::string& command) {
  ProgramResult result;
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  char buffer[4096];
  while (const std::size_t count = fread(buffer, 1, sizeof buffer, pipe)) result.output.append(buffer, count);
  result.status = WEXITSTATUS(pclose(pipe));
  return result;
}

TEST(SimServe, StockToolsListItAndTheRecorderUsesIt) {
  const TempDir directory;
  RigConfig config = MakeDefaultRig(4, 320, 240);
  for (std::size_t i = 0; i < 4; ++i) {
    config.cameras[i].address = "127.0.92." + std::to_string(i + 1);
    config.cameras[i].serial = "SRV" + std::to_string(i + 1);
  }
  config.pairs = {{"below", "SRV1", "SRV2"}, {"dorsum", "SRV3", "SRV4"}};
  config.trigger.bus_port = 17921;
  const std::string rig = (directory / "rig.toml").string();
  io::WriteRigFile(rig, config);
  Server server(rig, directory / "serve.log");
  ASSERT_TRUE(server.Serving());

  if (Shell("command -v arv-tool-0.8").status == 0) {
    const std::string listed = Shell("arv-tool-0.8").output;
    for (const CameraConfig& camera : config.cameras) EXPECT_THAT(listed, HasSubstr(camera.serial));
  }
  const ProgramResult check = RunSole("rig check " + rig);
  EXPECT_EQ(check.status, 0) << check.output;

  // A second program cannot take the cameras of a running recording.
  ProgramResult first;
  std::thread recording([&] {
    first = RunSole("record " + rig + " --texture --subject S1 --frames 60 --take " + (directory / "first").string());
  });
  while (!std::filesystem::exists(directory / "first" / "triggers.csv") &&
         !std::filesystem::exists(directory / "first" / "take.json")) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  const ProgramResult second = RunSole("record " + rig + " --subject S2 --frames 2 --take " + (directory / "second").string());
  EXPECT_EQ(second.status, 1) << second.output;
  EXPECT_EQ(second.ErrorLines(), 1) << second.output;
  EXPECT_THAT(second.output, HasSubstr("another program"));
  recording.join();
  EXPECT_EQ(first.status, 0) << first.output;
  for (const CameraConfig& camera : config.cameras) {
    EXPECT_EQ(io::ReadRawIndex(io::TakePaths{directory / "first"}.Raw(camera.serial)).records.size(), 60u);
  }
  EXPECT_EQ(server.Stop(), 0);
}

}  // namespace
}  // namespace sole
