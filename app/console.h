#pragma once

#include <chrono>
#include <memory>
#include <string>

namespace sole::app {

/// Version of the program, as written into takes and reports.
const char* Version();

/// Prints one line to stderr. Results go to stdout, everything else here.
void Log(const std::string& line);

/// Progress of a long step on stderr: a bar on a terminal, otherwise a line at every tenth.
class Progress {
 public:
  Progress(std::string what, int total);
  ~Progress();
  void Set(int done);

 private:
  std::string what_;
  int total_;
  int shown_ = -1;
  bool terminal_;
};

/// Caps every pool of threads at `threads` (0 = all cores) while it lives.
class ThreadCap {
 public:
  explicit ThreadCap(int threads);
  ~ThreadCap();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Seconds since construction.
class Stopwatch {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace sole::app
