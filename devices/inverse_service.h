// The line to Haply's Inverse Service: a WebSocket.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "hlm/devices/device_lock.h"
#include "hlm/devices/exchange_device.h"
#include "hlm/devices/haply_messages.h"

namespace hlm::server {

/// Which device, and how the service is asked.
struct InverseServiceOptions {
  std::string address = "localhost:10001";  ///< Also as "ws://localhost:10001/".
  int events = 10020;    ///< Port of the same host where it tells what happens; 0: not asked.
  bool settings = true;  ///< Whether its settings that change forces are asked for, by HTTP.
  std::string device{};  ///< Id of the device; empty: the only one.
  std::string grip{};    ///< Id of the grip; empty: the only one, if there is one; "none".
  std::string handedness = "any";  ///< "left" or "right": the device must be that.
  /// What it calls a force: "vector", "values", or "auto": by what it says of itself, and the other
  /// one if it takes none so.
  std::string force_field = "auto";
};

/// HOST:PORT of an address, without "ws://" and what follows.
std::string host_and_port(const std::string& address);

/// The device and its grip. Throws std::runtime_error that names the one that is not there, and
/// those that are.
HaplyChoice choose(const HaplyInventory& inventory, const InverseServiceOptions& options);
/// The options that choose the same again, and nothing else: also no grip, where there was none.
InverseServiceOptions choosing(const HaplyChoice& choice, InverseServiceOptions options);

/// No two processes have one device of one service.
class InverseService final : public DeviceLine {
 public:
  explicit InverseService(InverseServiceOptions options);
  ~InverseService() override;

  /// What the service at HOST:PORT says of its devices. Throws std::runtime_error that says what is
  /// missing and where it comes from.
  static HaplyInventory ask_inventory(const std::string& address);

  void open() override;
  void close() noexcept override;
  void send(const std::optional<Vector3>& force) override;
  void expect_silence() override;
  std::optional<HandleState> receive(SteadyTime deadline) override;
  /// Sends a request for no force on the connection that a forked process inherits: while that
  /// lives. A service that was started again after the fork is not reached from there.
  void halt() noexcept override;
  const char* warning_after_reopening() const noexcept override;

 private:
  class Connection;

  void observe_force(const std::optional<Vector3>& taken);
  void observe_events() noexcept;
  void observe(const HaplyEvent& event);
  void say_scales(const std::string& host) const;

  InverseServiceOptions options_;
  HaplyChoice choice_;
  DeviceLock lock_;
  std::unique_ptr<Connection> connection_;
  std::unique_ptr<Connection> events_;  ///< Null: the service has no such port.
  std::string force_field_;             ///< As it is called in requests now.
  bool may_switch_ = false;             ///< The other name was not tried.
  Vector3 sent_ = Vector3::Zero();      ///< Latest force, N.
  SteadyTime untaken_since_{};          ///< Since when it says that it takes none.
  SteadyTime events_at_{};              ///< When it was asked for events.
  const char* brake_ = nullptr;         ///< Why an event says that motors are off.
  std::string no_force_;                ///< Whole WebSocket frames.
  std::atomic<int> socket_ = -1;        ///< Socket of the connection, for halt().
  HaplyState said_;                     ///< What the service said last.
  bool names_itself_ = false;           ///< The next request names this session.
  HandleState latest_;  ///< Latest state, with the time below, for the angular velocity.
  SteadyTime latest_at_{};
};

}  // namespace hlm::server
