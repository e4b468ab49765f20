// The scene stream: any bytes as records, and any word of a server on what has come of it.
#include <cmath>
#include <cstring>
#include <vector>

#include "hlm/protocol/codec.h"
#include "hlm/protocol/scene_store.h"
#include "hlm/protocol/scene_stream.h"
#include "hlm/protocol/wire.h"
#include "tests/fuzz/fuzz.h"

namespace hlm::fuzz {
namespace {

using namespace protocol;
using Bytes = std::vector<std::uint8_t>;

/// Gives shapes the hashes of their bytes, and placements the latest shape, which a client that
/// means harm would do. Without it mutations seldom come farther.
void fit(Bytes& stream) {
  constexpr std::size_t kHeader = 5;
  constexpr std::size_t kHashed = 13;
  std::uint64_t latest = 0;
  for (std::size_t at = 0; stream.size() - at >= kHashed + 4;) {
    std::uint32_t length = 0;
    std::memcpy(&length, &stream[at + 1], sizeof length);
    if (length > stream.size() - at - kHeader) return;
    const std::size_t end = at + kHeader + length;
    if (stream[at] == 1 && end >= at + kHashed) {
      latest = fnv1a(std::as_bytes(std::span(stream)).subspan(at + kHashed, end - at - kHashed));
      std::memcpy(&stream[at + kHeader], &latest, sizeof latest);
    }
    if (stream[at] == 2 && length >= 12) std::memcpy(&stream[at + 9], &latest, sizeof latest);
    at = end;
  }
}

void demand_in_range(const SceneShape& shape) {
  demand(hash_of(shape) == shape.hash || shape.hash != 0, "a shape has a hash");
  demand(shape.size.allFinite() && shape.size.minCoeff() >= 0, "a shape's size is usable");
  for (const Vector3& vertex : shape.vertices) {
    demand(vertex.cwiseAbs().maxCoeff() <= kLargestLength, "a vertex is where things are");
  }
  for (const auto& triangle : shape.triangles) {
    for (const std::uint32_t corner : triangle) {
      demand(corner < shape.vertices.size(), "a corner is a vertex");
    }
  }
}
void demand_in_range(const ScenePlacement& placement) {
  demand(std::abs(placement.X_BS.R.norm() - 1) <= 1e-12, "a placement's quaternion is unit");
  demand(placement.X_BS.p.cwiseAbs().maxCoeff() <= kLargestLength, "a placement is near");
  demand(std::isfinite(placement.friction.coefficient) && is_known(placement.friction.rule) &&
             is_known(placement.side.kind),
         "it can be used");
}
template <class Record>
void demand_in_range(const Record&) {}

/// What was read can be written, and is read as the same.
void demand_same(const SceneRecord& record) {
  Bytes bytes;
  append(record, bytes);
  SceneRecordReader reader;
  reader.feed(std::as_bytes(std::span(bytes)));
  const auto again = reader.next();
  demand(again.has_value(), "what was read can be written");
  Bytes second;
  append(*again, second);
  demand(second == bytes, "what is written is read as the same");
}

void demand_consistent(const SceneStore& store) {
  for (const auto& [id, placement] : store.placements()) {
    demand(store.shape(placement.shape) != nullptr, "a placement has its shape");
  }
  for (const SceneApart& pair : store.apart()) {
    demand(store.placements().contains(pair.a) && store.placements().contains(pair.b),
           "pairs are of placements");
  }
  SceneState state;
  store.describe(state);
  SceneState told;
  demand(!decode(view(encode({.session = 1}, state)), told), "what is said of it can be sent");
  demand((state.error == SceneError::kNone) == state.text.empty(), "an error has words");
}

void read_records(Input& input) {
  const std::size_t piece = 1 + input.u8();
  const bool fitted = input.u8() % 2 == 1;
  const auto rest = input.take(SIZE_MAX);
  Bytes stream(rest.begin(), rest.end());
  if (fitted) fit(stream);
  const SceneLimits limits{.record_bytes = 65536, .placements = 20, .shape_bytes = 20000};
  SceneRecordReader reader(limits);
  SceneStore store(2, limits);
  const auto bytes = std::as_bytes(std::span(stream));
  for (std::size_t at = 0; at < bytes.size(); at += piece) {
    reader.feed(bytes.subspan(at, std::min(piece, bytes.size() - at)));
    while (auto record = reader.next()) {
      std::visit([](const auto& one) { demand_in_range(one); }, *record);
      demand_same(*record);
      accepted += store.apply(std::move(*record));
    }
  }
  if (reader.fault()) store.refuse(*reader.fault());
  demand(store.placements().size() <= limits.placements && store.bytes() <= limits.shape_bytes,
         "a store is within its limits");
  demand_consistent(store);
}

/// A sender to which a server says what it likes.
void hear(Input& input) {
  SceneSender sender;
  std::size_t queued = 0;
  double now = 0;
  while (!input.empty()) {
    now += 1e-3 * input.u8();
    const std::size_t size = input.u16() % 4096u;
    demand(sender.queue(Bytes(size)), "there is room");
    queued += size;
    std::uint64_t least = sender.first();
    const auto sent = sender.send(now, input.u8() % 32u, [&](const SceneChunk& chunk) {
      demand(chunk.number >= least && chunk.number < least + kSceneWindow, "it is in the window");
      demand(!chunk.data.empty(), "a chunk has data");
    });
    demand(sent < 32, "the budget is kept");
    SceneState state;
    state.next = input.u16() % 64u + (input.u8() % 8u == 0 ? ~std::uint64_t{0} - 32 : 0);
    for (std::uint64_t& word : state.bitmap) word = 0x9E3779B97F4A7C15 * input.u16();
    accepted += sender.receive(now, state);
    demand(sender.waiting() <= queued, "no more waits than was queued");
    demand(std::isfinite(sender.pace().round_trip()), "a round trip is finite");
  }
}

}  // namespace
}  // namespace hlm::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace hlm::fuzz;
  Input input(data, size);
  if (input.u8() % 4 == 3) {
    hear(input);
  } else {
    read_records(input);
  }
  return 0;
}
