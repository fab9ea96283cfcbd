#include "app/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <thread>

#include "core/error.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;

constexpr int kNotStarted = 127;

/// The first `threads` cores of those that we may use.
cpu_set_t Cores(int threads) {
  cpu_set_t all, some;
  CPU_ZERO(&all);
  CPU_ZERO(&some);
  sched_getaffinity(0, sizeof all, &all);
  for (std::size_t core = 0; core < CPU_SETSIZE && threads > 0; ++core) {
    if (!CPU_ISSET(core, &all)) continue;
    CPU_SET(core, &some);
    --threads;
  }
  return some;
}

std::vector<char*> Pointers(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

std::vector<std::string> Environment(const std::vector<std::string>& changes) {
  std::vector<std::string> environment = changes;
  for (char** entry = environ; *entry; ++entry) {
    const std::string text = *entry, name = text.substr(0, text.find('=') + 1);
    bool changed = false;
    for (const std::string& change : changes) changed = changed || change.starts_with(name);
    if (!changed) environment.push_back(text);
  }
  return environment;
}

void KillGroup(pid_t child) {
  ::kill(-child, SIGKILL);
  ::kill(child, SIGKILL);  // in case it had no time to found its group
  while (::waitpid(child, nullptr, 0) < 0 && errno == EINTR) {
  }
}

}  // namespace

fs::path FindProgram(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path program = fs::path(folder) / name;
    std::error_code none;
    if (fs::is_regular_file(program, none) && ::access(program.c_str(), X_OK) == 0) return program;
  }
  return {};
}

int RunChild(const fs::path& program, const std::vector<std::string>& arguments, const ChildOptions& options) {
  // Everything that allocates comes before the fork: we have threads.
  std::vector<std::string> words{program.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<std::string> environment = Environment(options.environment);
  std::vector<char*> argv = Pointers(words), envp = Pointers(environment);
  const fs::path log = fs::absolute(options.log), folder = options.folder.empty() ? fs::current_path() : options.folder;
  const cpu_set_t cores = Cores(options.threads);
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  Require(child >= 0, "cannot start " + program.string() + ": " + std::strerror(errno));
  if (child == 0) {
    ::setpgid(0, 0);
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int out = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644), in = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (::getppid() != parent || out < 0 || in < 0 || ::dup2(in, 0) < 0 || ::dup2(out, 1) < 0 || ::dup2(out, 2) < 0 ||
        ::chdir(folder.c_str()) != 0)
      ::_exit(kNotStarted);
    if (options.threads > 0) ::sched_setaffinity(0, sizeof cores, &cores);
    ::execve(program.c_str(), argv.data(), envp.data());
    ::_exit(kNotStarted);
  }
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(options.timeout_s);
  int status = 0;
  for (pid_t done = 0; (done = ::waitpid(child, &status, WNOHANG)) != child;) {
    Require(done >= 0 || errno == EINTR, "lost sight of " + program.string() + ": " + std::strerror(errno));
    if (options.stop && *options.stop) {
      KillGroup(child);
      throw Error(program.filename().string() + " was interrupted");
    }
    if (std::chrono::steady_clock::now() >= end) {
      KillGroup(child);
      throw Error(fmt::format("{} {} took longer than {} s and was stopped", program.string(),
                              arguments.empty() ? "" : arguments.front(), options.timeout_s));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  ::kill(-child, SIGKILL);  // what it may have left behind
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  Require(code != kNotStarted, "cannot start " + program.string() + ": check that it is installed and executable");
  return code;
}

}  // namespace sole::app
