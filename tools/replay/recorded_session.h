// The sessions that a capture holds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <vector>

#include "hlm/protocol/codec.h"
#include "hlm/protocol/messages.h"

namespace hlm::server {

struct RecordedUpdate {
  std::int64_t time_ns = 0;  ///< When its first part passed, ns since the epoch.
  std::uint64_t sequence = 0;
  std::vector<protocol::DatagramBytes> parts;  ///< Wire format, in order; perhaps incomplete.
};

struct RecordedChunk {
  std::int64_t time_ns = 0;  ///< When it first passed, ns since the epoch.
  protocol::ChunkData data;
};

struct RecordedSession {
  std::uint64_t id = 0;
  std::int64_t time_ns = 0;  ///< When it was granted, ns since the epoch.
  protocol::Endpoint client;
  protocol::Hello hello;
  std::vector<protocol::DatagramBytes> hello_parts;  ///< Parts as on the wire.
  protocol::Welcome welcome;
  std::vector<RecordedUpdate> updates;  ///< Updates in the order of their first parts.
  std::map<std::uint64_t, protocol::DatagramBytes> controls;  ///< In wire format, by sequence.
  std::vector<protocol::ProxyState> acknowledgements;
  std::map<std::uint64_t, RecordedChunk> chunks = {};  ///< Chunks of the scene stream, by number.

  /// What the chunks carry, up to the first that the capture does not hold.
  std::vector<std::byte> scene_stream() const;
};

/// All sessions of a capture that were granted, in order. Datagrams that are not of the protocol
/// are skipped, and so are acknowledgements of steps that no server can have come to by their time.
/// Throws std::runtime_error naming the file if it cannot be read, is not a capture or
/// holds no session.
std::vector<RecordedSession> read_sessions(const std::filesystem::path& path);

}  // namespace hlm::server
