// Capture files: the datagrams in them, the sessions that these make, and their replay.
#include "hlm/haptic_server/device/simulated_device.h"
#include "hlm/protocol/transport/capture.h"
#include "hlm/tools/replay/offline_replay.h"
#include "tests/fuzz/fuzz.h"

namespace hlm::fuzz {
namespace {

/// Of one session: more take time and show no more.
constexpr std::uint64_t kMostSteps = 500;

void replay(const server::RecordedSession& session) {
  if (!session.acknowledgements.empty() && session.acknowledgements.back().step > kMostSteps)
    return;
  server::SimulatedDevice device({}, {}, 1e-3);
  const auto result = server::replay_offline(
      session, {}, 0, device, [](const server::TickRecord& record, const server::Servo&) {
        demand(record.F_command.allFinite(), "a command is finite");
      });
  demand(result.equal <= result.compared, "no more states are equal than there are");
  ++accepted;
}

void play(server::Recording& recording) {
  for (const server::OfflineResult& result : server::replay_offline(
           recording, {}, 0, nullptr, [](const server::TickRecord&record, const server::Servo&) {
             demand(record.F_command.allFinite(), "a command is finite");
           })) {
    demand(result.equal <= result.compared, "no more states are equal than there are");
  }
}

void read(const std::string& path) {
  try {
    protocol::CaptureReader capture(path);
    while (const auto datagram = capture.next()) {
      demand(datagram->time_ns >= 0, "stamps are not negative");
      demand(datagram->bytes.size() <= protocol::kMaxDatagram, "datagrams have a largest size");
    }
    if (auto recording = server::Recording::open(path)) play(*recording);
    for (const server::RecordedSession& session : server::read_sessions(path)) replay(session);
  } catch (const std::runtime_error& error) {
    demand(is_one_line_about(path, error.what()), "an error is one line that names the file");
  }
}

}  // namespace
}  // namespace hlm::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return hlm::fuzz::give_file(data, size, hlm::fuzz::read);
}
