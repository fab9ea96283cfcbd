#include "app/simulation.h"

#include <algorithm>
#include <chrono>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "app/console.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/raw_file.h"
#include "io/rig_file.h"
#include "io/take.h"
#include "sim/faults.h"
#include "sim/motion.h"
#include "sim/truth_maps.h"
#include "sim/visibility.h"

namespace sole::app {
namespace {

sim::RenderOptions OptionsFor(const RigConfig& config, std::uint64_t seed) {
  sim::RenderOptions options;
  options.noise = config.simulation.noise;
  options.ambient_light = config.simulation.ambient_light;
  options.trigger_jitter_s = 1e-6 * config.simulation.trigger_jitter_us;
  options.seed = seed;
  return options;
}

sim::Scene SceneOf(const sim::MotionFrame& frame, const std::vector<Eigen::Vector3i>& triangles) {
  sim::SceneMesh foot;
  foot.mesh = {frame.foot.foot.vertices_m, triangles};
  foot.material = sim::ReferenceFoot().vertices;
  for (const sim::FootMaterial material : sim::FootMaterials()) {
    foot.tone.push_back(material == sim::FootMaterial::kNail ? 1.15f : material == sim::FootMaterial::kCut ? 0.1f : 1.0f);
  }
  sim::Scene scene;
  scene.sag = frame.foot.sag;
  scene.meshes.push_back(std::move(foot));
  return scene;
}

sim::TruthFrame TruthOf(const sim::MotionFrame& frame, const std::vector<Eigen::Vector3i>& triangles) {
  const sim::LoadedFoot& foot = frame.foot;
  sim::TruthFrame truth;
  truth.mesh = {foot.foot.vertices_m, triangles};
  truth.contact = foot.contact;
  truth.pressure_pa = foot.pressure_pa;
  truth.penetration_m = foot.penetration_m;
  truth.load_n = foot.total_load_n;
  truth.plate_sag = foot.sag;
  truth.world_from_bone = foot.foot.world_from_rest;
  return truth;
}

/// Velocity of every vertex from its place `later_s` on.
std::vector<Eigen::Vector3d> Velocities(const sim::MotionFrame& now, const sim::MotionFrame& later, double later_s) {
  std::vector<Eigen::Vector3d> velocities;
  for (std::size_t v = 0; v < now.foot.foot.vertices_m.size(); ++v) {
    velocities.push_back((later.foot.foot.vertices_m[v] - now.foot.foot.vertices_m[v]) / later_s);
  }
  return velocities;
}

sim::PlateModel BendingPlate(const sim::TruePlate& plate) {
  return {.size_x_m = plate.size_x_m, .size_y_m = plate.size_y_m, .thickness_m = plate.thickness_m};
}

/// Measures of the subject standing at half body weight, as the survey took them.
std::map<std::string, double> HalfWeightMeasures(const sim::Subject& subject) {
  const sim::LoadedFoot standing = sim::StandOnPlate(subject, 0.5 * 9.81 * subject.weight_kg);
  return sim::MeasureFoot(standing.foot.vertices_m, subject.side);
}

}  // namespace

Simulation::Simulation(const RigConfig& config, std::uint64_t rig_seed, std::uint64_t seed)
    : config_(config),
      rig_seed_(rig_seed),
      seed_(seed),
      renderer_(config, sim::DrawTrueRig(config, rig_seed), OptionsFor(config, rig_seed)),
      subject_(sim::DrawSubject(seed)) {}

void Simulation::SetFaults(const std::vector<FaultConfig>& faults) {
  config_.simulation.faults = faults;
  faulty_.reset();
  faults_shown_ = 0;
}

const sim::Renderer& Simulation::RendererAt(std::int64_t trigger) {
  const std::vector<FaultConfig> active = sim::ImageFaultsAt(config_.simulation.faults, trigger);
  // Faults come and stay, or a new take begins with fewer: equal counts are equal faults.
  if (active.size() != faults_shown_) {
    faults_shown_ = active.size();
    faulty_.reset();
    if (!active.empty()) {
      faulty_ = std::make_unique<sim::Renderer>(config_, sim::ApplyFaults(renderer_.Rig(), active),
                                                sim::ApplyFaults(OptionsFor(config_, rig_seed_), active));
    }
  }
  return faulty_ ? *faulty_ : renderer_;
}

void Simulation::WriteTruth(const std::filesystem::path& directory) const {
  const io::TakePaths take{directory};
  sim::WriteTruthRig(take.TruthRig(), faulty_ ? faulty_->Rig() : renderer_.Rig());
  if (!truth_.frames.empty()) sim::WriteTruth(take, truth_);
}

sim::PreparedScene Simulation::AppendSet(const sim::Scene& scene, std::uint64_t seed, RenderedTake& take) {
  const sim::Renderer& renderer = RendererAt(static_cast<std::int64_t>(take.sets.size()) + 1);
  sim::PreparedScene prepared = renderer.Prepare(scene);
  std::vector<ImageU8>& set = take.sets.emplace_back();
  for (int c = 0; c < static_cast<int>(config_.cameras.size()); ++c) {
    set.push_back(renderer.Render(prepared, c, seed + 1000 * take.sets.size()));
  }
  return prepared;
}

RenderedTake Simulation::RenderCalibration(int poses) {
  RenderedTake take;
  take.kind = ExposureKind::kTexture;
  Progress progress("render calibration", poses);
  for (const Rigid3& pose : sim::CalibrationPoses(poses, config_.target.edge_m, seed_)) {
    sim::Scene scene;
    scene.world_from_target = pose;
    scene.exposure = ExposureKind::kTexture;
    AppendSet(scene, seed_, take);
    progress.Set(static_cast<int>(take.sets.size()));
  }
  return take;
}

RenderedTake Simulation::RenderContactSheet(int times) {
  RenderedTake take;
  take.kind = ExposureKind::kTexture;
  take.notes = "contact sheet";
  Progress progress("render contact sheet", times);
  for (sim::ContactSheet sheet : sim::SheetPlaces(times, seed_)) {
    sheet.size_x_m = config_.sheet.size_x_m;
    sheet.size_y_m = config_.sheet.size_y_m;
    sheet.thickness_m = config_.sheet.thickness_m;
    sim::Scene scene;
    scene.sheet = sheet;
    scene.exposure = ExposureKind::kTexture;
    AppendSet(scene, seed_ + 2000000, take);
    progress.Set(static_cast<int>(take.sets.size()));
  }
  return take;
}

RenderedTake Simulation::RenderMotion(const std::string& motion, int frames, const std::filesystem::path& maps) {
  sim::MotionOptions options;
  options.motion = motion;
  options.frames = frames;
  options.rate_hz = config_.trigger.rate_hz;
  options.seed = seed_;
  if (config_.simulation.plate_sag) options.plate = BendingPlate(renderer_.Rig().plate);
  const sim::FootMotion motion_frames = sim::MakeMotion(subject_, options);
  // A frame shows the foot in the middle of the exposure; where it is at the end tells its velocity.
  double half_s = 0;
  for (const CameraConfig& camera : config_.cameras) half_s = std::max(half_s, 0.5e-6 * camera.exposure_us);
  options.start_s = half_s;
  const sim::FootMotion later_frames = sim::MakeMotion(subject_, options);
  truth_ = {};
  truth_.side = subject_.side;
  for (const PairConfig& pair : config_.pairs) truth_.pairs.push_back(pair.name);
  for (const sim::BoneInfo& bone : sim::Bones(subject_)) truth_.bones.push_back(bone.name);
  truth_.measures_mm = HalfWeightMeasures(subject_);
  RenderedTake take;
  Progress progress("render feet", frames);
  for (std::size_t i = 0; i < motion_frames.frames.size(); ++i) {
    const sim::MotionFrame& frame = motion_frames.frames[i];
    sim::Scene scene = SceneOf(frame, motion_frames.triangles);
    scene.meshes[0].velocity = Velocities(frame, later_frames.frames[i], half_s);
    const sim::PreparedScene prepared = AppendSet(scene, seed_ + 1000000, take);
    const auto trigger = static_cast<std::int64_t>(take.sets.size());
    const sim::Renderer& renderer = RendererAt(trigger);
    sim::TruthFrame truth = TruthOf(frame, motion_frames.triangles);
    truth.trigger = trigger;
    truth.visible = sim::VisibleToPairs(renderer, prepared, 0, config_.pairs);
    truth_.frames.push_back(std::move(truth));
    for (int c = 0; !maps.empty() && c < static_cast<int>(config_.cameras.size()); ++c) {
      sim::WriteTruthMaps(io::TakePaths{maps}.TruthMaps(config_.cameras[static_cast<std::size_t>(c)].serial, trigger),
                          sim::MapTruth(renderer, prepared, c, sim::PartnersOf(config_, c)));
    }
    progress.Set(static_cast<int>(trigger));
  }
  return take;
}

sim::CameraServer ServeRendered(const RigConfig& config, const RenderedTake& rendered) {
  Require(!rendered.sets.empty(), "nothing was rendered to serve");
  std::vector<sim::ServedCamera> cameras;
  for (const CameraConfig& camera : config.cameras) {
    Require(!camera.address.empty(), "camera " + camera.serial +
                                         " has no address in the rig file: simulated cameras need one, such as 127.0.0.11");
    cameras.push_back({camera.serial, camera.address, camera.width, camera.height, camera.exposure_us, camera.gain_db});
  }
  sim::CameraServerOptions options;
  options.schedule = config.simulation.faults;
  return {cameras, config.trigger.bus_port, [&rendered](int camera, const TriggerPulse& pulse) -> const ImageU8& {
            const auto count = static_cast<std::int64_t>(rendered.sets.size());
            const std::int64_t set = pulse.sequence <= 0 ? 0 : (pulse.sequence - 1) % count;
            return rendered.sets[static_cast<std::size_t>(set)][static_cast<std::size_t>(camera)];
          },
          options};
}

capture::RecordResult RecordRendered(const RigConfig& config, const RenderedTake& rendered,
                                     capture::RecordOptions options) {
  const sim::CameraServer server = ServeRendered(config, rendered);
  options.triggers = static_cast<std::int64_t>(rendered.sets.size());
  options.cycle = {rendered.kind};
  options.software = Version();
  options.log = Log;
  return capture::Record(config, options);
}

void RequireNoTake(const std::filesystem::path& directory) {
  Require(!std::filesystem::exists(io::TakePaths{directory}.Info()),
          directory.string() + " already holds a take: choose another directory");
}

void WriteRendered(const RigConfig& config, const RenderedTake& rendered, const std::filesystem::path& directory) {
  const io::TakePaths take{directory};
  RequireNoTake(directory);
  io::MakeDirectory(directory / "cameras");
  io::TakeInfo info;
  info.name = directory.filename().string();
  info.subject = "simulated";
  info.notes = rendered.notes;
  info.created = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  info.software = Version();
  info.rig_hash = RigIdentityHash(config);
  io::WriteRigFile(take.RigFile(), config);
  std::vector<io::TriggerRecord> triggers;
  for (std::size_t t = 0; t < rendered.sets.size(); ++t) {
    const double at = static_cast<double>(t) / config.trigger.rate_hz;
    const double exposure = 1e-6 * config.cameras.front().exposure_us;
    triggers.push_back({static_cast<std::int64_t>(t) + 1, rendered.kind, at, at, at, at + exposure});
  }
  io::WriteTriggers(take, triggers);
  for (std::size_t c = 0; c < config.cameras.size(); ++c) {
    io::RawFileWriter writer(take.Raw(config.cameras[c].serial), config.cameras[c].serial);
    for (std::size_t t = 0; t < rendered.sets.size(); ++t) {
      const ImageU8& image = rendered.sets[t][c];
      io::RawRecordHeader header;
      header.trigger = triggers[t].trigger;
      header.frame_id = t + 1;
      header.device_time_ns = static_cast<std::uint64_t>(1e9 * triggers[t].actual_s);
      header.host_time_ns = static_cast<std::int64_t>(header.device_time_ns);
      header.width = static_cast<std::uint32_t>(image.width);
      header.height = static_cast<std::uint32_t>(image.height);
      header.kind = rendered.kind;
      writer.Append(header, image.pixels.data());
    }
    writer.Close();
  }
  info.state = "complete";
  info.verdict = "good";
  io::WriteTakeInfo(take, info);
}

}  // namespace sole::app
