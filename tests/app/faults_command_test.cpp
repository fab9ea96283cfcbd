// Every fault by its name, from the command line and from the rig file, through the program: wire
// faults at a stock client, image faults in a rendered take. What each fault does exactly is the
// business of tests/sim/wire_faults_test.cpp and tests/sim/faults_test.cpp.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <set>
#include <sstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/fault.h"
#include "io/raw_file.h"
#include "io/rig_file.h"
#include "io/take.h"
#include "tests/app/run_program.h"
#include "tests/sim/gige_client.h"
#include "tests/support/temp_dir.h"

namespace sole {
namespace {

namespace fs = std::filesystem;
using sim::ArvClient;
using sim::RawClient;
using testing::ElementsAre;
using testing_support::ProgramResult;
using testing_support::RunSole;
using testing_support::TempDir;

/// Cameras F01, F02 ... on 127.0.<net>.1 onwards.
RigConfig MakeRig(int net, int cameras) {
  RigConfig config = MakeDefaultRig(cameras > 8 ? 20 : 8, 160, 120);
  config.cameras.resize(static_cast<std::size_t>(cameras));
  config.pairs.clear();
  for (std::size_t i = 0; i < config.cameras.size(); ++i) {
    config.cameras[i].serial = (i < 9 ? "F0" : "F") + std::to_string(i + 1);
    config.cameras[i].address = "127.0." + std::to_string(net) + "." + std::to_string(i + 1);
  }
  config.pairs.push_back({"below", "F01", "F02"});
  config.trigger.bus_port = 17900 + net;
  return config;
}

/// `sole sim serve` as a child process until destruction.
class Server {
 public:
  Server(const std::string& arguments, const fs::path& log) {
    const std::string command = std::string("exec ") + SOLE_PROGRAM + " sim serve " + arguments +
                                " > " + log.string() + " 2>&1";
    process_ = fork();
    if (process_ == 0) {
      execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
      _exit(127);
    }
    for (int i = 0; i < 1200 && !serving_; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      std::ostringstream text;
      text << std::ifstream(log).rdbuf();
      serving_ = text.str().find("serving ") != std::string::npos;
    }
  }
  ~Server() {
    kill(process_, SIGINT);
    waitpid(process_, nullptr, 0);
  }
  bool Serving() const { return serving_; }

 private:
  pid_t process_ = 0;
  bool serving_ = false;
};

/// What a client of one camera saw of six triggers.
struct Seen {
  std::vector<int> frames = std::vector<int>(6);  ///< of each trigger, by the nearest time
  std::vector<std::uint64_t> ids;
  std::vector<std::int64_t> off_ns;  ///< timestamp after the trigger's time
  std::vector<int> images;           ///< which of the rendered sets, numbered as they appear
  int early = 0;                     ///< frames within 0.2 s of their trigger
  std::uint64_t resent = 0;
};

/// One camera each, the first one healthy. The faults' own triggers are 1 or 3.
const std::vector<std::string>& WireFaults() {
  static const std::vector<std::string> faults = {"",
                                                  "lost-packets:F02:0.2",
                                                  "late-frames:F03:400",
                                                  "skipped-id:F04:2",
                                                  "repeated-id:F05",
                                                  "dead-link:F06:0",
                                                  "reboot:F07:0",
                                                  "desync:F08",
                                                  "clock-drift:F09:20000",
                                                  "missing-trigger:F10",
                                                  "double-trigger:F11"};
  return faults;
}

/// A client and the images it has seen.
struct Watcher {
  explicit Watcher(const std::string& address) : client(address) { client.Start("Line1", 576); }

  void Take(const std::vector<std::int64_t>& fired_ns) {
    while (const auto frame = client.Next(20)) {
      const auto stamp = static_cast<std::int64_t>(frame->timestamp_ns);
      std::size_t nearest = 0;
      for (std::size_t t = 1; t < fired_ns.size(); ++t) {
        if (std::abs(stamp - fired_ns[t]) < std::abs(stamp - fired_ns[nearest])) nearest = t;
      }
      if (nearest == 0) continue;  // the warm-up
      ++seen.frames[nearest - 1];
      seen.ids.push_back(frame->id);
      seen.off_ns.push_back(stamp - fired_ns[nearest]);
      std::size_t set = 0;
      while (set < sets.size() && !(sets[set].pixels == frame->image.pixels)) ++set;
      if (set == sets.size()) sets.push_back(frame->image);
      seen.images.push_back(static_cast<int>(set));
    }
  }

  ArvClient client;
  std::vector<ImageU8> sets;
  Seen seen;
};

std::int64_t NowNs() {
  return std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
}

std::vector<Seen> Watch(const RigConfig& config) {
  std::vector<std::unique_ptr<Watcher>> watchers;
  for (const CameraConfig& camera : config.cameras)
    watchers.push_back(std::make_unique<Watcher>(camera.address));
  const RawClient bus;
  std::vector<std::int64_t> fired_ns;
  for (std::int64_t trigger = 0; trigger <= 6; ++trigger) {
    fired_ns.push_back(NowNs());
    bus.Pulse(config.trigger.bus_port, {.sequence = trigger, .scheduled_ns = fired_ns.back()});
    for (const int wait_ms : {200, 600}) {
      std::this_thread::sleep_for(std::chrono::milliseconds(wait_ms) -
                                  std::chrono::nanoseconds(NowNs() - fired_ns.back()));
      if (wait_ms ==
          200) {  // The late ones only: others would be told early by their own timeouts.
        const std::size_t before = watchers[2]->seen.ids.size();
        if (NowNs() - fired_ns.back() < 350000000) watchers[2]->Take(fired_ns);
        watchers[2]->seen.early += static_cast<int>(watchers[2]->seen.ids.size() - before);
      }
    }
    for (const auto& watcher : watchers) watcher->Take(fired_ns);
  }
  std::vector<Seen> all;
  for (const auto& watcher : watchers) {
    watcher->seen.resent =
        arv_stream_get_info_uint64_by_name(watcher->client.Stream(), "n_resent_packets");
    all.push_back(watcher->seen);
  }
  return all;
}

void ExpectWireFaults(const RigConfig& config) {
  const std::vector<Seen> seen = Watch(config);
  // The two rendered sets take turns, each stamped with its own trigger.
  EXPECT_THAT(seen[0].ids, ElementsAre(2, 3, 4, 5, 6, 7));
  EXPECT_THAT(seen[0].off_ns, ElementsAre(0, 0, 0, 0, 0, 0));
  EXPECT_THAT(seen[0].images, ElementsAre(0, 1, 0, 1, 0, 1));
  EXPECT_EQ(seen[0].resent, 0U);
  EXPECT_GT(seen[1].resent, 0U) << "lost-packets";
  EXPECT_EQ(seen[2].early, 0) << "late-frames";
  EXPECT_THAT(seen[2].frames, ElementsAre(1, 1, 1, 1, 1, 1)) << "late-frames";
  EXPECT_THAT(seen[3].ids, ElementsAre(2, 3, 6, 7, 8, 9)) << "skipped-id";
  EXPECT_THAT(seen[4].frames, ElementsAre(1, 1, 0, 1, 1, 1)) << "repeated-id";
  EXPECT_THAT(seen[5].frames, ElementsAre(1, 1, 0, 0, 0, 0)) << "dead-link";
  EXPECT_THAT(seen[6].frames, ElementsAre(1, 1, 0, 0, 0, 0)) << "reboot";
  EXPECT_THAT(seen[7].images, ElementsAre(0, 0, 1, 0, 1, 0)) << "desync";
  ASSERT_FALSE(seen[8].off_ns.empty());
  EXPECT_GT(seen[8].off_ns.back(), seen[8].off_ns.front() + 5 * 500000LL * 20) << "clock-drift";
  EXPECT_THAT(seen[9].frames, ElementsAre(1, 1, 0, 1, 1, 1)) << "missing-trigger";
  EXPECT_THAT(seen[9].ids, ElementsAre(2, 3, 4, 5, 6)) << "missing-trigger";
  EXPECT_THAT(seen[10].frames, ElementsAre(1, 1, 2, 1, 1, 1)) << "double-trigger";
}

std::string CommandLine(const std::vector<std::string>& faults) {
  std::string text;
  for (const std::string& fault : faults) {
    if (!fault.empty()) text += " --fault " + fault;
  }
  return text;
}

/// The faults as tables of a rig file.
void AddToRig(const std::vector<std::string>& faults, RigConfig& config) {
  for (const std::string& fault : faults) {
    if (!fault.empty()) config.simulation.faults.push_back(ParseFault(fault));
  }
}

TEST(FaultsOfTheProgram, ListsAreComplete) {
  std::set<std::string> told = {"hot-pixels", "fog", "bumped-camera", "projector-off", "lights-on"};
  for (const std::string& fault : WireFaults()) told.insert(fault.substr(0, fault.find(':')));
  told.erase("");
  std::set<std::string> known;
  for (const FaultKind& kind : FaultKinds()) known.insert(kind.name);
  EXPECT_EQ(told, known) << "a new fault needs its line here";
}

TEST(FaultsOfTheProgram, WireFaultsFromTheCommandLine) {
  const TempDir directory;
  const RigConfig config = MakeRig(116, 11);
  io::WriteRigFile(directory / "rig.toml", config);
  const Server server((directory / "rig.toml").string() + " --calibration --frames 2 --seed 5" +
                          CommandLine(WireFaults()),
                      directory / "log");
  ASSERT_TRUE(server.Serving());
  ExpectWireFaults(config);
}

TEST(FaultsOfTheProgram, WireFaultsFromTheRigFile) {
  const TempDir directory;
  RigConfig config = MakeRig(117, 11);
  AddToRig(WireFaults(), config);
  io::WriteRigFile(directory / "rig.toml", config);
  const Server server((directory / "rig.toml").string() + " --calibration --frames 2 --seed 5",
                      directory / "log");
  ASSERT_TRUE(server.Serving());
  ExpectWireFaults(config);
}

/// Images [trigger - 1][camera] of `sole sim render`.
using Images = std::vector<std::vector<ImageU8>>;

Images Render(const RigConfig& config, const std::string& options, const fs::path& directory) {
  io::WriteRigFile(directory.string() + ".toml", config);
  const ProgramResult result =
      RunSole("sim render " + directory.string() + ".toml --frames 4 --seed 5 --noise 0 --out " +
              directory.string() + options);
  EXPECT_EQ(result.status, 0) << result.output;
  Images images;
  for (std::size_t trigger = 0; trigger < 4; ++trigger) {
    std::vector<ImageU8>& set = images.emplace_back();
    for (const CameraConfig& camera : config.cameras) {
      const fs::path raw = io::TakePaths{directory}.Raw(camera.serial);
      const io::RawIndex index = io::ReadRawIndex(raw);
      set.push_back(io::ReadRawImage(raw, index.records.at(trigger)));
    }
  }
  return images;
}

double Mean(const ImageU8& image) {
  double sum = 0;
  for (const std::uint8_t value : image.pixels) sum += value;
  return sum / static_cast<double>(image.pixels.size());
}

void ExpectImageFaults(const Images& good, const Images& faulty) {
  const auto changed = [&](std::size_t trigger, std::size_t camera) {
    return good[trigger - 1][camera].pixels != faulty[trigger - 1][camera].pixels;
  };
  for (std::size_t camera = 0; camera < 6; ++camera) {
    EXPECT_FALSE(changed(1, camera)) << camera;
    // F01 hot pixels, F02 fog, F03 bumped by 1 mm, F04 by 0.2 degrees, from trigger 2 on.
    EXPECT_EQ(changed(2, camera), camera < 4) << camera;
  }
  int hot = 0;
  for (std::size_t i = 0; i < 160 * 120; ++i)
    hot += faulty[1][0].pixels[i] == 255 && good[1][0].pixels[i] < 255;
  EXPECT_NEAR(hot, 0.01 * 160 * 120, 30);
  double darker = 0, lighter = 0;
  for (std::size_t camera = 4; camera < 6; ++camera) {
    darker += Mean(good[2][camera]) - Mean(faulty[2][camera]);     // projectors off from 3 on
    lighter += Mean(faulty[3][camera]) - Mean(faulty[2][camera]);  // lights on at 4
  }
  EXPECT_GT(darker, 1);
  EXPECT_GT(lighter, 10);
}

TEST(FaultsOfTheProgram, ImageFaultsFromTheCommandLineAndTheRigFile) {
  const std::vector<std::string> faults = {"hot-pixels:F01:0.01@2",   "fog:F02:0.6@2",
                                           "bumped-camera:F03:1mm@2", "bumped-camera:F04:0.2deg@2",
                                           "projector-off::1@3",      "lights-on::1.6@4"};
  const TempDir directory;
  RigConfig config = MakeRig(118, 6);
  const Images good = Render(config, "", directory / "good");
  ExpectImageFaults(good, Render(config, CommandLine(faults), directory / "by_command"));
  AddToRig(faults, config);
  ExpectImageFaults(good, Render(config, "", directory / "by_file"));
}

}  // namespace
}  // namespace sole
