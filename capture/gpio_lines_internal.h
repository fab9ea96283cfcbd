#pragma once

#include <memory>
#include <string>
#include <vector>

namespace sole::capture {

/// Output lines of one GPIO chip, requested together, all low at first. One implementation is
/// compiled: gpio_lines_v1.cpp or gpio_lines_v2.cpp, as the installed libgpiod demands.
class GpioLines {
 public:
  /// `path` like /dev/gpiochip0. Throws Error naming chip and lines.
  GpioLines(const std::string& path, const std::vector<int>& lines);
  ~GpioLines();
  GpioLines(const GpioLines&) = delete;
  GpioLines& operator=(const GpioLines&) = delete;

  /// Sets all lines to one level at once. Throws Error.
  void SetAll(bool high);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace sole::capture
