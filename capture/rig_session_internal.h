#pragma once

#include <memory>
#include <string>

#include "capture/trigger.h"
#include "capture/warmup.h"
#include "core/rig_config.h"

namespace sole::capture {

/// Shortest time between two triggers.
std::int64_t PeriodNs(const TriggerConfig& config);

/// How the cameras are set to be triggered.
TriggerInput InputFor(const TriggerConfig& config);

/// The trigger that the rig file names. `cameras` must outlive it (software triggers go through
/// them).
std::unique_ptr<Trigger> MakeTrigger(const RigConfig& config, const CameraList& cameras);

/// `count` triggers by the rig file's cycle, from `start_ns` on.
TriggerSchedule ScheduleFor(const TriggerConfig& config, std::int64_t start_ns,
                            std::int64_t count);

/// Why a camera did not answer the warm-up, with what to do.
std::string DescribeSilence(const WarmUpAnswer& answer, const TriggerConfig& config);

}  // namespace sole::capture
