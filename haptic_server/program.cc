#include "haptic_server/program.h"

#include <csignal>
#include <exception>
#include <iostream>
#include <stdexcept>

#include "protocol/transport/udp_socket.h"

namespace hlm::server {

int run_program(const char* name, CLI::App& app, int argc, char** argv,
                const std::function<int()>& body) {
  try {
    app.parse(argc, argv);
    return body();
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    std::cerr << name << ": " << error.what() << '\n';
    return kUsage;
  } catch (const std::exception& error) {
    std::cerr << name << ": " << error.what() << '\n';
    return kFailed;
  }
}

protocol::Endpoint resolve_option(const std::string& host_port) {
  try {
    return protocol::resolve(host_port);
  } catch (const std::runtime_error& error) {
    throw CLI::ValidationError(error.what());
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
