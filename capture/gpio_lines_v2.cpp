// libgpiod 2.x
#include <gpiod.h>

#include <cerrno>
#include <cstring>

#include "capture/gpio_lines_internal.h"
#include "core/error.h"

namespace sole::capture {
namespace {

template <auto Free>
struct Deleter {
  template <typename T>
  void operator()(T* object) const {
    Free(object);
  }
};
template <typename T, auto Free>
using Handle = std::unique_ptr<T, Deleter<Free>>;

}  // namespace

struct GpioLines::State {
  std::string path;
  Handle<gpiod_chip, gpiod_chip_close> chip;
  Handle<gpiod_line_request, gpiod_line_request_release> request;
  std::vector<gpiod_line_value> values;
};

GpioLines::GpioLines(const std::string& path, const std::vector<int>& lines)
    : state_(std::make_unique<State>()) {
  state_->path = path;
  state_->chip.reset(gpiod_chip_open(path.c_str()));
  Require(state_->chip != nullptr,
          "cannot open GPIO chip " + path + " (" + std::strerror(errno) +
              "): check trigger gpio_chip in the rig file, `gpiodetect` lists chips");
  Handle<gpiod_chip_info, gpiod_chip_info_free> info(gpiod_chip_get_info(state_->chip.get()));
  const std::size_t count = info ? gpiod_chip_info_get_num_lines(info.get()) : 0;
  std::vector<unsigned> offsets;
  for (const int offset : lines) {
    Require(offset >= 0 && static_cast<std::size_t>(offset) < count,
            "GPIO chip " + path + " has no line " + std::to_string(offset) + " (it has " +
                std::to_string(count) + "): check trigger gpio_line in the rig file");
    offsets.push_back(static_cast<unsigned>(offset));
  }
  Handle<gpiod_line_settings, gpiod_line_settings_free> settings(gpiod_line_settings_new());
  Handle<gpiod_line_config, gpiod_line_config_free> line_config(gpiod_line_config_new());
  Handle<gpiod_request_config, gpiod_request_config_free> request_config(
      gpiod_request_config_new());
  Require(settings && line_config && request_config, "no memory for GPIO lines of " + path);
  gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_OUTPUT);
  gpiod_line_settings_set_output_value(settings.get(), GPIOD_LINE_VALUE_INACTIVE);
  gpiod_request_config_set_consumer(request_config.get(), "sole");
  if (gpiod_line_config_add_line_settings(line_config.get(), offsets.data(), offsets.size(),
                                          settings.get()) == 0) {
    state_->request.reset(
        gpiod_chip_request_lines(state_->chip.get(), request_config.get(), line_config.get()));
  }
  Require(state_->request != nullptr, "cannot drive line " + std::to_string(lines.front()) +
                                          " of " + path + " (" + std::strerror(errno) +
                                          "): `gpioinfo` shows who uses it");
  state_->values.assign(lines.size(), GPIOD_LINE_VALUE_INACTIVE);
}

GpioLines::~GpioLines() = default;

void GpioLines::SetAll(bool high) {
  state_->values.assign(state_->values.size(),
                        high ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE);
  Require(gpiod_line_request_set_values(state_->request.get(), state_->values.data()) == 0,
          "cannot set the trigger line of " + state_->path + ": " + std::strerror(errno));
}

}  // namespace sole::capture
