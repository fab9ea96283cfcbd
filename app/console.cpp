#include "app/console.h"

#include <unistd.h>

#include <cstdio>
#include <optional>
#include <thread>

#include <opencv2/core.hpp>
#include <tbb/global_control.h>

namespace sole::app {

const char* Version() { return SOLE_VERSION; }

void Log(const std::string& line) { std::fprintf(stderr, "%s\n", line.c_str()); }

Progress::Progress(std::string what, int total)
    : what_(std::move(what)), total_(total), terminal_(isatty(STDERR_FILENO) != 0) {
  Set(0);
}

Progress::~Progress() {
  if (terminal_) std::fputc('\n', stderr);
}

void Progress::Set(int done) {
  if (total_ <= 0) return;
  const int step = terminal_ ? done : 10 * done / total_;
  if (step == shown_) return;
  shown_ = step;
  if (terminal_) {
    constexpr int kWidth = 30;
    const int full = kWidth * done / total_;
    std::fprintf(stderr, "\r%-22s [%.*s%*s] %d/%d", what_.c_str(), full, "==============================",
                 kWidth - full, "", done, total_);
    std::fflush(stderr);
  } else {
    std::fprintf(stderr, "%s %d/%d\n", what_.c_str(), done, total_);
  }
}

struct ThreadCap::State {
  std::optional<tbb::global_control> control;
};

ThreadCap::ThreadCap(int threads) : state_(std::make_unique<State>()) {
  const auto count = threads > 0 ? static_cast<std::size_t>(threads)
                                 : static_cast<std::size_t>(std::max(1u, std::thread::hardware_concurrency()));
  state_->control.emplace(tbb::global_control::max_allowed_parallelism, count);
  cv::setNumThreads(static_cast<int>(count));
}

ThreadCap::~ThreadCap() = default;

}  // namespace sole::app
