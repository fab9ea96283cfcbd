// Fuzzes the readers of takes for as long as one likes, best in the asan preset:
// fuzz_take [seconds = 300] [seed = 1]
#include <sys/resource.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>

#include "tests/io/take_fuzz.h"

int main(int argc, char** argv) {
  std::signal(SIGXFSZ, SIG_IGN);
  sole::io::TakeFuzzOptions options;
  options.seconds = argc > 1 ? std::atof(argv[1]) : 300;
  options.seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  const sole::io::TakeFuzzResult result = sole::io::FuzzTake(options);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf("%lld rounds, peak memory %ld MB\n", static_cast<long long>(result.rounds),
              usage.ru_maxrss / 1024);
  for (const auto& [kind, count] : result.accepted) {
    const auto refused = result.refused.find(kind);
    std::printf("%s: %lld calls went through, %lld refused\n", kind.c_str(),
                static_cast<long long>(count),
                static_cast<long long>(refused == result.refused.end() ? 0 : refused->second));
  }
  std::printf("findings: %s\n", result.finding.empty() ? "none" : result.finding.c_str());
  return result.finding.empty() ? 0 : 1;
}
