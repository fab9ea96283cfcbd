#pragma once

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/raw_file.h"
#include "io/rig_file.h"
#include "io/take.h"
#include "tests/app/run_program.h"
#include "tests/capture/simulated_rig.h"
#include "tests/support/temp_dir.h"

namespace sole::testing_support {

constexpr std::uint64_t kCrashRecord = io::kRawBlock + 320 * 96 + 2048;  // whole blocks

/// Records in the background with the real program; the caller kills it.
inline pid_t StartRecording(const std::filesystem::path& rig, const std::filesystem::path& take) {
  const std::string arguments[] = {SOLE_PROGRAM, "record", rig.string(), "--subject", "P01", "--take", take.string(), "--frames", "10000"};
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = -1;
  EXPECT_EQ(::posix_spawn(&child, SOLE_PROGRAM, &actions, nullptr, argv.data(), environ), 0);
  posix_spawn_file_actions_destroy(&actions);
  return child;
}

/// Kills a recording of four cameras at a random moment, recovers it with the program and compares
/// every image with what its camera exposed. `net` is the simulated rig's own.
inline void KillAndRecover(int net, std::mt19937& random) {
  const TempDir dir;
  const capture::SimulatedRig rig(net, 4);
  io::WriteRigFile(dir / "rig.toml", rig.config);
  const io::TakePaths take{dir / "take"};
  const auto size = [&](const CameraConfig& camera) {
    std::error_code error;
    const auto bytes = std::filesystem::file_size(take.Raw(camera.serial).string() + ".partial", error);
    return error ? std::uintmax_t{0} : bytes;
  };
  const pid_t child = StartRecording(dir / "rig.toml", take.root);
  for (int i = 0; i < 30'000 && size(rig.config.cameras[0]) <= io::kRawBlock; ++i) ::usleep(1000);
  ::usleep(static_cast<useconds_t>(random() % 2'000'000));
  // Whatever is in the files by now was written before the end.
  std::vector<std::int64_t> written;
  for (const CameraConfig& camera : rig.config.cameras)
    written.push_back((static_cast<std::int64_t>(size(camera)) - static_cast<std::int64_t>(io::kRawBlock)) / static_cast<std::int64_t>(kCrashRecord));
  ::kill(child, SIGKILL);
  int status = 0;
  ::waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status)) << "the recorder ended by itself";
  ASSERT_GT(written[0], 0);

  const ProgramResult recovered = RunSole("take recover --json " + take.root.string(), "exec 2>/dev/null");
  ASSERT_EQ(recovered.status, 0) << recovered.output;
  const std::size_t brace = recovered.output.find('{');
  const nlohmann::json json = nlohmann::json::parse(recovered.output.substr(brace));
  EXPECT_EQ(json["state"], "recovered");
  EXPECT_TRUE(json["changed"]);
  io::TakeReader reader(take.root);
  std::vector<std::int64_t> images(4);
  while (const auto set = reader.Next()) {
    for (std::size_t c = 0; c < images.size(); ++c) {
      const std::vector<std::int64_t> missing = json["cameras"][c]["missing_triggers"];
      EXPECT_EQ(set->images[c].has_value(), !std::ranges::binary_search(missing, set->trigger));
      if (!set->images[c]) continue;
      ++images[c];
      EXPECT_TRUE(set->images[c]->pixels == capture::SimulatedRig::Draw(static_cast<int>(c), set->trigger).pixels)
          << "camera " << c << " trigger " << set->trigger << " holds other pixels";
    }
  }
  for (std::size_t c = 0; c < images.size(); ++c) {
    EXPECT_GE(images[c], written[c]);
    EXPECT_EQ(images[c], json["cameras"][c]["records"].get<std::int64_t>());
    EXPECT_LE(json["cameras"][c]["torn"].get<int>() + json["cameras"][c]["damaged"].get<int>(), 1);
  }
  EXPECT_EQ(RunSole("take verify " + take.root.string()).status, 0);
}

}  // namespace sole::testing_support
