#include "hlm/haptic_server/program.h"

#include <csignal>
#include <exception>
#include <iostream>
#include <stdexcept>

#include "hlm/common/one_line.h"
#include "hlm/protocol/sealing/key_file.h"
#include "hlm/protocol/transport/udp_socket.h"

namespace hlm::server {

int run_program(const char* name, settings::CommandLine& command_line,
                const PhysicsOptions& options, int argc, const char* const* argv,
                const std::function<void()>& check, const std::function<int()>& body) {
  const auto fail = [name](const std::exception& error, int status) {
    std::cerr << name << ": " << one_line(error.what()) << '\n';
    return status;
  };
  try {
    if (const auto code = command_line.parse(argc, argv, check)) return *code;
    if (const auto information = options.device.information()) {
      std::cout << *information;
      return kOk;
    }
    return body();
  } catch (const settings::UsageError& error) {
    return fail(error, kUsage);
  } catch (const std::exception& error) {
    return fail(error, kFailed);
  }
}

protocol::Endpoint resolve_option(const std::string& option, const std::string& host_port) {
  try {
    return protocol::resolve(host_port);
  } catch (const std::runtime_error& error) {
    throw settings::UsageError(option + ' ' + host_port + ": " + error.what() +
                               "; for example 127.0.0.1:47800");
  }
}

std::optional<protocol::noise::Key> read_key_option(const std::string& path) {
  if (path.empty()) return std::nullopt;
  try {
    return protocol::read_key(path);
  } catch (const std::runtime_error& error) {
    throw settings::UsageError(error.what());
  }
}

void handle_signals(void (*stop)(int)) {
  struct sigaction stopping {};
  stopping.sa_handler = stop;
  for (const int signal : {SIGINT, SIGQUIT, SIGTERM}) sigaction(signal, &stopping, nullptr);

  struct sigaction before {};
  sigaction(SIGHUP, nullptr, &before);
  if (before.sa_handler != SIG_IGN) sigaction(SIGHUP, &stopping, nullptr);

  struct sigaction ignoring {};
  ignoring.sa_handler = SIG_IGN;
  for (const int signal : {SIGPIPE, SIGXFSZ}) sigaction(signal, &ignoring, nullptr);
}

}  // namespace hlm::server
