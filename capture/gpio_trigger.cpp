#include <algorithm>
#include <cstdint>
#include <mutex>
#include <optional>
#include <thread>

#include "capture/gpio_lines_internal.h"
#include "capture/host_clock.h"
#include "capture/trigger.h"
#include "core/error.h"

namespace sole::capture {
namespace {

std::int64_t Nanoseconds(double us) { return static_cast<std::int64_t>(us * 1000); }

/// Collects exposures from the read-back line on its own thread.
class ExposureReader {
 public:
  ExposureReader(const std::string& path, const std::string& line) : input_(path, line) {
    thread_ = std::thread([this] { Run(); });
  }
  ~ExposureReader() {
    stop_ = true;
    thread_.join();
  }
  ExposureReader(const ExposureReader&) = delete;
  ExposureReader& operator=(const ExposureReader&) = delete;

  std::vector<ExposureEcho> Echoes() const {
    const std::lock_guard lock(mutex_);
    return echoes_;
  }

 private:
  void Run() {
    constexpr int kTimeoutMs = 50;
    std::optional<std::int64_t> rise;
    try {
      while (!stop_.load()) {
        for (const GpioEvent& event : input_.Wait(kTimeoutMs)) {
          const std::int64_t time = HostFromMonotonicNs(event.monotonic_ns);
          if (event.rising) {
            rise = time;
          } else if (rise) {
            const std::lock_guard lock(mutex_);
            echoes_.push_back({*rise, time});
            rise.reset();
          }
        }
      }
    } catch (const Error&) {
      // The line is gone: the edges that follow have no echo, and that is what the take says.
    }
  }

  GpioInput input_;
  std::atomic<bool> stop_{false};
  mutable std::mutex mutex_;
  std::vector<ExposureEcho> echoes_;
  std::thread thread_;
};

class GpioTrigger : public Trigger {
 public:
  GpioTrigger(const std::string& path, const GpioTriggerOptions& options)
      : options_(options), outputs_(path, Lines(options)) {
    if (!options.readback_line.empty()) reader_.emplace(path, options.readback_line);
  }

  void Emit(const TriggerEdge& edge) override {
    std::vector<bool> high{true};
    std::vector<std::int64_t> low_after{Nanoseconds(options_.pulse_us)};
    for (const auto& strobe : options_.strobes) {
      high.push_back(std::find(strobe.exposures.begin(), strobe.exposures.end(), edge.kind) !=
                     strobe.exposures.end());
      low_after.push_back(Nanoseconds(strobe.pulse_us));
    }
    const std::int64_t risen = HostNowNs();
    outputs_.Set(high);
    while (std::find(high.begin(), high.end(), true) != high.end()) {
      std::int64_t next = 0;
      for (std::size_t i = 0; i < high.size(); ++i) {
        if (high[i] && (next == 0 || low_after[i] < next)) next = low_after[i];
      }
      SleepUntilNs(risen + next);
      for (std::size_t i = 0; i < high.size(); ++i) high[i] = high[i] && low_after[i] > next;
      outputs_.Set(high);
    }
  }
  bool ReadsBack() const override { return reader_.has_value(); }
  std::vector<ExposureEcho> Echoes() const override {
    return reader_ ? reader_->Echoes() : std::vector<ExposureEcho>{};
  }

 private:
  static std::vector<std::string> Lines(const GpioTriggerOptions& options) {
    std::vector<std::string> lines{options.line};
    for (const auto& strobe : options.strobes) lines.push_back(strobe.line);
    return lines;
  }

  GpioTriggerOptions options_;
  GpioOutputs outputs_;
  std::optional<ExposureReader> reader_;
};

}  // namespace

std::unique_ptr<Trigger> MakeGpioTrigger(const GpioTriggerOptions& options) {
  Require(!options.line.empty() && options.pulse_us > 0,
          "a GPIO trigger needs a line and a pulse length above 0");
  for (const auto& strobe : options.strobes) {
    Require(!strobe.line.empty() && strobe.pulse_us > 0,
            "a strobe needs a line and a pulse length above 0");
  }
  const std::string path =
      options.chip.find('/') == std::string::npos ? "/dev/" + options.chip : options.chip;
  return std::make_unique<GpioTrigger>(path, options);
}

}  // namespace sole::capture
