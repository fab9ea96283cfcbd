#include <cmath>
#include <cstdio>
#include <functional>

#include "capture/camera_internal.h"

namespace sole::capture {
namespace {

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.10g", value);
  return text;
}

/// Writes settings one by one and keeps what came back.
class SettingWriter {
 public:
  explicit SettingWriter(ArvCamera* camera) : camera_(camera) {}

  bool Has(const char* feature) const {
    return arv_camera_is_feature_available(camera_, feature, nullptr) != FALSE;
  }

  void Value(const std::string& name, double wanted, double tolerance,
             const std::function<void(GError**)>& write,
             const std::function<double(GError**)>& read) {
    GErrorGuard error;
    CameraSetting setting{name, Number(wanted), "", false};
    write(error.Out());
    std::string failure = error.Failed() ? error.Message() : "";
    const double got = read(error.Out());
    if (failure.empty() && error.Failed()) failure = error.Message();
    setting.got = failure.empty() ? Number(got) : failure;
    setting.ok = failure.empty() && std::abs(got - wanted) <= tolerance;
    settings.push_back(setting);
  }

  void Text(const std::string& name, const std::string& wanted) {
    GErrorGuard error;
    CameraSetting setting{name, wanted, "", false};
    arv_camera_set_string(camera_, name.c_str(), wanted.c_str(), error.Out());
    ReadText(setting, error);
  }

  /// Reads a setting that an Aravis function has written as a part of something larger.
  void ReadText(CameraSetting setting, GErrorGuard& error) {
    std::string failure = error.Failed() ? error.Message() : "";
    const char* got = arv_camera_get_string(camera_, setting.name.c_str(), error.Out());
    if (failure.empty() && error.Failed()) failure = error.Message();
    setting.got = !failure.empty() ? failure : got == nullptr ? "" : got;
    setting.ok = failure.empty() && setting.got == setting.wanted;
    settings.push_back(setting);
  }

  void TextIfPresent(const std::string& name, const std::string& wanted) {
    if (Has(name.c_str()) &&
        arv_camera_is_enumeration_entry_available(camera_, name.c_str(), wanted.c_str(), nullptr)) {
      Text(name, wanted);
    }
  }

  void Integer(const char* name, std::int64_t wanted) {
    Value(
        name, static_cast<double>(wanted), 0,
        [&](GError** e) { arv_camera_set_integer(camera_, name, wanted, e); },
        [&](GError** e) { return static_cast<double>(arv_camera_get_integer(camera_, name, e)); });
  }

  std::vector<CameraSetting> settings;

 private:
  ArvCamera* camera_;
};

void WriteImageFormat(SettingWriter& writer, const CameraConfig& config) {
  writer.Text("PixelFormat", "Mono8");
  // Offsets are zero first, so that the region of an earlier session cannot forbid the size.
  for (const char* offset : {"OffsetX", "OffsetY"}) {
    if (writer.Has(offset)) writer.Integer(offset, 0);
  }
  writer.Integer("Width", config.width);
  writer.Integer("Height", config.height);
  if (config.offset_x != 0) writer.Integer("OffsetX", config.offset_x);
  if (config.offset_y != 0) writer.Integer("OffsetY", config.offset_y);
}

void WriteExposure(SettingWriter& writer, ArvCamera* camera, const CameraConfig& config) {
  writer.TextIfPresent("ExposureAuto", "Off");
  writer.TextIfPresent("GainAuto", "Off");
  writer.Value(
      "ExposureTime", config.exposure_us, 1 + 0.01 * config.exposure_us,
      [&](GError** e) { arv_camera_set_exposure_time(camera, config.exposure_us, e); },
      [&](GError** e) { return arv_camera_get_exposure_time(camera, e); });
  if (config.gain_db > 0 || arv_camera_is_gain_available(camera, nullptr)) {
    writer.Value(
        "Gain", config.gain_db, 0.11,
        [&](GError** e) { arv_camera_set_gain(camera, config.gain_db, e); },
        [&](GError** e) { return arv_camera_get_gain(camera, e); });
  }
}

void WritePackets(SettingWriter& writer, ArvCamera* camera, const CameraConfig& config) {
  writer.Value(
      "GevSCPSPacketSize", config.packet_size, 0,
      [&](GError** e) { arv_camera_gv_set_packet_size(camera, config.packet_size, e); },
      [&](GError** e) { return static_cast<double>(arv_camera_gv_get_packet_size(camera, e)); });
  if (config.packet_delay_ns > 0 || writer.Has("GevSCPD")) {
    GErrorGuard error;
    const auto ticks = arv_camera_get_integer(camera, "ArvGevTimestampTickFrequency", error.Out());
    const double tick_ns = ticks > 0 ? 1e9 / static_cast<double>(ticks) : 1;
    writer.Value(
        "GevSCPD", config.packet_delay_ns, tick_ns,
        [&](GError** e) { arv_camera_gv_set_packet_delay(camera, config.packet_delay_ns, e); },
        [&](GError** e) { return static_cast<double>(arv_camera_gv_get_packet_delay(camera, e)); });
  }
}

/// Keys of the action commands that this camera shall obey; the selector is the number in Action1.
void WriteAction(SettingWriter& writer, const TriggerInput& trigger) {
  writer.Integer("ActionDeviceKey", trigger.device_key);
  if (writer.Has("ActionSelector")) writer.Integer("ActionSelector", trigger.source.back() - '0');
  writer.Integer("ActionGroupKey", trigger.group_key);
  writer.Integer("ActionGroupMask", trigger.group_mask);
}

}  // namespace

std::vector<CameraSetting> WriteSettings(ArvCamera* camera, const CameraConfig& config,
                                         const TriggerInput& trigger) {
  SettingWriter writer(camera);
  WriteImageFormat(writer, config);
  WriteExposure(writer, camera, config);
  WritePackets(writer, camera, config);
  writer.TextIfPresent("AcquisitionMode", "Continuous");
  if (trigger.source.starts_with("Action")) WriteAction(writer, trigger);
  // The trigger comes last: some cameras disarm it when rates or sizes change.
  GErrorGuard error;
  arv_camera_set_trigger(camera, trigger.source.c_str(), error.Out());
  writer.ReadText({"TriggerSource", trigger.source, "", false}, error);
  writer.ReadText({"TriggerMode", "On", "", false}, error);
  return writer.settings;
}

}  // namespace sole::capture
