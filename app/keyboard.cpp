#include "app/keyboard.h"

#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>

namespace sole::app {

struct Keyboard::State {
  bool terminal = isatty(STDIN_FILENO) != 0;
  bool open = true;
  int lines = 0;  ///< read from a pipe, not reported yet
  termios before{};
};

Keyboard::Keyboard() : state_(std::make_unique<State>()) {
  if (!state_->terminal || tcgetattr(STDIN_FILENO, &state_->before) != 0) return;
  termios raw = state_->before;
  raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  raw.c_cc[VMIN] = 0;
  raw.c_cc[VTIME] = 0;
  tcsetattr(STDIN_FILENO, TCSANOW, &raw);
}

Keyboard::~Keyboard() {
  if (state_->terminal) tcsetattr(STDIN_FILENO, TCSANOW, &state_->before);
}

bool Keyboard::Hit() {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  if (state_->open && poll(&input, 1, 0) > 0) {
    std::array<char, 256> bytes{};
    const ssize_t count = read(STDIN_FILENO, bytes.data(), bytes.size());
    if (count <= 0) {
      state_->open = state_->terminal;
    } else {
      const auto end = bytes.begin() + count;
      const bool meant = std::any_of(bytes.begin(), end, [](char c) {
        return c == '\n' || c == '\r' || c == ' ' || c == 'q';
      });
      const auto lines = static_cast<int>(std::count(bytes.begin(), end, '\n'));
      state_->lines += !state_->terminal ? lines : meant ? 1 : 0;
    }
  }
  if (state_->lines == 0) return false;
  --state_->lines;
  return true;
}

}  // namespace sole::app
