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
using Chip = Handle<gpiod_chip, gpiod_chip_close>;
using Request = Handle<gpiod_line_request, gpiod_line_request_release>;
using Settings = Handle<gpiod_line_settings, gpiod_line_settings_free>;

Chip OpenChip(const std::string& path) {
  Chip chip(gpiod_chip_open(path.c_str()));
  Require(chip != nullptr, "cannot open GPIO chip " + path + " (" + std::strerror(errno) +
                               "): check trigger gpio_chip in the rig file, `gpiodetect` lists "
                               "chips");
  return chip;
}

unsigned FindLine(gpiod_chip* chip, const std::string& path, const std::string& name) {
  Handle<gpiod_chip_info, gpiod_chip_info_free> info(gpiod_chip_get_info(chip));
  const std::size_t count = info ? gpiod_chip_info_get_num_lines(info.get()) : 0;
  const bool number =
      !name.empty() && name.size() < 6 && name.find_first_not_of("0123456789") == std::string::npos;
  const int offset =
      number ? std::stoi(name) : gpiod_chip_get_line_offset_from_name(chip, name.c_str());
  Require(offset >= 0 && static_cast<std::size_t>(offset) < count,
          "GPIO chip " + path + " has no line '" + name + "' (it has " + std::to_string(count) +
              "): check the lines of [trigger] in the rig file, `gpioinfo` lists them");
  return static_cast<unsigned>(offset);
}

/// Empty with errno set if the system refuses.
Request RequestLines(gpiod_chip* chip, const std::vector<unsigned>& offsets, Settings settings) {
  Handle<gpiod_line_config, gpiod_line_config_free> lines(gpiod_line_config_new());
  Handle<gpiod_request_config, gpiod_request_config_free> request(gpiod_request_config_new());
  if (!settings || !lines || !request) return {};
  gpiod_request_config_set_consumer(request.get(), "sole");
  if (gpiod_line_config_add_line_settings(lines.get(), offsets.data(), offsets.size(),
                                          settings.get()) != 0) {
    return {};
  }
  return Request(gpiod_chip_request_lines(chip, request.get(), lines.get()));
}

}  // namespace

struct GpioOutputs::State {
  std::string path;
  Chip chip;
  Request request;
  std::vector<gpiod_line_value> values;
};

GpioOutputs::GpioOutputs(const std::string& path, const std::vector<std::string>& lines)
    : state_(std::make_unique<State>()) {
  state_->path = path;
  state_->chip = OpenChip(path);
  std::vector<unsigned> offsets;
  for (const std::string& name : lines) {
    offsets.push_back(FindLine(state_->chip.get(), path, name));
  }
  Settings settings(gpiod_line_settings_new());
  if (settings) {
    gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_OUTPUT);
    gpiod_line_settings_set_output_value(settings.get(), GPIOD_LINE_VALUE_INACTIVE);
  }
  state_->request = RequestLines(state_->chip.get(), offsets, std::move(settings));
  Require(state_->request != nullptr, "cannot drive line " + lines.front() + " of " + path + " (" +
                                          std::strerror(errno) +
                                          "): `gpioinfo` shows who uses it");
  state_->values.assign(lines.size(), GPIOD_LINE_VALUE_INACTIVE);
}

GpioOutputs::~GpioOutputs() = default;

void GpioOutputs::Set(const std::vector<bool>& high) {
  for (std::size_t i = 0; i < high.size(); ++i) {
    state_->values.at(i) = high[i] ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
  }
  Require(gpiod_line_request_set_values(state_->request.get(), state_->values.data()) == 0,
          "cannot set the trigger line of " + state_->path + ": " + std::strerror(errno));
}

struct GpioInput::State {
  std::string path;
  Chip chip;
  Request request;
  Handle<gpiod_edge_event_buffer, gpiod_edge_event_buffer_free> buffer;
};

GpioInput::GpioInput(const std::string& path, const std::string& line)
    : state_(std::make_unique<State>()) {
  constexpr std::size_t kEvents = 16;
  state_->path = path;
  state_->chip = OpenChip(path);
  const unsigned offset = FindLine(state_->chip.get(), path, line);
  Settings settings(gpiod_line_settings_new());
  if (settings) {
    gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_INPUT);
    gpiod_line_settings_set_edge_detection(settings.get(), GPIOD_LINE_EDGE_BOTH);
    gpiod_line_settings_set_event_clock(settings.get(), GPIOD_LINE_CLOCK_MONOTONIC);
  }
  state_->request = RequestLines(state_->chip.get(), {offset}, std::move(settings));
  state_->buffer.reset(gpiod_edge_event_buffer_new(kEvents));
  Require(state_->request != nullptr && state_->buffer != nullptr,
          "cannot watch line " + line + " of " + path + " (" + std::strerror(errno) +
              "): `gpioinfo` shows who uses it");
}

GpioInput::~GpioInput() = default;

std::vector<GpioEvent> GpioInput::Wait(int timeout_ms) {
  const int ready =
      gpiod_line_request_wait_edge_events(state_->request.get(), timeout_ms * 1'000'000LL);
  if (ready == 0 || (ready < 0 && errno == EINTR)) return {};
  const int count = ready < 0 ? -1
                              : gpiod_line_request_read_edge_events(
                                    state_->request.get(), state_->buffer.get(),
                                    gpiod_edge_event_buffer_get_capacity(state_->buffer.get()));
  Require(count >= 0, "cannot read the exposure line of " + state_->path + ": " +
                          std::strerror(errno));
  std::vector<GpioEvent> result;
  for (int i = 0; i < count; ++i) {
    gpiod_edge_event* event =
        gpiod_edge_event_buffer_get_event(state_->buffer.get(), static_cast<unsigned long>(i));
    result.push_back({gpiod_edge_event_get_event_type(event) == GPIOD_EDGE_EVENT_RISING_EDGE,
                      static_cast<std::int64_t>(gpiod_edge_event_get_timestamp_ns(event))});
  }
  return result;
}

}  // namespace sole::capture
