// What decided the steps of a recorded session besides its datagrams: notes of the server to
// itself, in its capture. PROTOCOL.md, "In a recording", gives their bytes.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/loop/periodic_loop.h"
#include "hlm/haptic_server/loop/servo.h"
#include "hlm/protocol/datagram_link.h"
#include "hlm/protocol/transport/recording_link.h"

namespace hlm::server {

/// The device of a recording. Its note is the first of a capture.
struct DeviceNote {
  DeviceRatings ratings;
  bool measures_hand = false;
  bool observes_hand = false;
};

/// One tick: the datagrams since the note before it are those that it received and sent.
struct TickNote {
  std::uint64_t tick = 0;                  ///< Periods since the loop began.
  double begin = 0;                        ///< s since the loop began.
  std::uint64_t missed = 0;                ///< Periods missed just before this tick.
  Intervention act = Intervention::kNone;  ///< From the device's machine, before this tick.
  std::uint64_t lost = 0;  ///< Datagrams and notes missing in the capture up to here.
  DeviceExchange device = {};
  protocol::RecordingLink::Channels received = {};  ///< Channels of the received datagrams.
  SceneExchange scene = {};
};

protocol::DatagramBytes encode(const DeviceNote& note) noexcept;
protocol::DatagramBytes encode(const TickNote& note) noexcept;

/// Whether the bytes are a note of that kind, which is then in `note`.
bool decode(std::span<const std::byte> bytes, DeviceNote& note) noexcept;
bool decode(std::span<const std::byte> bytes, TickNote& note) noexcept;

/// Notes the device in whose sessions what `link` carries is heard.
void note_device(protocol::RecordingLink& link, const Device& device) noexcept;
/// Notes the tick that servo has just done, if that did anything: also the one that ends a session
/// by itself.
void note_tick(protocol::RecordingLink& link, const Timing& timing, Intervention act,
               const Servo& servo) noexcept;

}  // namespace hlm::server
