#pragma once

#include <stdexcept>
#include <string>

namespace sole {

/// What a user can mend: a bad file, a missing camera, an impossible value. The message is one line that
/// says what is wrong, where, and what to do. `sole` prints it and exits with status 1.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Throws Error with `message` unless `condition` holds.
void Require(bool condition, const std::string& message);

}  // namespace sole
