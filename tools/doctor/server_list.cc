#include "hlm/tools/doctor/server_list.h"

#include <nlohmann/json.hpp>
#include <spdlog/fmt/fmt.h>

namespace hlm::server {
namespace {

constexpr const char* kNone =
    "No haptic_server runs on this machine as this user or as the service. Root sees those of all "
    "users.\n";
constexpr const char* kLegend =
    "Lateness and load, a share of one processor, are of the last second; missed are ticks since "
    "the start.\n";
constexpr double kMicroseconds = 1e6;

/// In a few words: the fault where there is one.
std::string state_of(const RunningServer& server) {
  if (server.stands_still()) return fmt::format("stands still {:.0f} s", server.age);
  if (server.fault != "none") return "fault " + server.fault;
  return server.state;
}

std::string line(std::string_view listen, std::string_view client, std::string_view state,
                 std::string_view median, std::string_view largest, std::string_view load,
                 std::string_view missed) {
  return fmt::format("{:<21}  {:<21}  {:<20}  {:>10}  {:>10}  {:>6}  {:>8}\n", listen, client,
                     state, median, largest, load, missed);
}

std::string line(const RunningServer& server) {
  const auto microseconds = [](double time) { return fmt::format("{:.1f}", kMicroseconds * time); };
  return line(server.listen, server.client.empty() ? "none" : server.client, state_of(server),
              microseconds(server.lateness_p50), microseconds(server.lateness_max),
              fmt::format("{:.2f}", server.load), fmt::format("{:.0f}", server.overruns));
}

}  // namespace

std::string list_as_text(const std::vector<RunningServer>& servers) {
  if (servers.empty()) return kNone;
  std::string text = line("server", "client", "state", "median us", "largest us", "load", "missed");
  for (const RunningServer& server : servers) text += line(server);
  return text + kLegend;
}

std::string list_as_json(const std::vector<RunningServer>& servers) {
  nlohmann::json all = nlohmann::json::array();
  for (const RunningServer& server : servers) {
    all.push_back({{"listen", server.listen},
                   {"process", server.process},
                   {"client", server.client},
                   {"state", server.state},
                   {"fault", server.fault},
                   {"age", server.age},
                   {"rate", server.rate},
                   {"lateness_p50", server.lateness_p50},
                   {"lateness_max", server.lateness_max},
                   {"load", server.load},
                   {"missed", server.overruns}});
  }
  const nlohmann::json report{{"servers", std::move(all)}};
  return report.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
}

}  // namespace hlm::server
