#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace sole::capture {

/// Output lines of one GPIO chip, requested together, all low at first. One implementation is
/// compiled: gpio_lines_v1.cpp or gpio_lines_v2.cpp, as the installed libgpiod demands. Lines are
/// numbers or names.
class GpioOutputs {
 public:
  /// `path` like /dev/gpiochip0. Throws Error naming chip and lines.
  GpioOutputs(const std::string& path, const std::vector<std::string>& lines);
  ~GpioOutputs();
  GpioOutputs(const GpioOutputs&) = delete;
  GpioOutputs& operator=(const GpioOutputs&) = delete;

  /// Sets all lines at once; one value a line, true is high. Throws Error if the system refuses.
  void Set(const std::vector<bool>& high);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

struct GpioEvent {
  bool rising = false;
  std::int64_t monotonic_ns = 0;  ///< the kernel's time stamp, CLOCK_MONOTONIC
};

/// An input line whose edges are queued by the kernel.
class GpioInput {
 public:
  /// Throws Error naming chip and line.
  GpioInput(const std::string& path, const std::string& line);
  ~GpioInput();
  GpioInput(const GpioInput&) = delete;
  GpioInput& operator=(const GpioInput&) = delete;

  /// Waits up to `timeout_ms` for edges and returns those that came. Throws Error if the line is
  /// gone.
  std::vector<GpioEvent> Wait(int timeout_ms);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace sole::capture
