// Serves simulated cameras to stock Aravis clients in the same process and checks every frame: one
// line of figures; exit status 1 if a frame was lost or wrong. --help tells the options.
#include <algorithm>
#include <cmath>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "core/error.h"
#include "tests/sim/camera_load.h"

int main(int argc, char** argv) {
  sole::sim::CameraLoadOptions options;
  double seconds = 60;
  bool action = false;
  CLI::App app("Rate of the simulated cameras");
  app.add_option("--cameras", options.cameras)->check(CLI::Range(1, 200));
  app.add_option("--rate", options.rate_hz)->check(CLI::Range(0.1, 1000.0));
  app.add_option("--seconds", seconds)->check(CLI::Range(0.1, 6000.0));
  app.add_option("--sets", options.sets)->check(CLI::Range(1, 1000));
  app.add_option("--drop", options.packet_drop_probability)->check(CLI::Range(0.0, 0.99));
  app.add_option("--packet", options.packet_size)->check(CLI::Range(576, 65500));
  app.add_option("--link", options.link_mbit_per_s, "Mbit/s of each camera");
  app.add_flag("--action", action, "Trigger by action commands instead of the line");
  CLI11_PARSE(app, argc, argv);
  options.triggers = static_cast<int>(std::lround(options.rate_hz * seconds));
  if (action) options.trigger = sole::sim::LoadTrigger::kAction;
  if (options.rate_hz > 50) options.link_mbit_per_s = std::max(options.link_mbit_per_s, 2500.0);
  try {
    const sole::sim::CameraLoadResult result = sole::sim::RunCameraLoad(options);
    fmt::print("{}\n", sole::sim::Describe(options, result));
    return result.right == result.asked ? 0 : 1;
  } catch (const sole::Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
}
