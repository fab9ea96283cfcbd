#include <cmath>

#include "capture/rig_session_internal.h"

namespace sole::capture {

std::int64_t PeriodNs(const TriggerConfig& config) { return std::llround(1e9 / config.rate_hz); }

std::string CameraSourceFor(const TriggerConfig& config) {
  return config.source == "software" ? "Software" : "Line1";
}

std::unique_ptr<Trigger> MakeTrigger(const TriggerConfig& config, const CameraList& cameras) {
  if (config.source == "simulated") return MakeSimulatedTrigger(config.bus_port);
  if (config.source == "gpio") return MakeGpioTrigger(config.gpio_chip, {config.gpio_line});
  std::vector<std::function<void()>> fire;
  for (const auto& camera : cameras)
    fire.push_back([device = camera.get()] { device->SoftwareTrigger(); });
  return MakeSoftwareTrigger(std::move(fire));
}

std::string DescribeSilence(const WarmUpAnswer& answer, const TriggerConfig& config) {
  if (answer.incomplete > 0) {
    return "only incomplete frames came (" + std::to_string(answer.incomplete) +
           "): lower packet_size or raise packet_delay_ns, and allow large socket buffers (sysctl "
           "net.core.rmem_max)";
  }
  if (config.source == "simulated") {
    return "no frame came: does the simulated rig listen on trigger bus_port " +
           std::to_string(config.bus_port) + "?";
  }
  if (config.source == "gpio")
    return "no frame came: check the trigger cable on Line1 and gpio_line";
  return "no frame came: does the camera support software triggers, and does a firewall block UDP?";
}

}  // namespace sole::capture
