// A recorder that dies at a random moment, a disk that runs full: what had been written stays.
#include <fcntl.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <new>
#include <random>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/take_check.h"
#include "io/take_recovery.h"
#include "tests/support/error_matcher.h"
#include "tests/support/recorded_take.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

namespace fs = std::filesystem;
using testing::AnyOf;
using testing::HasSubstr;
using testing::IsEmpty;
using namespace testing_support;

constexpr std::size_t kCameras = 4;
constexpr std::int64_t kEndless = 1'000'000;

/// Shared with the process that dies: trigger of each camera's last Append that returned.
using Written = std::array<std::atomic<std::int64_t>, kCameras>;

/// Memory that a fork shares.
struct SharedMemory {
  SharedMemory()
      : written(new (::mmap(nullptr, sizeof(Written), PROT_READ | PROT_WRITE,
                            MAP_SHARED | MAP_ANONYMOUS, -1, 0)) Written{}) {}
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;
  ~SharedMemory() { ::munmap(written, sizeof(Written)); }
  Written* written;
};

/// Records like a recorder, a thread per camera, until the disk refuses; triggers.csv follows
/// behind.
void RecordUntilTheEnd(const TakePaths& take, const RigConfig& config, Written& written) {
  std::vector<std::unique_ptr<RawFileWriter>> writers;
  for (const CameraConfig& camera : config.cameras)
    writers.push_back(std::make_unique<RawFileWriter>(take.Raw(camera.serial), camera.serial));
  std::vector<std::thread> threads;
  std::atomic<bool> full{false};
  for (std::size_t c = 0; c < kCameras; ++c) {
    threads.emplace_back([&, c] {
      try {
        for (std::int64_t t = 1; t < kEndless && !full; ++t) {
          writers[c]->Append(TinyHeader(config, c, t), TinyImage(config, c, t).pixels.data());
          written[c] = t;
        }
      } catch (const Error&) {
        full = true;
      }
    });
  }
  std::vector<TriggerRecord> triggers;
  while (!full) {
    ::usleep(2000);
    while (static_cast<std::int64_t>(triggers.size()) < written[0] / 2)
      triggers.push_back(TinyTrigger(static_cast<std::int64_t>(triggers.size()) + 1));
    try {
      WriteTriggers(take, triggers);
    } catch (const Error&) {
      full = true;
    }
  }
  for (std::thread& thread : threads) thread.join();
}

/// Recovers and compares with what had been written: nothing of it may lack, at most one record a
/// camera may be torn, no image may be another than the recorded one.
void ExpectRecovered(const TakePaths& take, const RigConfig& config, const Written& written) {
  const TakeRecovery result = RecoverTake(take.root);
  EXPECT_EQ(result.state, "recovered");
  std::int64_t last = 0;
  for (std::size_t c = 0; c < kCameras; ++c) {
    const CameraRecovery& camera = result.cameras[c];
    EXPECT_GE(camera.kept, written[c].load()) << camera.serial;
    EXPECT_LE(camera.kept, written[c].load() + 1) << camera.serial;
    EXPECT_LE(camera.torn + camera.dropped, 1) << camera.serial;
    last = std::max(last, camera.kept);
  }
  EXPECT_EQ(result.triggers, last);
  TakeReader reader(take.root);
  std::vector<std::int64_t> images(kCameras);
  while (const auto set = reader.Next()) {
    EXPECT_EQ(set->kind, TinyKind(set->trigger));
    EXPECT_NEAR(set->time_s, TinyTrigger(set->trigger).actual_s, 2e-3);
    for (std::size_t c = 0; c < kCameras; ++c) {
      const CameraRecovery& camera = result.cameras[c];
      const bool lost = std::ranges::binary_search(camera.lost_triggers, set->trigger);
      EXPECT_EQ(set->images[c].has_value(), !lost) << camera.serial << " trigger " << set->trigger;
      if (!set->images[c]) continue;
      ++images[c];
      EXPECT_TRUE(set->images[c]->pixels == TinyImage(config, c, set->trigger).pixels);
    }
  }
  for (std::size_t c = 0; c < kCameras; ++c) EXPECT_EQ(images[c], result.cameras[c].kept);
  EXPECT_THAT(CheckTake(take.root).faults, IsEmpty());
}

TEST(Crash, Kill9AtTwentyRandomMomentsLosesNothingThatWasWritten) {
  const RigConfig config = TinyRig(kCameras, 64, 96);
  std::mt19937 random(17);
  int killed_at_work = 0;
  for (int round = 0; round < 20; ++round) {
    const TempDir dir;
    const TakePaths take = BeginTake(dir / "take", config);
    const SharedMemory shared;
    const pid_t child = ::fork();
    if (child == 0) {
      RecordUntilTheEnd(take, config, *shared.written);
      ::_exit(0);
    }
    // Not before files and records exist in most rounds, and then at any moment.
    while (round % 5 != 0 && (*shared.written)[0] == 0) ::usleep(200);
    ::usleep(static_cast<useconds_t>(random() % 60'000));
    ::kill(child, SIGKILL);
    int status = 0;
    ::waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status));
    if ((*shared.written)[0] > 0) ++killed_at_work;
    SCOPED_TRACE("round " + std::to_string(round));
    ExpectRecovered(take, config, *shared.written);
  }
  EXPECT_GE(killed_at_work, 16);
}

/// Gives this process a file system of its own in `folder`; false where that is not permitted.
bool MountSmallDisk(const fs::path& folder, const char* size) {
  if (::unshare(CLONE_NEWNS) != 0 && ::unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0) return false;
  ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr);
  return ::mount("tmpfs", folder.c_str(), "tmpfs", 0, size) == 0;
}

constexpr int kNotPermitted = 77;

TEST(Crash, AFullDiskLosesNothingThatWasWritten) {
  const RigConfig config = TinyRig(kCameras, 64, 96);
  for (const char* size : {"size=1m", "size=1500k", "size=2m"}) {
    const TempDir dir;
    // In a process of its own, which alone sees the small disk.
    const pid_t child = ::fork();
    if (child == 0) {
      if (!MountSmallDisk(dir.Path(), size)) ::_exit(kNotPermitted);
      const TakePaths take = BeginTake(dir / "take", config);
      WriteStringAtomically(dir / "filler", std::string(64 << 10, 'x'));
      const SharedMemory shared;
      RecordUntilTheEnd(take, config, *shared.written);
      std::int64_t records = 0;
      for (const auto& camera : *shared.written) records += camera;
      EXPECT_GT(records, 50);  // whichever camera took the room
      // Not a byte may be left for a new triggers.csv: recovery says so and spoils nothing.
      const std::string error = ErrorOf([&] { RecoverTake(take.root); });
      EXPECT_THAT(error, AnyOf(HasSubstr("no error"),
                               HasSubstr("No space left on device: check that the folder")));
      fs::remove(dir / "filler");
      ExpectRecovered(take, config, *shared.written);
      ::_exit(testing::Test::HasFailure() ? 1 : 0);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    ASSERT_TRUE(WIFEXITED(status));
    if (WEXITSTATUS(status) == kNotPermitted)
      GTEST_SKIP()
          << "mounting a small disk is not permitted here: run as root or allow user namespaces";
    EXPECT_EQ(WEXITSTATUS(status), 0) << size;
  }
}

}  // namespace
}  // namespace sole::io
