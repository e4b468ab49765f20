// What a server recorded of itself, tick by tick.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "hlm/haptic_server/journal.h"
#include "hlm/protocol/messages.h"
#include "hlm/protocol/transport/capture.h"

namespace hlm::server {

/// A welcome, and the session that it granted.
struct GrantedSession {
  std::uint64_t id = 0;
  protocol::Welcome welcome;
};

/// A tick of a recording: what came, and what was answered.
struct RecordedTick {
  TickNote note;
  std::vector<protocol::Datagram> received;
  std::optional<GrantedSession> granted;      ///< Session granted by this tick.
  std::vector<protocol::ProxyState> answers;  ///< Answers of session `session`.
  std::uint64_t session = 0;
};

/// Reads the capture that haptic_server --record has written, once.
class Recording {
 public:
  /// Empty if the capture holds no notes of a server: another program has written it. Throws what
  /// CaptureReader throws.
  static std::optional<Recording> open(const std::filesystem::path& path);

  const DeviceNote& device() const noexcept { return device_; }
  /// The next tick that did anything; false at the end. What follows the last note is left out: the
  /// tick that it belongs to is not known.
  bool next(RecordedTick& tick);

 private:
  Recording(protocol::CaptureReader capture, const DeviceNote& device, protocol::Endpoint server)
      : capture_(std::move(capture)), device_(device), server_(server) {}
  void take(const protocol::CapturedDatagram& datagram, RecordedTick& tick);

  protocol::CaptureReader capture_;
  DeviceNote device_;
  protocol::Endpoint server_;
  std::vector<std::uint64_t> granted_;
};

}  // namespace hlm::server
