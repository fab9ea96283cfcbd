#pragma once

#include <memory>

namespace sole::app {

/// Keys of the terminal without Enter, while it lives; on a pipe, lines count as keys. Ctrl-C stays
/// Ctrl-C.
class Keyboard {
 public:
  Keyboard();
  ~Keyboard();
  Keyboard(const Keyboard&) = delete;
  Keyboard& operator=(const Keyboard&) = delete;
  /// True once for a key (on a pipe: a line) that was hit since the last call.
  bool Hit();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace sole::app
