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
#include "hlm/haptic_server/loop/periodic_loop.h"
#include "hlm/haptic_server/loop/servo_options.h"
#include "hlm/haptic_server/loop/telemetry.h"
#include "hlm/haptic_server/report/tick_record.h"
#include "hlm/haptic_server/safety/energy_account.h"
#include "hlm/haptic_server/safety/limiter.h"
#include "hlm/haptic_server/safety/model_energy.h"
#include "hlm/haptic_server/safety/state_machine.h"
#include "hlm/haptic_server/scene/source.h"
#include "hlm/protocol/server_session.h"

namespace hlm::server {

/// What the device did in a tick: what a replay needs of it.
struct DeviceExchange {
  bool read = false;                 ///< It was read: there is a session.
  std::optional<DeviceState> state;  ///< Empty: it failed.
  bool written = true;               ///< It took the command.
};

/// Scene state of a tick, recorded for replay.
struct SceneExchange {
  std::uint32_t number = 0;  ///< Number of the scene in force, 0 none.
  std::uint32_t chunks = 0;  ///< Chunks of the scene stream that were handed on.

  bool operator==(const SceneExchange&) const = default;
};

class Servo {
 public:
  /// `options` must be valid; session, device and scenes must outlive the servo. fingerprint:
  /// of all options that shape the physics, for the welcome. scenes: null: clients send none.
  Servo(const ServoOptions& options, std::uint64_t fingerprint, protocol::ServerSession& session,
        Device& device, SceneSource* scenes = nullptr) noexcept;

  /// One tick. Returns its signals except `execution`, which the caller measures.
  const TickRecord& tick(const Timing& timing) noexcept;

  /// What comes from the device's machine; before each tick, from their thread.
  void obey(Intervention intervention) noexcept;

  /// The exchange in the latest tick.
  const DeviceExchange& exchange() const noexcept { return exchange_; }
  /// Whether there was a session when it began, or when it ended.
  bool had_session() const noexcept { return had_session_; }
  /// The scene state of the latest tick.
  const SceneExchange& scene_exchange() const noexcept { return scene_exchange_; }

  /// Zero force, device off, goodbye to the client.
  void shut_down(double now) noexcept;

  /// Empty without a session.
  const std::optional<LocalModel>& local_model() const noexcept { return local_model_; }

 private:
  void begin_session(const protocol::Hello& hello, double now) noexcept;
  void advance_session(const protocol::ServerSession::Inbox& inbox, const Timing& timing) noexcept;
  void hear(const protocol::ContactUpdate& update) noexcept;
  bool waits_for_scene(const protocol::ContactUpdate& update) const noexcept;
  void load_scene(const protocol::ServerSession::Inbox& inbox, const Timing& timing) noexcept;
  void use_scene(bool wanted) noexcept;
  void apply(const protocol::Control& control) noexcept;
  std::optional<double> travel_of(const protocol::ContactUpdate& update) const noexcept;
  double age_of(const protocol::ContactUpdate& update) const noexcept;
  double oldest_of(const protocol::ContactUpdate& update) noexcept;
  void adopt(const protocol::ContactUpdate& update) noexcept;
  void miss(std::uint64_t periods) noexcept;
  void simulate() noexcept;
  bool observe(const DeviceState& device) noexcept;
  ContactWrench move_proxy(const DeviceState& device) noexcept;
  ContactWrench step_proxy(const DeviceState& device) noexcept;
  void render(const DeviceState& device, const ContactWrench& felt) noexcept;
  bool has_scene() const noexcept { return local_model_ && local_model_->scene() != nullptr; }
  bool is_plausible(const DeviceState& device) const noexcept;
  double silence_time(double period) const noexcept;
  void reject_in_fault(double now) noexcept;
  void fail(Fault fault) noexcept;
  void acknowledge(double now) noexcept;

  ServoOptions options_;  ///< Options as started; the members below have what a control changed.
  double dt_;
  std::uint64_t fingerprint_;
  protocol::ServerSession& session_;
  Device& device_;
  SceneSource* scenes_;
  Controller controller_;
  Limiter limiter_;
  EnergyAccount energy_;
  double largest_force_;  ///< That the device gets, N.
  SafetyStateMachine machine_;

  std::optional<LocalModel> local_model_;
  Scene* scene_ = nullptr;        ///< The newest of the session.
  double late_ = 0;               ///< Time that a scene's ticks took beyond their period, s.
  double keeps_contacts_ = 0;     ///< Time for which contacts of a dropped scene are kept, s.
  double oldest_ = 0;             ///< Age at most of the latest update, s.
  bool counts_on_scene_ = false;  ///< The latest update leaves its contacts to a scene.
  EngineView engine_;
  Telemetry telemetry_;
  std::optional<double> shortest_travel_;  ///< Round trip of the session, s.
  double period_ = 0;                      ///< Period of the client's frames, as its hello says, s.
  std::uint64_t step_ = 0;                 ///< Periods of the session so far, missed ones, too.
  std::uint64_t updates_ = 0;              ///< Adopted in the session.
  Freedoms missing_freedoms_ = 0;  ///< Freedoms of the session's tool that the device lacks.
  double contained_impulses_ = 0;  ///< Step of the impulses in the state of the latest update.
  Pose X_WStart_;           ///< Pose of the handle, as the session began, or the clutch was let go.
  double lowered_ = 0;      ///< Share lowered by the control in effect, as in protocol::ProxyState.
  bool halted_ = false;     ///< The guard has taken the motors off since the tick before.
  bool unguarded_ = false;  ///< Nothing looks whether the loop goes on.
  double unguarded_time_ = 0;  ///< For how long in the session, s.
  bool clutched_ = false;      ///< Whether the device was clutched when last read.
  const char* cause_ = "";     ///< Why the device failed, in a fault of it.
  DeviceExchange exchange_;
  SceneExchange scene_exchange_;
  bool had_session_ = false;
  TickRecord record_;
};

}  // namespace hlm::server
