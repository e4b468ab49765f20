// The servo: one tick of local model, controller and device.
//
// The same tick runs with a real clock over UDP, in virtual time over an in-memory link, and on a
// recorded stream: clock, link and device are arguments. Nothing in it allocates, locks, logs,
// throws or waits.
#pragma once

#include <cstdint>
#include <optional>

#include "hlm/haptic_server/control/controller.h"
#include "hlm/haptic_server/control/engine_view.h"
#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/local_model/local_model.h"
#include "hlm/haptic_server/loop/clocks.h"
#include "hlm/haptic_server/loop/port.h"
#include "hlm/haptic_server/loop/scene_use.h"
#include "hlm/haptic_server/loop/servo_options.h"
#include "hlm/haptic_server/loop/session.h"
#include "hlm/haptic_server/loop/telemetry.h"
#include "hlm/haptic_server/loop/timing.h"
#include "hlm/haptic_server/report/tick_record.h"
#include "hlm/haptic_server/safety/state_machine.h"
#include "hlm/protocol/server_session.h"

namespace hlm::server {

class Servo {
 public:
  /// `options` must be valid; link, device and scenes must outlive the servo. fingerprint:
  /// of all options that shape the physics, for the welcome. scenes: null: clients send none.
  Servo(const ServoOptions& options, std::uint64_t fingerprint, protocol::ServerSession& link,
        Device& device, SceneSource* scenes = nullptr) noexcept;

  /// One tick. Returns its signals except `execution`, which the caller measures.
  const TickRecord& tick(const Timing& timing) noexcept;

  /// What comes from the device's machine; before each tick, from their thread.
  void obey(Intervention intervention) noexcept;

  /// The exchange in the latest tick.
  const DeviceExchange& exchange() const noexcept { return port_.exchange(); }
  /// Whether there was a session when it began, or when it ended.
  bool had_session() const noexcept { return had_session_; }
  /// The scene state of the latest tick.
  const SceneExchange& scene_exchange() const noexcept { return scene_.exchange(); }

  /// Zero force, device off, goodbye to the client.
  void shut_down(double now) noexcept;

  /// Empty without a session.
  const std::optional<LocalModel>& local_model() const noexcept { return model_; }

 private:
  // A session.
  void begin_session(const protocol::Hello& hello, double now) noexcept;
  void reject_in_fault(double now) noexcept;
  void advance_session(const protocol::ServerSession::Inbox& inbox, const Timing& timing) noexcept;
  void hear(const protocol::ContactUpdate& update) noexcept;
  bool waits_for_scene(const protocol::ContactUpdate& update) const noexcept;
  double silence_time(double period) const noexcept;
  void look_at_clocks(const Timing& timing) noexcept;
  void end_what_is_over(ServerState before) noexcept;

  // What the client says.
  void apply(const protocol::Control& control) noexcept;
  void adopt(const protocol::ContactUpdate& update) noexcept;

  // A step.
  void miss(const Timing& timing) noexcept;
  void simulate() noexcept;
  ContactWrench move_proxy(const DeviceState& device) noexcept;
  ContactWrench step_proxy(const DeviceState& device) noexcept;
  bool is_plausible(const DeviceState& device) const noexcept;
  Fault render(const DeviceState& device, const ContactWrench& felt) noexcept;
  void fail(Fault fault, const char* why = "") noexcept;

  // What is said of it.
  void describe_tick(const Timing& timing) noexcept;
  void acknowledge(double now) noexcept;

  bool has_scene() const noexcept { return model_ && model_->scene() != nullptr; }

  ServoOptions options_;  ///< Options as started; the members below have what a control changed.
  std::uint64_t fingerprint_;
  protocol::ServerSession& link_;
  Port port_;
  SceneUse scene_;
  Clocks clocks_;
  SafetyStateMachine machine_;
  Session session_;
  std::optional<LocalModel> model_;
  Controller controller_;
  EngineView engine_;
  Telemetry telemetry_;
  bool had_session_ = false;
  const char* cause_ = "";  ///< Why the fault came, where more is known than its name says.
  TickRecord record_;
};

}  // namespace hlm::server
