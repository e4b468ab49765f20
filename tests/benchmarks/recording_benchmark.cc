// What --record adds to a tick: its note, and the datagrams that pass, into the ring that another
// thread writes.
#include <benchmark/benchmark.h>

#include "hlm/haptic_server/journal.h"
#include "hlm/protocol/transport/capture.h"
#include "hlm/protocol/transport/memory_network.h"
#include "hlm/protocol/transport/recording_link.h"

namespace hlm::server {
namespace {

void RecordTick(benchmark::State& state) {
  protocol::MemoryNetwork network;
  protocol::RecordingLink link(network.server(), protocol::MemoryNetwork::kServer);
  protocol::CaptureWriter nowhere("/dev/null");
  TickNote note;
  note.device.state.emplace();
  note.device.state->F_hand = Wrench::Zero();
  for (auto _ : state) {
    ++note.tick;
    link.note(protocol::view(encode(note)));
    if (note.tick % 1024 != 0) continue;
    state.PauseTiming();
    link.drain(nowhere);
    state.ResumeTiming();
  }
  if (link.lost() > 0) state.SkipWithError("the ring was full");
}
BENCHMARK(RecordTick)->Unit(benchmark::kNanosecond);

}  // namespace
}  // namespace hlm::server
