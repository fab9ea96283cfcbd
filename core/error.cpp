#include "core/error.h"

namespace sole {

void Require(bool condition, const std::string& message) {
  if (!condition) throw Error(message);
}

}  // namespace sole
