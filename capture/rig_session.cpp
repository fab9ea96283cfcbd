#include <algorithm>
#include <cmath>

#include "capture/rig_session_internal.h"
#include "core/error.h"

namespace sole::capture {

std::int64_t PeriodNs(const TriggerConfig& config) {
  return std::llround(1e9 * ShortestExposureInterval(config));
}

TriggerInput InputFor(const TriggerConfig& config) {
  TriggerInput input;
  if (config.source == "software") input.source = "Software";
  if (config.source == "action") {
    input = {"Action1", config.action_device_key, config.action_group_key,
             config.action_group_mask};
  }
  return input;
}

std::unique_ptr<Trigger> MakeTrigger(const RigConfig& config, const CameraList& cameras) {
  const TriggerConfig& trigger = config.trigger;
  if (trigger.source == "simulated") return MakeSimulatedTrigger(trigger.bus_port);
  if (trigger.source == "action") {
    return MakeActionTrigger({trigger.action_address, trigger.action_device_key,
                              trigger.action_group_key, trigger.action_group_mask});
  }
  if (trigger.source == "gpio") {
    GpioTriggerOptions options{trigger.gpio_chip, trigger.gpio_line, trigger.pulse_us, {},
                               trigger.readback_line};
    double exposure_us = trigger.pulse_us;  // lights stay on as long as any camera looks
    for (const CameraConfig& camera : config.cameras)
      exposure_us = std::max(exposure_us, camera.exposure_us);
    for (const StrobeConfig& strobe : trigger.strobes)
      options.strobes.push_back({strobe.line, strobe.exposures, exposure_us});
    return MakeGpioTrigger(options);
  }
  std::vector<std::function<void()>> fire;
  for (const auto& camera : cameras) {
    fire.push_back([device = camera.get()] {
      try {
        device->SoftwareTrigger();
      } catch (const Error&) {
        // A camera that went away: its frame is missing, and the others want their trigger.
      }
    });
  }
  return MakeSoftwareTrigger(std::move(fire));
}

TriggerSchedule ScheduleFor(const TriggerConfig& config, std::int64_t start_ns,
                            std::int64_t count) {
  const auto exposures = static_cast<double>(config.exposures.size());
  return {.start_ns = start_ns,
          .period_ns = std::llround(1e9 / (config.rate_hz * exposures)),
          .gap_ns = std::llround(1e9 * config.exposure_gap_s),
          .first_sequence = 1,
          .count = count,
          .cycle = config.exposures};
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
  if (config.source == "action")
    return "no frame came: check action_address and the action keys, and that switches pass "
           "broadcasts";
  if (config.source == "gpio")
    return "no frame came: check the trigger cable on Line1 and gpio_line";
  return "no frame came: does the camera support software triggers, and does a firewall block UDP?";
}

}  // namespace sole::capture
