#include "capture/host_clock.h"

#include <algorithm>
#include <cerrno>
#include <ctime>

namespace sole::capture {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kSlice = kSecond / 10;

std::int64_t Read(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<std::int64_t>(time.tv_sec) * kSecond + time.tv_nsec;
}

std::int64_t RealtimeFromMonotonic() {
  static const std::int64_t offset = Read(CLOCK_REALTIME) - Read(CLOCK_MONOTONIC);
  return offset;
}

}  // namespace

std::int64_t HostNowNs() { return RealtimeFromMonotonic() + Read(CLOCK_MONOTONIC); }

std::int64_t HostFromMonotonicNs(std::int64_t monotonic_ns) {
  return RealtimeFromMonotonic() + monotonic_ns;
}

bool SleepUntilNs(std::int64_t host_ns, const std::atomic<bool>* stop) {
  for (;;) {
    if (stop != nullptr && stop->load()) return false;
    const std::int64_t now = HostNowNs();
    if (now >= host_ns) return true;
    // The last slice goes straight to the deadline: one absolute sleep, no drift.
    const std::int64_t until = stop == nullptr ? host_ns : std::min(host_ns, now + kSlice);
    const std::int64_t monotonic = until - RealtimeFromMonotonic();
    const timespec deadline{static_cast<time_t>(monotonic / kSecond),
                            static_cast<long>(monotonic % kSecond)};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, nullptr) == EINTR) {
    }
  }
}

}  // namespace sole::capture
