#include <cstdint>

#include "capture/gpio_lines_internal.h"
#include "capture/host_clock.h"
#include "capture/trigger.h"
#include "core/error.h"

namespace sole::capture {
namespace {

class GpioTrigger : public Trigger {
 public:
  GpioTrigger(const std::string& path, const std::vector<int>& lines, double pulse_us)
      : lines_(path, lines), pulse_ns_(static_cast<std::int64_t>(pulse_us * 1000)) {}

  void Emit(const TriggerEdge&) override {
    lines_.SetAll(true);
    SleepUntilNs(HostNowNs() + pulse_ns_);
    lines_.SetAll(false);
  }

 private:
  GpioLines lines_;
  std::int64_t pulse_ns_;
};

}  // namespace

std::unique_ptr<Trigger> MakeGpioTrigger(const std::string& chip, const std::vector<int>& lines,
                                         double pulse_us) {
  Require(!lines.empty() && pulse_us > 0, "a GPIO trigger needs a line and a pulse length above 0");
  const std::string path = chip.find('/') == std::string::npos ? "/dev/" + chip : chip;
  return std::make_unique<GpioTrigger>(path, lines, pulse_us);
}

}  // namespace sole::capture
