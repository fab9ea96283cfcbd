#include "capture/trigger.h"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "capture/host_clock.h"
#include "core/error.h"

namespace sole::capture {
namespace {

class SoftwareTrigger : public Trigger {
 public:
  explicit SoftwareTrigger(std::vector<std::function<void()>> fire) : fire_(std::move(fire)) {}
  void Emit(const TriggerEdge&) override {
    for (const auto& fire : fire_) fire();
  }
  std::string CameraSource() const override { return "Software"; }

 private:
  std::vector<std::function<void()>> fire_;
};

}  // namespace

std::unique_ptr<Trigger> MakeSoftwareTrigger(std::vector<std::function<void()>> fire) {
  return std::make_unique<SoftwareTrigger>(std::move(fire));
}

std::int64_t FireSchedule(Trigger& trigger, const TriggerSchedule& schedule, TriggerLog& log,
                          const std::atomic<bool>* stop, const std::atomic<std::int64_t>* last) {
  Require(schedule.period_ns > 0 && !schedule.cycle.empty(),
          "trigger schedule needs a period and a cycle");
  const auto kinds = static_cast<std::int64_t>(schedule.cycle.size());
  const std::int64_t step = schedule.gap_ns > 0 ? schedule.gap_ns : schedule.period_ns;
  const std::int64_t rest = kinds * schedule.period_ns - (kinds - 1) * step;
  Require(rest > 0, "the exposures of a trigger cycle do not fit into it");
  const std::int64_t shortest = std::min(step, rest);
  std::int64_t earliest = schedule.start_ns;
  for (std::int64_t i = 0; i < schedule.count; ++i) {
    TriggerEdge edge;
    edge.sequence = schedule.first_sequence + i;
    edge.kind = schedule.cycle[static_cast<std::size_t>(i % kinds)];
    edge.scheduled_ns =
        schedule.start_ns + i / kinds * kinds * schedule.period_ns + i % kinds * step;
    if (!SleepUntilNs(std::max(edge.scheduled_ns, earliest), stop)) return i;
    if (last != nullptr && edge.sequence > last->load()) return i;
    edge.actual_ns = HostNowNs();
    earliest = edge.actual_ns + shortest * 4 / 5;
    log.Append(edge);
    trigger.Emit(edge);
  }
  return schedule.count;
}

RealtimeScope::RealtimeScope(const LogFunction& log) {
  const auto refused = [&](const char* what, int error) {
    if (log)
      log(std::string(what) + " refused (" + std::strerror(error) +
          "): trigger edges may jitter more");
  };
  // On fault: large reserved areas stay cheap. Not MCL_FUTURE: under a memory-lock limit it makes
  // malloc fail.
  locked_ = mlockall(MCL_CURRENT | MCL_ONFAULT) == 0;
  if (!locked_) refused("locking memory", errno);
  sched_param parameter{};
  parameter.sched_priority =
      40;  // above 50 the kernel's own interrupt threads lose and edges get lost
  const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter);
  scheduled_ = error == 0;
  if (!scheduled_) refused("real-time scheduling", error);
}

RealtimeScope::~RealtimeScope() {
  if (scheduled_) {
    const sched_param parameter{};
    pthread_setschedparam(pthread_self(), SCHED_OTHER, &parameter);
  }
  if (locked_) munlockall();
}

}  // namespace sole::capture
