// A recorded session on the server's own tick, in virtual time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/loop/servo.h"
#include "hlm/tools/replay/recorded_session.h"
#include "hlm/tools/replay/recording.h"

namespace hlm::server {

struct OfflineResult {
  std::uint64_t session = 0;
  std::uint64_t fingerprint = 0;  ///< The recording server's options, as its welcome says.
  std::uint64_t steps = 0;        ///< Steps of the session.
  std::size_t compared = 0;       ///< Acknowledged states.
  std::size_t equal = 0;          ///< States of these that are equal bit for bit, as recorded.
  /// What the recording lacks that was played: updates that are not whole in the capture; datagrams
  /// and notes for which the recorder had no time.
  std::uint64_t incomplete = 0;
  /// Step of the first state that differs.
  std::optional<std::uint64_t> first_difference;
  /// The first scene that was in force in the recording and cannot be made, and why; empty if there
  /// is none.
  std::string missing_scene = {};
};

/// The servo has just done that tick.
using ObserveTick = std::function<void(const TickRecord&, const Servo&)>;

/// Plays all that a server has recorded, tick by tick: every session that was granted, with fades,
/// faults, floods, missed ticks and stops, on the device's recorded states or, if it is given,
/// `instead` of the recorded device. `options` and `fingerprint` must be as in the recording. With
/// `late` > 0 all that came from the client comes so many periods later, and nothing is compared.
std::vector<OfflineResult> replay_offline(Recording& recording, const ServoOptions& options,
                                          std::uint64_t fingerprint, Device* instead,
                                          const ObserveTick& observe, std::uint64_t late = 0);

/// The same with what a client, or somebody between, has captured of one session: each update at
/// the step that adopted it, as its acknowledgement says. What else decided a step is not in such a
/// capture, so that a fade, or a device other than the simulated one, is not played as it was. A
/// scene comes into force at the first step whose acknowledgement names it.
OfflineResult replay_offline(const RecordedSession& session, const ServoOptions& options,
                             std::uint64_t fingerprint, Device& device, const ObserveTick& observe);

/// A device that does what was recorded of it.
class RecordedDevice final : public Device {
 public:
  explicit RecordedDevice(const DeviceNote& note) noexcept : note_(note) {
    note_.ratings.halts = true;  // It has no motors.
  }

  /// What it does in the next tick.
  void set(const DeviceExchange& exchange) noexcept { exchange_ = exchange; }

  std::string_view name() const noexcept override { return "recorded device"; }
  const DeviceRatings& ratings() const noexcept override { return note_.ratings; }
  bool measures_hand_wrench() const noexcept override { return note_.measures_hand; }
  bool observes_hand_wrench() const noexcept override { return note_.observes_hand; }
  void align(const Pose&) noexcept override {}
  void enable() noexcept override {}
  void disable() noexcept override {}
  std::optional<DeviceState> read() noexcept override { return exchange_.state; }
  bool write(const Wrench&) noexcept override { return exchange_.written; }

 private:
  DeviceNote note_;
  DeviceExchange exchange_;
};

}  // namespace hlm::server
