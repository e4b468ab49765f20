#include "tests/experiments/method.h"

#include <stdexcept>
#include <string>

namespace hlm::experiments {

const Method& method(std::string_view name) {
  std::string known;
  for (const Method& candidate : kMethods) {
    if (candidate.name == name) return candidate;
    known.append(known.empty() ? "" : ", ").append(candidate.name);
  }
  throw std::runtime_error("method '" + std::string(name) + "' must be one of " + known);
}

}  // namespace hlm::experiments
