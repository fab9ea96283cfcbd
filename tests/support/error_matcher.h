#pragma once

#include <exception>
#include <string>

#include "core/error.h"

namespace sole::testing_support {

/// Message of the sole::Error that `action` throws; a sentence that no test expects if it throws
/// none or another exception.
template <typename Action>
std::string ErrorOf(const Action& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  } catch (const std::exception& error) {
    return std::string("(another exception: ") + error.what() + ")";
  }
  return "(no error was thrown)";
}

}  // namespace sole::testing_support
