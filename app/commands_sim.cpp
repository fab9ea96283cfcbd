#include <unistd.h>

#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/console.h"
#include "app/demo.h"
#include "app/evaluate.h"
#include "app/interrupt.h"
#include "app/simulation.h"
#include "core/error.h"
#include "io/rig_file.h"
#include "sim/faults.h"
#include "sim/motion.h"

namespace sole::app {
namespace {

struct SimArguments {
  std::string rig;
  std::string out;
  std::uint64_t seed = 1, rig_seed = 0;
  std::string motion = "stand";
  int frames = 6;
  double noise = -1;
  bool calibration = false;
  bool contact_sheet = false;
  bool truth_maps = false;
  std::vector<std::string> faults;
};

void AddFaultOption(CLI::App* command, std::vector<std::string>& faults) {
  command->add_option("--fault", faults,
                      "NAME[:CAMERA[:AMOUNT]][@TRIGGER], such as fog:CAM2:0.3; may be repeated (docs/faults.md)")
      ->allow_extra_args(false);
}

void AddSceneOptions(CLI::App* command, SimArguments& a) {
  command->add_option("RIG", a.rig, "Rig file; cameras need loopback addresses")->required();
  command->add_option("--seed", a.seed, "Subject and true rig")->capture_default_str();
  command->add_option("--rig-seed", a.rig_seed, "True rig, so that several subjects step onto one; default: --seed");
  command->add_option("--motion", a.motion, sim::MotionList())->capture_default_str();
  command->add_option("--frames", a.frames, "Frame sets to render")->check(CLI::Range(1, 100000))->capture_default_str();
  command->add_option("--noise", a.noise, "Scale of the sensor noise; default from the rig file")->check(CLI::Range(0.0, 100.0));
  AddFaultOption(command, a.faults);
  CLI::Option* cube =
      command->add_flag("--calibration", a.calibration, "The calibration cube in --frames poses instead of a foot");
  command->add_flag("--contact-sheet", a.contact_sheet, "The speckled sheet laid on the glass --frames times instead of a foot")
      ->excludes(cube);
}

RenderedTake RenderFor(const SimArguments& a, Simulation& simulation) {
  if (a.contact_sheet) return simulation.RenderContactSheet(a.frames);
  return a.calibration ? simulation.RenderCalibration(a.frames)
                       : simulation.RenderMotion(a.motion, a.frames, a.truth_maps ? a.out : "");
}

RigConfig ConfigFor(const SimArguments& a) {
  RigConfig config = io::ReadRigFile(a.rig);
  if (a.noise >= 0) config.simulation.noise = a.noise;
  for (const std::string& fault : a.faults) config.simulation.faults.push_back(ParseFault(fault));
  Validate(config);
  return config;
}

int Serve(const SimArguments& a) {
  const RigConfig config = ConfigFor(a);
  Simulation simulation(config, a.rig_seed ? a.rig_seed : a.seed, a.seed);
  const RenderedTake rendered = RenderFor(a, simulation);
  const sim::CameraServer server = ServeRendered(config, rendered);
  const std::atomic<bool>& stop = *StopOnInterrupt();
  Log(fmt::format("serving {} cameras at {} onwards, trigger bus on port {}; Ctrl-C ends", config.cameras.size(),
                  config.cameras.front().address, server.BusPort()));
  while (!stop) usleep(100000);
  for (const sim::ServedCameraStats& s : server.Stats()) {
    Log(fmt::format("{}: {} triggers, {} frames sent, {} packets", s.serial, s.triggers, s.frames_sent, s.packets_sent));
  }
  return 0;
}

int Render(const SimArguments& a) {
  const RigConfig config = ConfigFor(a);
  RequireNoTake(a.out);  // before the long work
  for (const FaultConfig& fault : config.simulation.faults) {
    if (!sim::ShowsInImages(fault)) Log("fault " + fault.name + " shows on the wire only: use sole sim serve");
  }
  Simulation simulation(config, a.rig_seed ? a.rig_seed : a.seed, a.seed);
  WriteRendered(config, RenderFor(a, simulation), a.out);
  simulation.WriteTruth(a.out);
  return 0;
}

}  // namespace

void AddSimCommands(CLI::App& app, CommonOptions& common, int& status) {
  auto a = std::make_shared<SimArguments>();
  CLI::App* sim = app.add_subcommand("sim", "The simulated rig");
  sim->require_subcommand(1);
  CLI::App* serve = sim->add_subcommand("serve", "Renders frames and serves them as GigE Vision cameras on loopback");
  serve->footer("Example: sole sim serve rig.toml --motion stand --frames 2");
  AddSceneOptions(serve, *a);
  serve->callback([=, &common, &status] {
    const ThreadCap cap(common.threads);
    status = Serve(*a);
  });
  CLI::App* render = sim->add_subcommand("render", "Renders a take with its truth straight to disk");
  render->footer("Example: sole sim render rig.toml --out take --seed 7 --motion rock --frames 20");
  AddSceneOptions(render, *a);
  render->add_option("--out", a->out, "Directory of the take")->required();
  render->add_flag("--truth-maps", a->truth_maps,
                   "Also write, for every image of a foot, maps of depth, material point, normal and visibility (truth/maps)");
  render->callback([=, &common, &status] {
    const ThreadCap cap(common.threads);
    status = Render(*a);
  });

  AddPeopleCommands(*sim, common, status);
  AddScansCommand(*sim, common, status);

  auto d = std::make_shared<DemoOptions>();
  CLI::App* demo = app.add_subcommand("demo", "The whole chain on the embedded simulated rig");
  demo->footer("Example: sole demo --out demo-out --seed 7\nEnds with OUT/report.html and OUT/summary.json.");
  demo->add_option("--out", d->out, "Directory for everything that is made")->required();
  demo->add_option("--seed", d->seed, "Subject and true rig")->capture_default_str();
  demo->add_option("--rig-seed", d->rig_seed, "True rig, so that several subjects step onto one; default: --seed");
  demo->add_option("--calibration", d->calibration,
                   "calibration.json of an earlier demo of the same rig seed, cameras and size, instead of a calibration take");
  demo->add_option("--motion", d->motion, sim::MotionList())->capture_default_str();
  demo->add_option("--frames", d->frames, "Triggers of the foot's take")->check(CLI::Range(1, 10000))->capture_default_str();
  demo->add_option("--poses", d->poses, "Poses of the calibration cube")->check(CLI::Range(6, 1000))->capture_default_str();
  demo->add_option("--cameras", d->cameras, "4, 8 or 20")->check(CLI::IsMember({4, 8, 20}))->capture_default_str();
  demo->add_option("--size", d->size, "Image size, WxH")->capture_default_str();
  demo->add_option("--noise", d->noise, "Scale of the sensor noise")->check(CLI::Range(0.0, 100.0))->capture_default_str();
  AddFaultOption(demo, d->faults);
  demo->add_option("--model", d->model, "Foot model; default: the shipped one");
  demo->callback([=, &common, &status] {
    const ThreadCap cap(common.threads);
    const nlohmann::json summary = RunDemo(*d);
    fmt::print("{}", common.json ? summary.dump(2) + "\n" : FormatSummary(summary));
    status = 0;
  });
}

}  // namespace sole::app
