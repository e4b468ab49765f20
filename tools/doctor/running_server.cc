#include "hlm/tools/doctor/running_server.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <tuple>

#include <arpa/inet.h>
#include <nlohmann/json.hpp>

#include "hlm/common/one_line.h"
#include "hlm/common/settings/directories.h"
#include "hlm/haptic_server/operator_socket.h"
#include "hlm/haptic_server/report/state_file.h"
#include "hlm/protocol/transport/udp_socket.h"
#include "hlm/tools/doctor/run_folder.h"

namespace hlm::server {
namespace {

using nlohmann::json;

double now() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

std::optional<double> number_or_none(const json& value) {
  return value.is_number() ? std::optional(value.get<double>()) : std::nullopt;
}

/// 0 if there is none.
long port_of(const std::string& listen) {
  return std::strtol(listen.c_str() + listen.find(':') + 1, nullptr, 10);
}

/// Of "ADDRESS:PORT" in numbers, as a server writes it: no name is looked up.
std::optional<protocol::Endpoint> endpoint_of(const std::string& listen) {
  in_addr address{};
  const std::string host = listen.substr(0, listen.find(':'));
  if (inet_pton(AF_INET, host.c_str(), &address) != 1) return std::nullopt;
  const protocol::Endpoint endpoint{ntohl(address.s_addr),
                                    static_cast<std::uint16_t>(port_of(listen))};
  return protocol::to_string(endpoint) == listen ? std::optional(endpoint) : std::nullopt;
}

/// What a terminal can show.
std::string text(const json& value) { return one_line(value.get<std::string>()); }

/// Empty from servers of older versions, which do not say it.
std::string text_or_none(const json& object, const char* name) {
  return one_line(object.value(name, ""));
}

RunningServer parsed(const json& state) {
  const json& loop = state.at("loop");
  const json& device = state.at("device");
  RunningServer server;
  const json& process = state.at("process");
  server.process = process.is_number_integer() ? process.get<pid_t>() : 0;
  server.age = now() - state.at("written").get<double>();
  server.listen = text(state.at("listen"));
  server.capture = text_or_none(state, "capture");
  server.client = text_or_none(state, "client");
  server.state = text_or_none(state, "server");
  server.overruns = state.value("overruns", 0.0);
  server.load = state.value("load", 0.0);
  server.fault = one_line(state.value("fault", "none"));
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
  server.device = text(device.at("name"));
  server.health = text(device.at("health"));
  server.max_force = number_or_none(device.at("max_force")).value_or(0);
  server.halts = device.at("halts").get<bool>();
  server.time_guard = number_or_none(device.at("time_guard"));
  server.force = state.at("force").get<double>();
  for (const json& link : state.at("chain")) {
    server.chain.push_back(
        {text(link.at("name")), text(link.at("value")), text(link.at("reason"))});
  }
  return server;
}

/// The process that is this server: whoever listens at its socket. Where that does not answer, or
/// is missing as in older versions, its word counts, as far as the process is the same user's. 0:
/// it is gone.
pid_t process_of(const RunFolder& folder, const RunFolder::Listener& listener, pid_t said) {
  if (listener.is_gone || listener.process > 0) return listener.process;
  return folder.owner_runs(said) ? said : 0;
}

/// Empty unless the folder's owner listens there, and says so in a file that can be read.
std::optional<RunningServer> find_in(const RunFolder& folder, const std::string& listen) {
  const auto endpoint = endpoint_of(listen);
  const auto state = folder.read(listen + kStateSuffix);
  if (!endpoint || !state || !folder.owner_has_port(*endpoint)) return std::nullopt;
  try {
    RunningServer server = parsed(json::parse(*state));
    if (server.listen != listen) return std::nullopt;
    const RunFolder::Listener listener = folder.listener(listen + kOperatorSocketSuffix);
    server.process = process_of(folder, listener, server.process);
    server.owner = folder.owner();
    server.folder = folder.path();
    return server.process > 0 ? std::optional(std::move(server)) : std::nullopt;
  } catch (const json::exception&) {  // No JSON, or of another version.
    return std::nullopt;
  }
}

}  // namespace

std::optional<RunningServer> find_running(const protocol::Endpoint& server) {
  if (!protocol::is_own_address(server)) return std::nullopt;
  for (const std::filesystem::path& directory : settings::runtime_directories()) {
    const RunFolder folder(directory);
    for (const std::uint32_t address : {server.address, 0u}) {
      if (auto found = find_in(folder, protocol::to_string({address, server.port}))) return found;
    }
  }
  return std::nullopt;
}

std::vector<RunningServer> find_all_running() {
  std::vector<RunningServer> all;
  for (const std::filesystem::path& directory : settings::runtime_directories()) {
    const RunFolder folder(directory);
    for (const std::string& name : folder.names(kStateSuffix)) {
      const std::string listen =
          name.substr(0, name.size() - std::string_view(kStateSuffix).size());
      if (auto found = find_in(folder, listen)) all.push_back(std::move(*found));
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
