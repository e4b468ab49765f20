// What the user sets of the server, from the command line or a configuration file.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hlm/common/settings/command_line.h"
#include "hlm/haptic_server/device/device_choice.h"
#include "hlm/haptic_server/loop/periodic_loop.h"
#include "hlm/haptic_server/loop/realtime.h"
#include "hlm/haptic_server/loop/servo.h"

namespace hlm::server {

/// Everything that shapes the physics: two servers with equal options and equal contact packets
/// move their proxies bit for bit alike.
struct PhysicsOptions {
  ServoOptions servo;
  DeviceChoice device;
};

struct ServerOptions {
  PhysicsOptions physics;
  std::string listen = "127.0.0.1:47800";  ///< ADDRESS:PORT.
  int instance = 0;                        ///< Added to that port.
  std::string key_file;                    ///< Empty: datagrams are not sealed.
  bool insecure = false;                   ///< Without a key at any address.
  bool without_time_guard = false;         ///< With a device that has none.
  bool unattended = false;                 ///< Nobody is at the device: a simulated one.
  RealtimeOptions realtime;
  PeriodicLoopOptions loop;  ///< Loop options; their rate is the servo's.
  std::string record;        ///< Capture file; empty: none.
  std::string log;           ///< Tick log, CSV; empty: none.
  std::string recordings;    ///< Directory of the flight recorder; empty: the state directory.
  int keep_recordings = 20;  ///< 0: no flight recorder.
  double duration = 0;       ///< s; 0: until stopped.
  int parent = 0;            ///< Process whose end ends this one; 0: none.
  std::string log_level = "info";
  bool status = true;  ///< Whether the status line is shown.
};

/// Adds the options of one group to a command line, bound to the given value, which must outlive
/// it.
void add_options(settings::CommandLine& command_line, PhysicsOptions& options);
void add_options(settings::CommandLine& command_line, ServerOptions& options);

/// Throws settings::UsageError naming the option, its value and its range if options cannot be used
/// together.
void check(const PhysicsOptions& options);
void check(const ServerOptions& options);

/// Lowers the stiffness that this device does not support, unless `options` keep it. Returns a
/// sentence for a person that says so; empty if nothing was lowered.
std::optional<std::string> suit_to(const Device& device, PhysicsOptions& options);

/// Throws settings::UsageError if the device keeps its last command for ever when nobody renews it,
/// unless `options` put up with that.
void check_time_guard(const Device& device, const ServerOptions& options);

/// What is doubtful about options on this device: sentences for a person.
std::vector<std::string> doubts_about(const PhysicsOptions& options, const Device& device);

/// What a replay must share with the recording, for the welcome: a hash of the servo's options, of
/// the device's ratings, of all its keys and of the hand script's text.
std::uint64_t fingerprint(const PhysicsOptions& options, const Device& device);

}  // namespace hlm::server
