#pragma once

#include <memory>

namespace sole::app {

/// The keys that start and stop: Enter, space and q of the terminal, at once, while it lives; on a
/// pipe, lines. Ctrl-C stays Ctrl-C.
class Keyboard {
 public:
  Keyboard();
  ~Keyboard();
  Keyboard(const Keyboard&) = delete;
  Keyboard& operator=(const Keyboard&) = delete;
  /// True once for such a key (on a pipe: a line) that was hit since the last call.
  bool Hit();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace sole::app
