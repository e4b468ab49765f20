// A server whose device is a stand-in that a hand pushes, and the programs around it.
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "tests/system/session.h"

namespace hlm::test {

/// From the first symptom to motors without force, s; the machine may stall for a while beside.
inline constexpr double kMostUntilOff = 0.02;
inline constexpr double kStall = 0.015;

/// The stand-ins' environment is that of this process: one of these at a time.
class StandInSession {
 public:
  /// The hand's wrench: the value of `wrench` in a hand script.
  explicit StandInSession(const std::string& wrench);

  /// A path in a folder of the session's own.
  std::string file(const std::string& name) const { return directory_.file(name); }
  /// Starts haptic_server, at 1 kHz; it listens.
  void serve(const Arguments& options);
  /// What a person does who restarts ve_client.
  void arm(const Arguments& options = {});
  /// Waits until the force along y stays within that share of `force`, N, for 0.2 s.
  void press(double force, double share = 0.1);
  void order(const std::string& line) const;
  /// Force of the motors along y, N.
  double motor() const;
  /// How long the motors still have force, s, up to 5.
  double time_until_off() const;
  Process& server() { return *server_; }

 private:
  TemporaryDirectory directory_;
  int port_ = free_port();
  std::optional<Process> server_;
  std::optional<Process> client_;
};

}  // namespace hlm::test
