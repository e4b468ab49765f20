// Hand scripts, and the motion of the simulated device under them.
#include "hlm/haptic_server/device/hand_script.h"
#include "hlm/haptic_server/device/simulated_device.h"
#include "tests/fuzz/fuzz.h"

namespace hlm::fuzz {
namespace {

constexpr int kPeriods = 50;

void follow(const server::HandScript& script) {
  server::SimulatedDevice device({.freedom = server::DeviceFreedom::kSpatial}, script, 1e-3);
  for (int i = 0; i < kPeriods; ++i) {
    const auto state = device.read();
    demand(state && state->X_WD.p.allFinite() && state->X_WD.R.coeffs().allFinite() &&
               state->V_WD.allFinite(),
           "no hand moves the handle to nowhere");
    demand(device.write(Wrench::Zero()), "the device takes a command");
  }
  ++accepted;
}

void read(const std::string& path) {
  try {
    follow(server::read_hand_script(path));
  } catch (const std::runtime_error& error) {
    demand(is_one_line_about(path, error.what()), "an error is one line that names the file");
  }
}

}  // namespace
}  // namespace hlm::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return hlm::fuzz::give_file(data, size, hlm::fuzz::read);
}
