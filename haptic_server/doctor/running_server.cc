#include "hlm/doctor/running_server.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <tuple>

#include <nlohmann/json.hpp>

#include "hlm/settings/directories.h"
#include "hlm/transport/udp_socket.h"

namespace hlm::server {
namespace {

using nlohmann::json;

double now() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

std::optional<double> number_or_none(const json& value) {
  return value.is_number() ? std::optional(value.get<double>()) : std::nullopt;
}

RunningServer parsed(const json& state) {
  const json& loop = state.at("loop");
  const json& device = state.at("device");
  RunningServer server;
  server.process = state.at("process").get<pid_t>();
  server.age = now() - state.at("written").get<double>();
  server.listen = state.at("listen").get<std::string>();
  // Servers of older versions do not say these.
  server.capture = state.value("capture", "");
  server.client = state.value("client", "");
  server.state = state.value("server", "");
  server.overruns = state.value("overruns", 0.0);
  server.load = state.value("load", 0.0);
  server.fault = state.value("fault", "none");
  server.rate = state.at("rate").get<double>();
  server.session = state.at("session").get<bool>();
  server.silence = state.at("silence").get<double>();
  server.update_rate = number_or_none(state.at("update_rate"));
  server.contact_age = state.at("age").get<double>();
  server.datagrams = state.at("datagrams").get<double>();
  server.dropped = state.at("dropped").get<std::map<std::string, double>>();
  server.ticks = loop.at("ticks").get<double>();
  server.missed = loop.at("missed").get<double>();
  server.lateness_p50 = loop.value("lateness_p50", 0.0);
  server.lateness_p99 = loop.at("lateness_p99").get<double>();
  server.lateness_max = loop.at("lateness_max").get<double>();
  server.device = device.at("name").get<std::string>();
  server.health = device.at("health").get<std::string>();
  server.max_force = number_or_none(device.at("max_force")).value_or(0);
  server.halts = device.at("halts").get<bool>();
  server.time_guard = number_or_none(device.at("time_guard"));
  server.force = state.at("force").get<double>();
  for (const json& link : state.at("chain")) {
    server.chain.push_back({link.at("name").get<std::string>(), link.at("value").get<std::string>(),
                            link.at("reason").get<std::string>()});
  }
  return server;
}

/// Empty if the file is none, is of another version, or is left from a server that is gone.
std::optional<RunningServer> read_state(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) return std::nullopt;
  try {
    RunningServer server = parsed(json::parse(file));
    const bool lives = kill(server.process, 0) == 0 || errno == EPERM;
    return lives ? std::optional(std::move(server)) : std::nullopt;
  } catch (const json::exception&) {
    return std::nullopt;
  }
}

/// 0 if there is none.
long port_of(const std::string& listen) {
  return std::strtol(listen.c_str() + listen.find(':') + 1, nullptr, 10);
}

}  // namespace

std::optional<RunningServer> find_running(const protocol::Endpoint& server) {
  if (!protocol::is_own_address(server)) return std::nullopt;
  for (const std::filesystem::path& directory : settings::runtime_directories()) {
    for (const std::uint32_t address : {server.address, 0u}) {
      const std::string name = protocol::to_string({address, server.port}) + ".json";
      if (auto found = read_state(directory / name)) return found;
    }
  }
  return std::nullopt;
}

std::vector<RunningServer> find_all_running() {
  std::vector<RunningServer> all;
  for (const std::filesystem::path& directory : settings::runtime_directories()) {
    std::error_code error;
    for (std::filesystem::directory_iterator file(directory, error), end; !error && file != end;
         file.increment(error)) {
      if (file->path().extension() != ".json") continue;
      if (auto found = read_state(file->path())) all.push_back(std::move(*found));
    }
  }
  // A directory may be found twice, by its variable and as a user's.
  const auto key = [](const RunningServer& s) {
    return std::tuple(port_of(s.listen), s.listen, s.process);
  };
  const auto less = [&](const auto& a, const auto& b) { return key(a) < key(b); };
  const auto same = [&](const auto& a, const auto& b) { return key(a) == key(b); };
  std::sort(all.begin(), all.end(), less);
  all.erase(std::unique(all.begin(), all.end(), same), all.end());
  return all;
}

}  // namespace hlm::server
