#include "app/demo.h"

#include <cstdio>

#include <fmt/format.h>

#include "app/console.h"
#include "app/evaluate.h"
#include "app/report.h"
#include "app/simulation.h"
#include "app/stages.h"
#include "app/take_list.h"
#include "calib/calibrate.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/calibration_file.h"
#include "io/rig_file.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;

/// Removes an earlier demo's take, and nothing that is not one.
void RemoveTake(const fs::path& take) {
  if (!fs::exists(take)) return;
  Require(fs::exists(take / "take.json"), take.string() + " is in the way and is no take: choose another --out");
  fs::remove_all(take);
}

RigConfig ConfigFor(const DemoOptions& options) {
  int width = 0, height = 0;
  char rest = 0;
  Require(std::sscanf(options.size.c_str(), "%dx%d%c", &width, &height, &rest) == 2,
          "--size '" + options.size + "': give width and height such as 1624x1236");
  RigConfig config = MakeDefaultRig(options.cameras, width, height);
  config.simulation.noise = options.noise;
  Validate(config);
  return config;
}

void RecordInto(const RigConfig& config, const RenderedTake& rendered, const fs::path& take) {
  capture::RecordOptions record;
  record.directory = take;
  record.subject = "simulated";
  const capture::RecordResult result = RecordRendered(config, rendered, record);
  Log(fmt::format("recorded {}: {} of {} frames, verdict {}", take.string(), result.FramesGood(),
                  result.FramesExpected(), result.verdict));
}

Calibration CalibrateTake(const RigConfig& config, const fs::path& take) {
  Log("calibrate");
  TakeList takes({take});
  Calibration calibration = calib::Calibrate(config, takes);
  for (const std::string& failure : calibration.stats.failures)  // `sole calibrate` would refuse it
    Log("calibration FAILS: " + failure);
  return calibration;
}

}  // namespace

nlohmann::json RunDemo(const DemoOptions& options) {
  const Stopwatch watch;
  const RigConfig config = ConfigFor(options);
  RigConfig faulty = config;  // the foot's take; the calibration is a good one
  for (const std::string& fault : options.faults) faulty.simulation.faults.push_back(ParseFault(fault));
  Validate(faulty);
  const fs::path model_path = options.model.empty() ? DefaultModelPath() : options.model;
  const ModelPair models = LoadModelPair(model_path);  // before the long work, so that a bad path fails at once
  Calibration calibration;
  if (!options.calibration.empty()) {
    calibration = io::ReadCalibration(options.calibration);
    Require(calibration.rig.rig_hash == RigIdentityHash(config),
            options.calibration.string() +
                " was made for another rig: give --cameras and --size as in the demo that made it");
  }
  io::MakeDirectory(options.out);
  const fs::path calibration_take = options.out / "calibration", take = options.out / "take";
  const fs::path calibration_file = options.out / "calibration.json";
  RemoveTake(calibration_take);
  RemoveTake(take);
  io::WriteRigFile(options.out / "rig.toml", config);

  Simulation simulation(config, options.rig_seed ? options.rig_seed : options.seed, options.seed);
  if (options.calibration.empty()) {
    RecordInto(config, simulation.RenderCalibration(options.poses), calibration_take);
    io::WriteCalibration(calibration_file, CalibrateTake(config, calibration_take));
  } else {
    io::WriteCalibration(calibration_file, calibration);
  }
  simulation.SetFaults(faulty.simulation.faults);
  RecordInto(faulty, simulation.RenderMotion(options.motion, options.frames), take);
  simulation.WriteTruth(take);
  RunProcess(take, calibration_file, model_path);

  nlohmann::json summary = EvaluateTake(take, models.right);
  summary["total_seconds"] = watch.Seconds();
  io::WriteStringAtomically(options.out / "summary.json", summary.dump(2) + "\n");
  WriteReport(options.out / "report.html", take, models, summary);
  Log(fmt::format("report: {}", (options.out / "report.html").string()));
  return summary;
}

}  // namespace sole::app
