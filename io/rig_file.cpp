#include "io/rig_file.h"

#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/shown_internal.h"
#include "io/toml_table_internal.h"

namespace sole::io {
namespace {

constexpr int kVersion = 1;
constexpr double kTiny = std::numeric_limits<double>::denorm_min();  ///< lower bound of "positive"
constexpr double kHuge = std::numeric_limits<double>::max();
constexpr Range kPositive{kTiny, kHuge}, kAny{-kHuge, kHuge};
constexpr Range kSide{64, 16384};
constexpr Range kSeconds{0, 3600};

CameraConfig ReadCamera(TomlTable table) {
  CameraConfig camera;
  table.Read("serial", camera.serial);
  table.Read("role", camera.role);
  table.Read("address", camera.address);
  table.Read("width", camera.width, kSide);
  table.Read("height", camera.height, kSide);
  table.Read("offset_x", camera.offset_x, {0, kSide.high});
  table.Read("offset_y", camera.offset_y, {0, kSide.high});
  table.Read("focal_px", camera.focal_px, kPositive);
  table.Read("position_m", camera.position_m);
  table.Read("look_at_m", camera.look_at_m);
  table.Read("up", camera.up);
  table.Read("aperture_m", camera.aperture_m, {0, 0.1});
  table.Read("exposure_us", camera.exposure_us, kPositive);
  table.Read("gain_db", camera.gain_db, {-100, 100});
  table.Read("packet_size", camera.packet_size, {576, 65500});
  table.Read("packet_delay_ns", camera.packet_delay_ns, {0, std::numeric_limits<int>::max()});
  table.Finish();
  if (camera.serial.empty()) table.Fail("serial", "is missing: every camera needs one");
  const bool clean = Shown(camera.serial) == camera.serial && camera.serial.size() <= 43 &&
                     camera.serial.find_first_of("/\\") == std::string::npos;
  if (!clean || camera.serial[0] == '.') {
    table.Fail("serial", "names files: at most 43 characters, no slash and no leading dot");
  }
  const Eigen::Vector3d view = camera.look_at_m - camera.position_m;
  if (!(view.norm() > 1e-3)) table.Fail("position_m", "equals look_at_m: the camera looks nowhere");
  if (!(view.normalized().cross(camera.up).norm() > 1e-6))
    table.Fail("up", "is parallel to the viewing direction");
  return camera;
}

void ReadCameras(TomlTable& top, RigConfig& config) {
  std::set<std::string> serials;
  for (const TomlTable& table : top.Tables("camera")) {
    config.cameras.push_back(ReadCamera(table));
    if (!serials.insert(config.cameras.back().serial).second) table.Fail("serial", "appears twice");
  }
  if (config.cameras.empty()) throw Error(top.At("camera") + "a rig needs at least one [[camera]]");
  for (TomlTable& table : top.Tables("pair")) {
    PairConfig pair;
    table.Read("name", pair.name);
    table.Read("left", pair.left);
    table.Read("right", pair.right);
    table.Finish();
    if (!serials.contains(pair.left))
      table.Fail("left", "names no camera: there is no serial '" + Shown(pair.left) + "'");
    if (!serials.contains(pair.right))
      table.Fail("right", "names no camera: there is no serial '" + Shown(pair.right) + "'");
    if (pair.left == pair.right) table.Fail("right", "names the same camera as left");
    config.pairs.push_back(pair);
  }
}

void ReadExposures(TomlTable& table, std::vector<ExposureKind>& exposures) {
  if (!table.Has("exposures")) return;
  std::vector<std::string> names;
  table.Read("exposures", names);
  if (names.empty()) table.Fail("exposures", "is empty: name at least one of speckle, texture");
  exposures.clear();
  for (const std::string& name : names) {
    if (name != "speckle" && name != "texture") {
      table.Fail("exposures", "holds '" + Shown(name) + "': use speckle and texture");
    }
    exposures.push_back(ExposureKindFromString(name));
  }
}

void ReadTrigger(TomlTable& top, TriggerConfig& trigger) {
  for (TomlTable& table : top.Table("trigger")) {
    table.Read("source", trigger.source);
    table.Read("rate_hz", trigger.rate_hz, {kTiny, 1000});
    ReadExposures(table, trigger.exposures);
    table.Read("exposure_gap_s", trigger.exposure_gap_s, kSeconds);
    table.Read("warmup", trigger.warmup, {0, 1000});
    table.Read("pre_roll_s", trigger.pre_roll_s, kSeconds);
    table.Read("post_roll_s", trigger.post_roll_s, kSeconds);
    table.Read("gpio_chip", trigger.gpio_chip);
    table.ReadNameOrNumber("gpio_line", trigger.gpio_line);
    table.ReadNameOrNumber("readback_line", trigger.readback_line);
    table.Read("pulse_us", trigger.pulse_us, {1, 1e6});
    for (TomlTable& item : table.Tables("strobe")) {
      StrobeConfig strobe;
      item.Read("name", strobe.name);
      item.ReadNameOrNumber("line", strobe.line);
      ReadExposures(item, strobe.exposures);
      item.Finish();
      if (strobe.line.empty()) item.Fail("line", "is missing: the strobe needs a GPIO line");
      trigger.strobes.push_back(strobe);
    }
    table.Read("action_address", trigger.action_address);
    table.Read("action_device_key", trigger.action_device_key);
    table.Read("action_group_key", trigger.action_group_key);
    table.Read("action_group_mask", trigger.action_group_mask);
    table.Read("bus_port", trigger.bus_port, {1, 65535});
    table.Finish();
    if (trigger.source != "simulated" && trigger.source != "gpio" && trigger.source != "action" &&
        trigger.source != "software") {
      table.Fail("source",
                 "is '" + Shown(trigger.source) + "': use simulated, gpio, action or software");
    }
  }
}

void ReadDisk(TomlTable& top, DiskConfig& disk) {
  for (TomlTable& table : top.Table("disk")) {
    table.Read("reserve_mb", disk.reserve_mb, {0, 1e9});
    table.Read("max_share", disk.max_share, {0.01, 1});
    table.Read("write_test_mb", disk.write_test_mb, {0, 1e5});
    table.Finish();
  }
}

void ReadPlate(TomlTable& top, PlateConfig& plate) {
  for (TomlTable& table : top.Table("plate")) {
    table.Read("size_x_m", plate.size_x_m, kPositive);
    table.Read("size_y_m", plate.size_y_m, kPositive);
    table.Read("thickness_m", plate.thickness_m, {kTiny, std::nextafter(0.1, 0.0)});
    table.Read("index", plate.index, {1, std::nextafter(3.0, 0.0)});
    std::set<int> ids;
    for (TomlTable& item : table.Tables("fiducial")) {
      Fiducial fiducial;
      item.Read("id", fiducial.id, {0, 249});
      item.Read("centre_m", fiducial.centre_m);
      item.Read("size_m", fiducial.size_m, kPositive);
      item.Finish();
      for (const char* key : {"id", "centre_m", "size_m"}) {
        if (!item.Has(key)) item.Fail(key, "is missing");
      }
      if (!ids.insert(fiducial.id).second) item.Fail("id", "appears twice");
      plate.fiducials.push_back(fiducial);
    }
    table.Finish();
  }
}

void ReadTarget(TomlTable& top, TargetConfig& target) {
  for (TomlTable& table : top.Table("target")) {
    table.Read("edge_m", target.edge_m, kPositive);
    table.Read("squares", target.squares, {3, 22});
    table.Read("square_m", target.square_m, kPositive);
    table.Read("marker_m", target.marker_m, kPositive);
    table.Finish();
    if (target.marker_m >= target.square_m) table.Fail("marker_m", "must be smaller than square_m");
    if (target.squares * target.square_m > target.edge_m)
      table.Fail("square_m", "times squares is longer than edge_m");
  }
}

void ReadSheet(TomlTable& top, SheetConfig& sheet) {
  for (TomlTable& table : top.Table("sheet")) {
    table.Read("size_x_m", sheet.size_x_m, kPositive);
    table.Read("size_y_m", sheet.size_y_m, kPositive);
    table.Read("thickness_m", sheet.thickness_m, {0, 0.01});
    table.Finish();
  }
}

FaultConfig ReadFault(TomlTable table) {
  std::string name, camera, unit;
  int trigger = 0;
  double amount = 0;
  table.Read("name", name);
  table.Read("camera", camera);
  table.Read("trigger", trigger, {1, std::numeric_limits<int>::max()});
  table.Read("amount", amount, kAny);
  table.Read("unit", unit);
  table.Finish();
  try {
    return MakeFault(name, camera, table.Has("amount") ? std::optional(amount) : std::nullopt, unit,
                     table.Has("trigger") ? std::optional<std::int64_t>(trigger) : std::nullopt);
  } catch (const Error& error) {
    throw Error(table.At("name") + error.what());
  }
}

void ReadSimulation(TomlTable& top, SimulationConfig& simulation) {
  for (TomlTable& table : top.Table("simulation")) {
    table.Read("noise", simulation.noise, {0, 1000});
    table.Read("ambient_light", simulation.ambient_light, {0, 100});
    table.Read("trigger_jitter_us", simulation.trigger_jitter_us, {0, 1e6});
    table.Read("plate_sag", simulation.plate_sag);
    for (TomlTable& item : table.Tables("projector")) {
      ProjectorConfig projector;
      item.Read("position_m", projector.position_m);
      item.Read("look_at_m", projector.look_at_m);
      item.Finish();
      if (!((projector.look_at_m - projector.position_m).norm() > 1e-3)) {
        item.Fail("position_m", "equals look_at_m: the projector points nowhere");
      }
      simulation.projectors.push_back(projector);
    }
    for (const TomlTable& item : table.Tables("fault")) simulation.faults.push_back(ReadFault(item));
    table.Finish();
  }
}

/// A TOML basic string.
std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\')
      (quoted += '\\') += c;
    else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
      quoted += fmt::format("\\u{:04x}", static_cast<int>(c));
    else
      quoted += c;
  }
  return quoted + '"';
}

/// Shortest text that reads back to the same number, always with a point or an exponent: TOML would
/// take
/// "-0" for an integer and lose its sign.
std::string Float(double value) {
  const std::string text = fmt::format("{}", value);
  return text.find_first_of(".en") == std::string::npos ? text + ".0" : text;
}

template <typename Vector>
std::string Listed(const Vector& v) {
  std::string text;
  for (Eigen::Index i = 0; i < v.size(); ++i) text += (i == 0 ? "" : ", ") + Float(v[i]);
  return "[" + text + "]";
}

std::string Listed(const std::vector<ExposureKind>& kinds) {
  std::string text;
  for (const ExposureKind kind : kinds) text += (text.empty() ? "" : ", ") + Quoted(ToString(kind));
  return "[" + text + "]";
}

/// "key = value" line by line; the values are TOML already.
using Keys = std::vector<std::pair<const char*, std::string>>;
std::string Lines(const Keys& keys) {
  std::string text;
  for (const auto& [key, value] : keys) text += fmt::format("{} = {}\n", key, value);
  return text;
}

std::string FormatCamera(const CameraConfig& c) {
  return "\n[[camera]]\n" + Lines({{"serial", Quoted(c.serial)},
                                   {"role", Quoted(c.role)},
                                   {"address", Quoted(c.address)},
                                   {"width", std::to_string(c.width)},
                                   {"height", std::to_string(c.height)},
                                   {"offset_x", std::to_string(c.offset_x)},
                                   {"offset_y", std::to_string(c.offset_y)},
                                   {"focal_px", Float(c.focal_px)},
                                   {"position_m", Listed(c.position_m)},
                                   {"look_at_m", Listed(c.look_at_m)},
                                   {"up", Listed(c.up)},
                                   {"aperture_m", Float(c.aperture_m)},
                                   {"exposure_us", Float(c.exposure_us)},
                                   {"gain_db", Float(c.gain_db)},
                                   {"packet_size", std::to_string(c.packet_size)},
                                   {"packet_delay_ns", std::to_string(c.packet_delay_ns)}});
}

std::string FormatTrigger(const TriggerConfig& t) {
  std::string text = "\n[trigger]\n" + Lines({{"source", Quoted(t.source)},
                                              {"rate_hz", Float(t.rate_hz)},
                                              {"exposures", Listed(t.exposures)},
                                              {"exposure_gap_s", Float(t.exposure_gap_s)},
                                              {"warmup", std::to_string(t.warmup)},
                                              {"pre_roll_s", Float(t.pre_roll_s)},
                                              {"post_roll_s", Float(t.post_roll_s)},
                                              {"gpio_chip", Quoted(t.gpio_chip)},
                                              {"gpio_line", Quoted(t.gpio_line)},
                                              {"readback_line", Quoted(t.readback_line)},
                                              {"pulse_us", Float(t.pulse_us)},
                                              {"action_address", Quoted(t.action_address)},
                                              {"action_device_key", std::to_string(t.action_device_key)},
                                              {"action_group_key", std::to_string(t.action_group_key)},
                                              {"action_group_mask", std::to_string(t.action_group_mask)},
                                              {"bus_port", std::to_string(t.bus_port)}});
  for (const StrobeConfig& strobe : t.strobes) {
    text += "\n[[trigger.strobe]]\n" + Lines({{"name", Quoted(strobe.name)},
                                              {"line", Quoted(strobe.line)},
                                              {"exposures", Listed(strobe.exposures)}});
  }
  return text;
}

}  // namespace

RigConfig ParseRig(const std::string& toml, const std::string& name) {
  const toml::table parsed = ParseToml(toml, name);
  TomlTable top(parsed, name, "");
  RigConfig config;
  int version = kVersion;
  top.Read("format_version", version, {kVersion, kVersion});
  top.Read("name", config.name);
  ReadTrigger(top, config.trigger);
  ReadDisk(top, config.disk);
  ReadPlate(top, config.plate);
  ReadTarget(top, config.target);
  ReadSheet(top, config.sheet);
  ReadCameras(top, config);
  ReadSimulation(top, config.simulation);
  top.Finish();
  try {
    Validate(config);
  } catch (const Error& error) {
    throw Error(name + ": " + error.what());
  }
  return config;
}

RigConfig ReadRigFile(const std::filesystem::path& path) {
  return ParseRig(ReadFile(path), path.string());
}

std::string FormatRig(const RigConfig& config) {
  const PlateConfig& plate = config.plate;
  const TargetConfig& target = config.target;
  std::string text = fmt::format(
      "# Rig of Sole. Units stand in the names: _m metres, _px pixels, _us microseconds. "
      "docs/formats.md has every key.\n"
      "format_version = {}\nname = {}\n",
      kVersion, Quoted(config.name));
  text += FormatTrigger(config.trigger);
  text += "\n[disk]\n" + Lines({{"reserve_mb", Float(config.disk.reserve_mb)},
                                {"max_share", Float(config.disk.max_share)},
                                {"write_test_mb", Float(config.disk.write_test_mb)}});
  text += fmt::format("\n[plate]\nsize_x_m = {}\nsize_y_m = {}\nthickness_m = {}\nindex = {}\n",
                      Float(plate.size_x_m), Float(plate.size_y_m), Float(plate.thickness_m),
                      Float(plate.index));
  for (const Fiducial& f : plate.fiducials) {
    text += fmt::format("\n[[plate.fiducial]]\nid = {}\ncentre_m = {}\nsize_m = {}\n", f.id,
                        Listed(f.centre_m), Float(f.size_m));
  }
  text += fmt::format("\n[target]\nedge_m = {}\nsquares = {}\nsquare_m = {}\nmarker_m = {}\n",
                      Float(target.edge_m), target.squares, Float(target.square_m),
                      Float(target.marker_m));
  text += "\n[sheet]\n" + Lines({{"size_x_m", Float(config.sheet.size_x_m)},
                                 {"size_y_m", Float(config.sheet.size_y_m)},
                                 {"thickness_m", Float(config.sheet.thickness_m)}});
  for (const CameraConfig& camera : config.cameras) text += FormatCamera(camera);
  for (const PairConfig& pair : config.pairs) {
    text += fmt::format("\n[[pair]]\nname = {}\nleft = {}\nright = {}\n", Quoted(pair.name),
                        Quoted(pair.left), Quoted(pair.right));
  }
  text += fmt::format("\n[simulation]\nnoise = {}\nambient_light = {}\ntrigger_jitter_us = {}\nplate_sag = {}\n",
                      Float(config.simulation.noise), Float(config.simulation.ambient_light),
                      Float(config.simulation.trigger_jitter_us), config.simulation.plate_sag);
  for (const ProjectorConfig& p : config.simulation.projectors) {
    text += fmt::format("\n[[simulation.projector]]\nposition_m = {}\nlook_at_m = {}\n",
                        Listed(p.position_m), Listed(p.look_at_m));
  }
  for (const FaultConfig& f : config.simulation.faults) {
    text += fmt::format(
        "\n[[simulation.fault]]\nname = {}\ncamera = {}\ntrigger = {}\namount = {}\nunit = {}\n",
        Quoted(f.name), Quoted(f.camera), f.trigger, Float(f.amount), Quoted(f.unit));
  }
  return text;
}

void WriteRigFile(const std::filesystem::path& path, const RigConfig& config) {
  WriteStringAtomically(path, FormatRig(config));
}

}  // namespace sole::io
