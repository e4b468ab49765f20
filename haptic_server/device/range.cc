#include "haptic_server/device/range.h"

#include <cmath>
#include <sstream>

namespace hlm::server {

std::optional<std::string> find_error(std::string_view name, double value, const Range& range) {
  if (range.contains(value)) return std::nullopt;
  std::ostringstream text;
  text << name << ' ' << value << ' ' << range.unit << " must be ";
  if (std::isinf(range.high)) {
    text << "at least " << range.low;
  } else {
    text << range.low << " to " << range.high;
  }
  text << ' ' << range.unit;
  return text.str();
}

}  // namespace hlm::server
