// libgpiod 1.x
#include <gpiod.h>

#include <cerrno>
#include <cstring>

#include "capture/gpio_lines_internal.h"
#include "core/error.h"

namespace sole::capture {

struct GpioLines::State {
  ~State() {
    if (requested) gpiod_line_release_bulk(&bulk);
    if (chip != nullptr) gpiod_chip_close(chip);
  }
  std::string path;
  gpiod_chip* chip = nullptr;
  gpiod_line_bulk bulk{};
  std::vector<int> values;
  bool requested = false;
};

GpioLines::GpioLines(const std::string& path, const std::vector<int>& lines)
    : state_(std::make_unique<State>()) {
  state_->path = path;
  state_->chip = gpiod_chip_open(path.c_str());
  Require(state_->chip != nullptr,
          "cannot open GPIO chip " + path + " (" + std::strerror(errno) +
              "): check trigger gpio_chip in the rig file, `gpiodetect` lists chips");
  gpiod_line_bulk_init(&state_->bulk);
  for (const int offset : lines) {
    const unsigned count = gpiod_chip_num_lines(state_->chip);
    gpiod_line* line = offset >= 0 && static_cast<unsigned>(offset) < count
                           ? gpiod_chip_get_line(state_->chip, static_cast<unsigned>(offset))
                           : nullptr;
    Require(line != nullptr, "GPIO chip " + path + " has no line " + std::to_string(offset) +
                                 " (it has " + std::to_string(count) +
                                 "): check trigger gpio_line in the rig file");
    gpiod_line_bulk_add(&state_->bulk, line);
  }
  state_->values.assign(lines.size(), 0);
  Require(gpiod_line_request_bulk_output(&state_->bulk, "sole", state_->values.data()) == 0,
          "cannot drive line " + std::to_string(lines.front()) + " of " + path + " (" +
              std::strerror(errno) + "): `gpioinfo` shows who uses it");
  state_->requested = true;
}

GpioLines::~GpioLines() = default;

void GpioLines::SetAll(bool high) {
  state_->values.assign(state_->values.size(), high ? 1 : 0);
  Require(gpiod_line_set_value_bulk(&state_->bulk, state_->values.data()) == 0,
          "cannot set the trigger line of " + state_->path + ": " + std::strerror(errno));
}

}  // namespace sole::capture
