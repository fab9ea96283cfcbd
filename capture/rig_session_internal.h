#pragma once

#include <memory>
#include <string>

#include "capture/trigger.h"
#include "capture/warmup.h"
#include "core/rig_config.h"

namespace sole::capture {

std::int64_t PeriodNs(const TriggerConfig& config);

/// TriggerSource of the cameras for this configuration.
std::string CameraSourceFor(const TriggerConfig& config);

/// The trigger that the rig file names. `cameras` must outlive it (software triggers go through
/// them).
std::unique_ptr<Trigger> MakeTrigger(const TriggerConfig& config, const CameraList& cameras);

/// Why a camera did not answer the warm-up, with what to do.
std::string DescribeSilence(const WarmUpAnswer& answer, const TriggerConfig& config);

}  // namespace sole::capture
