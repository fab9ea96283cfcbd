#include "capture/rig_check.h"

#include <algorithm>
#include <fstream>
#include <mutex>
#include <optional>

#include "capture/disk_check.h"
#include "capture/host_clock.h"
#include "capture/rig_session_internal.h"
#include "core/error.h"

namespace sole::capture {
namespace {

constexpr long kSocketBufferWanted = 4 << 20;

/// Splits an error line at its last ": ", where messages turn from what is wrong to what to do.
RigFinding FindingFrom(const std::string& camera, const std::string& message) {
  const std::size_t at = message.rfind(": ");
  if (at == std::string::npos) return {Severity::kError, camera, message, "see the message"};
  return {Severity::kError, camera, message.substr(0, at), message.substr(at + 2)};
}

class Check {
 public:
  Check(const RigConfig& config, const RigCheckOptions& options)
      : config_(config), options_(options) {}

  RigCheckResult Run() {
    CheckHost();
    for (std::size_t i = 0; i < config_.cameras.size(); ++i) {
      result_.cameras.push_back({.serial = config_.cameras[i].serial});
      Open(i);
    }
    if (!cameras_.empty()) CheckTriggers();
    if (!options_.disk.empty()) CheckDisk();
    CloseCameras(cameras_);
    return result_;
  }

 private:
  void Add(Severity severity, const std::string& camera, const std::string& what,
           const std::string& mend = "") {
    result_.findings.push_back({severity, camera, what, mend});
  }

  void CheckHost() {
    long limit = 0;
    std::ifstream("/proc/sys/net/core/rmem_max") >> limit;
    if (limit > 0 && limit < kSocketBufferWanted) {
      Add(Severity::kWarning, "",
          "socket buffers are limited to " + std::to_string(limit) + " bytes: frames may get lost",
          "sudo sysctl -w net.core.rmem_max=" + std::to_string(kSocketBufferWanted));
    }
  }

  void CheckDisk() {
    const double needed = result_.needed_bytes_per_s = WriteRateNeeded(config_);
    try {
      const double rate = result_.disk_bytes_per_s = MeasureDisk(options_.disk, config_);
      const double minutes = RoomLeft(options_.disk, config_.disk) / needed / 60;
      const auto mega = [](double value) {
        return std::to_string(static_cast<long long>(value / 1e6 + 0.5)) + " MB/s";
      };
      const std::string what = "disk takes " + mega(rate) + ", recording needs " + mega(needed);
      if (rate * config_.disk.max_share < needed) {
        Add(Severity::kError, "", what, "lower rate_hz or the image size, or use a faster disk");
      } else if (minutes < 1) {
        Add(Severity::kError, "", what + ", but it is full after " +
                                      std::to_string(static_cast<int>(std::max(0.0, 60 * minutes))) + " s",
            "make room");
      } else {
        Add(Severity::kOk, "", what + ", room for " + std::to_string(static_cast<long long>(minutes)) + " min");
      }
    } catch (const Error& error) {
      result_.findings.push_back(FindingFrom("", error.what()));
    }
  }

  void Open(std::size_t index) {
    const CameraConfig& config = config_.cameras[index];
    RigCameraCheck& check = result_.cameras[index];
    try {
      auto camera = std::make_unique<Camera>(config);
      check.found = check.controlled = true;
      const std::vector<CameraSetting> settings =
          camera->ApplySettings(InputFor(config_.trigger));
      RequireSettings(config, settings);
      check.settings_ok = true;
      camera->Start();
      Add(Severity::kOk, config.serial,
          "found, controlled, " + std::to_string(settings.size()) + " settings read back");
      cameras_.push_back(std::move(camera));
      indices_.push_back(index);
    } catch (const Error& error) {
      const std::string message = error.what();
      check.found = check.found || message.find("controlled by another") != std::string::npos;
      result_.findings.push_back(FindingFrom(config.serial, message));
    }
  }

  void CheckTriggers() {
    try {
      const auto trigger = MakeTrigger(config_, cameras_);
      const auto answers = WarmUp(cameras_, *trigger,
                                  {.triggers = config_.trigger.warmup,
                                   .attempts = 2,
                                   .period_ns = PeriodNs(config_.trigger)});
      for (std::size_t i = 0; i < answers.size(); ++i) {
        if (answers[i].answered) continue;
        result_.findings.push_back(FindingFrom(
            Serial(i),
            "does not answer the trigger: " + DescribeSilence(answers[i], config_.trigger)));
      }
      FireTests(*trigger, answers);
    } catch (const Error& error) {
      result_.findings.push_back(FindingFrom("", error.what()));
    }
  }

  const std::string& Serial(std::size_t i) const { return config_.cameras[indices_[i]].serial; }

  void FireTests(Trigger& trigger, const std::vector<WarmUpAnswer>& answers) {
    const std::int64_t period_ns = PeriodNs(config_.trigger);
    TriggerLog log;
    std::mutex mutex;
    std::vector<std::optional<FrameMatcher>> matchers(cameras_.size());
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      if (!answers[i].answered) continue;
      // Test pulses have sequences up to 0, so that a simulated rig does not take them for a
      // recording.
      CameraSync sync = answers[i].sync;
      sync.frame_id += options_.triggers;
      matchers[i].emplace(sync, period_ns);
      cameras_[i]->SetHandler([&, i](const CameraFrame& frame) {
        const std::lock_guard lock(mutex);
        const FrameMatch match =
            matchers[i]->Match(frame.frame_id, frame.device_time_ns, frame.complete, log);
        const bool known =
            match.outcome == MatchOutcome::kMatched || match.outcome == MatchOutcome::kRealigned;
        if (!known || !frame.complete) return;
        RigCameraCheck& check = result_.cameras[indices_[i]];
        ++check.answered;
        const double latency_s =
            static_cast<double>(frame.host_time_ns - match.edge.actual_ns) * 1e-9;
        check.latency_max_s = std::max(check.latency_max_s, latency_s);
      });
    }
    FireSchedule(trigger,
                 {.start_ns = HostNowNs() + period_ns,
                  .period_ns = period_ns,
                  .first_sequence = 1 - options_.triggers,
                  .count = options_.triggers},
                 log);
    SleepUntilNs(HostNowNs() + std::max<std::int64_t>(500'000'000, 2 * period_ns));
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      cameras_[i]->SetHandler({});
      if (matchers[i]) Summarise(i);
    }
  }

  void Summarise(std::size_t i) {
    RigCameraCheck& check = result_.cameras[indices_[i]];
    const CameraStatistics statistics = cameras_[i]->Statistics();
    check.fired = options_.triggers;
    check.resent_packets = statistics.resent_packets;
    check.missing_packets = statistics.missing_packets;
    const std::string counts =
        std::to_string(check.answered) + " of " + std::to_string(check.fired) + " test triggers";
    if (check.answered < check.fired) {
      Add(Severity::kError, check.serial, "answered only " + counts,
          "lower packet_size, raise packet_delay_ns or lower trigger rate_hz; check the cable");
    } else if (check.resent_packets > 0) {
      Add(Severity::kWarning, check.serial,
          "answered " + counts + ", but " + std::to_string(check.resent_packets) +
              " packets had to be resent",
          "check cable and switch, raise packet_delay_ns");
    } else {
      Add(Severity::kOk, check.serial,
          "answered " + counts + ", " +
              std::to_string(static_cast<int>(check.latency_max_s * 1e3 + 0.5)) + " ms at most");
    }
  }

  const RigConfig& config_;
  const RigCheckOptions& options_;
  RigCheckResult result_;
  CameraList cameras_;                ///< those that opened
  std::vector<std::size_t> indices_;  ///< their places in the rig
};

}  // namespace

const char* ToString(Severity severity) {
  switch (severity) {
    case Severity::kOk:
      return "ok";
    case Severity::kWarning:
      return "warning";
    case Severity::kError:
      return "error";
  }
  return "unknown";
}

bool RigCheckResult::Ok() const {
  return std::none_of(findings.begin(), findings.end(), [](const RigFinding& finding) {
    return finding.severity == Severity::kError;
  });
}

RigCheckResult CheckRig(const RigConfig& config, const RigCheckOptions& options) {
  Validate(config);
  Require(options.triggers > 0, "a rig check needs at least one test trigger");
  return Check(config, options).Run();
}

}  // namespace sole::capture
