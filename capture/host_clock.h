#pragma once

#include <atomic>
#include <cstdint>

namespace sole::capture {

/// Host time in nanoseconds on the scale of CLOCK_REALTIME, but steady: the offset to
/// CLOCK_MONOTONIC is taken once per process, so a clock adjustment during a take moves nothing.
std::int64_t HostNowNs();

/// Host time of an instant on CLOCK_MONOTONIC, as the kernel stamps GPIO edges.
std::int64_t HostFromMonotonicNs(std::int64_t monotonic_ns);

/// Sleeps until the absolute host time (scale of HostNowNs), in slices short enough to notice
/// `stop` within 0.1 s. Returns false if `stop` became true first.
bool SleepUntilNs(std::int64_t host_ns, const std::atomic<bool>* stop = nullptr);

}  // namespace sole::capture
