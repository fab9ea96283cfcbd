#include "capture/rig_draft.h"

#include <algorithm>
#include <cmath>

#include "capture/camera_internal.h"
#include "capture/discovery.h"

namespace sole::capture {
namespace {

constexpr int kLoopbackPacket = 9000;

/// The line, action or software trigger that this camera offers, best first.
std::string SourceOf(ArvCamera* camera, const FoundCamera& found) {
  const auto offers = [&](const char* source) {
    return arv_camera_is_enumeration_entry_available(camera, "TriggerSource", source, nullptr) !=
           FALSE;
  };
  if (offers("Line1")) return found.vendor == "Sole" ? "simulated" : "gpio";
  if (offers("Action1")) return "action";
  return "software";
}

CameraConfig ReadCamera(ArvCamera* camera, const FoundCamera& found) {
  CameraConfig config;
  config.serial = found.serial;
  if (found.address.starts_with("127.")) config.address = found.address;
  int width = 0, height = 0;
  GErrorGuard error;
  arv_camera_get_sensor_size(camera, &width, &height, error.Out());
  error.Check("camera " + found.serial + " does not tell its sensor size");
  int low = 0, high = 0;
  arv_camera_get_width_bounds(camera, &low, &high, nullptr);
  config.width = high > 0 ? std::min(width, high) : width;
  low = high = 0;
  arv_camera_get_height_bounds(camera, &low, &high, nullptr);
  config.height = high > 0 ? std::min(height, high) : height;
  config.focal_px = 2.0 * config.width;
  const double exposure_us = arv_camera_get_exposure_time(camera, error.Out());
  if (!error.Failed() && exposure_us > 0) config.exposure_us = exposure_us;
  if (arv_camera_is_gain_available(camera, nullptr)) {
    const double gain_db = arv_camera_get_gain(camera, error.Out());
    if (!error.Failed() && std::isfinite(gain_db)) config.gain_db = gain_db;
  }
  config.packet_size = kLoopbackPacket;
  if (!found.address.starts_with("127.")) {
    const int packet = static_cast<int>(arv_camera_gv_get_packet_size(camera, error.Out()));
    if (!error.Failed() && packet >= 576) config.packet_size = packet;
  }
  return config;
}

std::vector<FoundCamera> Choose(const RigDraftOptions& options) {
  const std::vector<FoundCamera> found = ListCameras();
  Require(!found.empty(),
          "no camera answers: are they powered and connected, is the network interface up, is "
          "`sole sim serve` running?");
  if (options.serials.empty()) return found;
  std::vector<FoundCamera> chosen;
  for (const std::string& serial : options.serials) {
    const auto camera = std::find_if(found.begin(), found.end(),
                                     [&](const FoundCamera& f) { return f.serial == serial; });
    Require(camera != found.end(),
            "camera " + serial + " does not answer: cameras found: " + Describe(found));
    chosen.push_back(*camera);
  }
  return chosen;
}

void Place(RigConfig& config) {
  for (std::size_t i = 0; i < config.cameras.size(); ++i) {
    CameraConfig& camera = config.cameras[i];
    camera.position_m = {i % 2 == 0 ? -0.06 : 0.06, 0.1 * static_cast<double>(i / 2), -0.66};
    camera.look_at_m = {0, 0.1 * static_cast<double>(i / 2), 0};
    camera.up = Eigen::Vector3d::UnitY();
    if (i % 2 == 0) continue;
    const std::string name = "pair " + std::to_string(i / 2 + 1);
    config.pairs.push_back({name, config.cameras[i - 1].serial, camera.serial});
  }
}

}  // namespace

RigDraft DraftRig(const RigDraftOptions& options) {
  RigDraft draft;
  draft.config.name = "rig";
  std::vector<std::string> sources;
  for (const FoundCamera& found : Choose(options)) {
    GErrorGuard error;
    const GObjectPtr<ArvCamera> camera(arv_camera_new(found.id.c_str(), error.Out()));
    try {
      error.Check("camera " + found.serial + " does not open");
      Require(camera != nullptr, "camera " + found.serial + " does not open");
      Require(ARV_IS_GV_DEVICE(arv_camera_get_device(camera.get())),
              "camera " + found.serial + " is not a GigE Vision camera: left out");
      draft.config.cameras.push_back(ReadCamera(camera.get(), found));
      sources.push_back(SourceOf(camera.get(), found));
      const CameraConfig& config = draft.config.cameras.back();
      draft.findings.push_back({Severity::kOk, found.serial,
                                found.vendor + " " + found.model + " at " + found.address + ", " +
                                    std::to_string(config.width) + " x " +
                                    std::to_string(config.height) + ", trigger " + sources.back(),
                                ""});
    } catch (const Error& failure) {
      draft.findings.push_back({Severity::kWarning, found.serial, failure.what(),
                                "left out; close other programs that use it and try again"});
    }
  }
  Require(!draft.config.cameras.empty(), "no camera could be read: " + draft.findings[0].what);
  // One trigger for all: the best that every camera has.
  for (const char* source : {"gpio", "simulated", "action", "software"}) {
    draft.config.trigger.source = source;
    if (std::count(sources.begin(), sources.end(), source) ==
        static_cast<std::ptrdiff_t>(sources.size())) {
      break;
    }
  }
  Place(draft.config);
  draft.findings.push_back(
      {Severity::kWarning, "", "positions, focal lengths and pairs are placeholders",
       "edit position_m, look_at_m, up, focal_px, role and the pairs, then run sole rig check"});
  return draft;
}

}  // namespace sole::capture
