#pragma once

#include <sys/wait.h>

#include <algorithm>
#include <cstdio>
#include <string>

namespace sole::testing_support {

struct ProgramResult {
  int status = -1;
  std::string output;  ///< stdout and stderr

  /// Lines that start with "sole: ", which is how the program reports an error.
  int ErrorLines() const {
    int count = output.starts_with("sole: ") ? 1 : 0;
    for (std::size_t at = 0; (at = output.find("\nsole: ", at)) != std::string::npos; ++at) ++count;
    return count;
  }
};

/// Runs the program `sole` with these arguments through the shell, after the shell command `before`.
inline ProgramResult RunSole(const std::string& arguments, const std::string& before = ":") {
  ProgramResult result;
  FILE* pipe = popen((before + "; exec " + SOLE_PROGRAM + " " + arguments + " 2>&1 < /dev/null").c_str(), "r");
  if (!pipe) return result;
  char buffer[4096];
  while (const std::size_t count = fread(buffer, 1, sizeof buffer, pipe)) result.output.append(buffer, count);
  const int status = pclose(pipe);
  result.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return result;
}

}  // namespace sole::testing_support
