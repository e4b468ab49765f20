// Messages of Haply's Inverse Service: any text as inventory and as state.
#include <stdexcept>
#include <string_view>

#include "hlm/devices/haply_messages.h"
#include "tests/fuzz/fuzz.h"

namespace hlm::fuzz {
namespace {

/// Whether it is taken.
template <class Parse>
bool parses(Parse parse) {
  try {
    parse();
    return true;
  } catch (const std::runtime_error& error) {
    demand(is_one_line_about("the Inverse Service's message", error.what()),
           "an error is one line that names the message");
    return false;
  }
}

}  // namespace
}  // namespace hlm::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace hlm;
  const std::string_view message(reinterpret_cast<const char*>(data), size);
  fuzz::parses([&] { server::parse_haply_inventory(message); });
  fuzz::parses([&] { server::parse_haply_event(message); });
  const bool is_state = fuzz::parses([&] {
    const server::HaplyState whole =
        server::parse_haply_state(message, {"A", "G", "wireless_verse_grip"});
    const server::HandleState& state = whole.handle;
    fuzz::demand(state.X.p.allFinite() && state.V.allFinite() && state.X.R.coeffs().allFinite(),
                 "a state is finite");
  });
  if (is_state) ++fuzz::accepted;
  return 0;
}
