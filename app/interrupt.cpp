#include "app/interrupt.h"

#include <unistd.h>

#include <csignal>

namespace sole::app {
namespace {

std::atomic<bool> stop_requested{false};
void OnInterrupt(int) {
  if (stop_requested.exchange(true)) _exit(130);
}

}  // namespace

const std::atomic<bool>* StopOnInterrupt() {
  std::signal(SIGINT, OnInterrupt);
  std::signal(SIGTERM, OnInterrupt);
  return &stop_requested;
}

}  // namespace sole::app
