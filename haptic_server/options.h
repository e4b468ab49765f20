// What the user sets of the server, from the command line or a configuration file.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "common/vocabulary.h"
#include "haptic_server/device/simulated_device.h"
#include "haptic_server/loop/periodic_loop.h"
#include "haptic_server/loop/realtime.h"
#include "haptic_server/loop/servo.h"

namespace hlm::server {

enum class DeviceKind {
  kSimulated,  ///< An impedance device and the hand on it, simulated.
  kReplay,     ///< Plays back the device of a recorded tick log.
};

}  // namespace hlm::server

namespace hlm {

template <>
inline constexpr std::array<Word<server::DeviceKind>, 2> kWords<server::DeviceKind>{{
    {server::DeviceKind::kSimulated, "simulated", "an impedance device and the hand on it"},
    {server::DeviceKind::kReplay, "replay", "the device of a recorded tick log"},
}};

}  // namespace hlm

namespace hlm::server {

/// Everything that shapes the physics: two servers with equal options and equal contact packets
/// move their proxies bit for bit alike.
struct PhysicsOptions {
  ServoOptions servo;
  DeviceKind device = DeviceKind::kSimulated;
  SimulatedDeviceOptions simulated;
  std::string hand;        ///< Hand script of the simulated device, TOML; empty: no hand.
  std::string device_log;  ///< Tick log that the replay device plays.
};

struct ServerOptions {
  PhysicsOptions physics;
  std::string listen = "127.0.0.1:47800";  ///< ADDRESS:PORT.
  RealtimeOptions realtime;
  PeriodicLoopOptions loop;  ///< Its rate is the servo's.
  std::string record;        ///< Capture file; empty: none.
  std::string log;           ///< Tick log, CSV; empty: none.
  double duration = 0;       ///< s; 0: until stopped.
  std::string log_level = "info";
  bool status = true;  ///< Whether the status line is shown.
};

/// Adds the options of one group to a command line, bound to the given value.
void add_options(CLI::App& app, PhysicsOptions& options);
void add_options(CLI::App& app, ServerOptions& options);

/// Adds --config and --print-config.
void add_configuration_file(CLI::App& app, bool& print_config);

/// Why options cannot be used, naming the option, its value and its range; empty if valid.
std::optional<std::string> find_error(const PhysicsOptions& options);
std::optional<std::string> find_error(const ServerOptions& options);

/// FNV-1a hash of all physics options and of the hand script's text: what a replay must share with
/// the recording.
std::uint64_t fingerprint(const PhysicsOptions& options);

/// The device that the options describe. Throws std::runtime_error naming the file that cannot be
/// used.
std::unique_ptr<Device> make_device(const PhysicsOptions& options);

}  // namespace hlm::server
