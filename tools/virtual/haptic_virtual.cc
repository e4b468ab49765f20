#include "haptic_virtual.h"

#include <algorithm>
#include <charconv>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hlm/client/surroundings.h"
#include "hlm/common/range.h"
#include "hlm/haptic_server/report/tick_numbers.h"
#include "hlm/tools/virtual/virtual_server.h"

namespace {

using namespace hlm;

constexpr std::string_view kAddress = "virtual:";
constexpr Range kTimes{0, 1e6, "s"};
constexpr Range kShares{0, 1};

/// A server and the frames of its session.
struct VirtualWorld {
  explicit VirtualWorld(const server::VirtualServerOptions& options) : server(options) {}

  server::VirtualServer server;
  std::optional<double> frame;  ///< Set by the program, s; empty: the session's period.
};

/// The servers of the process, by number.
std::mutex worlds_mutex;
std::map<unsigned, std::weak_ptr<VirtualWorld>> worlds;
unsigned last_world = 0;

std::shared_ptr<VirtualWorld> find_world(const std::string& address) {
  unsigned number = 0;
  const char* const end = address.data() + address.size();
  const auto read = std::from_chars(address.data() + kAddress.size(), end, number);
  const std::lock_guard lock(worlds_mutex);
  const auto found = worlds.find(number);
  std::shared_ptr<VirtualWorld> world = found == worlds.end() ? nullptr : found->second.lock();
  if (read.ec != std::errc() || read.ptr != end || !world) {
    throw std::invalid_argument("server \"" + address +
                                "\" must be one that is open in this process");
  }
  return world;
}

class VirtualSurroundings final : public Surroundings {
 public:
  VirtualSurroundings(const std::string& address, double period)
      : name_(address), world_(find_world(address)), period_(period) {}

  double begin_frame() override {
    server::VirtualServer& server = world_->server;
    const double due = begun_at_ ? *begun_at_ + world_->frame.value_or(period_) : server.now();
    server.pass(std::max(due, server.now()));
    begun_at_ = server.now();
    return server.now();
  }
  double now() override { return world_->server.now(); }
  protocol::DatagramLink& link() override { return world_->server.link(); }
  protocol::Endpoint server() const override { return protocol::MemoryNetwork::kServer; }
  std::string name() const override { return name_; }
  bool may_have_server() const override { return true; }

 private:
  std::string name_;
  std::shared_ptr<VirtualWorld> world_;
  double period_;                   ///< s.
  std::optional<double> begun_at_;  ///< When the latest frame did, s.
};

void refuse(const std::optional<std::string>& error) {
  if (error) throw std::invalid_argument(*error);
}

protocol::LinkConditions conditions_of(const haptic_network& network) {
  refuse(find_error("delay", network.delay, kTimes));
  refuse(find_error("jitter", network.jitter, kTimes));
  refuse(find_error("loss", network.loss, kShares));
  return {.delay = network.delay, .jitter = network.jitter, .loss = network.loss};
}

server::VirtualServerOptions options_of(const char* const* arguments, std::size_t count,
                                        const haptic_network* network) {
  server::VirtualServerOptions options;
  for (std::size_t i = 0; i < count; ++i) {
    if (arguments == nullptr || arguments[i] == nullptr) {
      throw std::invalid_argument("argument " + std::to_string(i) + " must not be NULL");
    }
    options.arguments.emplace_back(arguments[i]);
  }
  if (network != nullptr) {
    options.network = conditions_of(*network);
    options.seed = network->seed;
  }
  return options;
}

}  // namespace

struct haptic_virtual {
  explicit haptic_virtual(const server::VirtualServerOptions& options)
      : world(std::make_shared<VirtualWorld>(options)) {
    const std::lock_guard lock(worlds_mutex);
    worlds[++last_world] = world;
    number = last_world;
    address = std::string(kAddress) + std::to_string(number);
  }
  ~haptic_virtual() {
    const std::lock_guard lock(worlds_mutex);
    worlds.erase(number);
  }
  haptic_virtual(const haptic_virtual&) = delete;
  haptic_virtual& operator=(const haptic_virtual&) = delete;

  std::shared_ptr<VirtualWorld> world;
  unsigned number = 0;
  std::string address;
  mutable std::string warnings;  ///< As last asked for.
};

std::unique_ptr<Surroundings> hlm::surroundings_at(const std::string& address, double period) {
  if (!address.starts_with(kAddress)) return real_surroundings(address);
  return std::make_unique<VirtualSurroundings>(address, period);
}

haptic_virtual* haptic_virtual_open(const char* const* arguments, std::size_t count,
                                    const haptic_network* network, char* error,
                                    std::size_t error_size) {
  try {
    return new haptic_virtual(options_of(arguments, count, network));
  } catch (const std::exception& failure) {
    if (error != nullptr && error_size > 0) {
      error[std::string_view(failure.what()).copy(error, error_size - 1)] = '\0';
    }
    return nullptr;
  }
}

const char* haptic_virtual_address(const haptic_virtual* server) {
  return server == nullptr ? "" : server->address.c_str();
}

const char* haptic_virtual_warnings(const haptic_virtual* server) {
  if (server == nullptr) return "";
  server->warnings.clear();
  for (const std::string& warning : server->world->server.warnings()) {
    server->warnings += warning + '\n';
  }
  return server->warnings.c_str();
}

double haptic_virtual_now(const haptic_virtual* server) {
  return server == nullptr ? 0 : server->world->server.now();
}

void haptic_virtual_stop(haptic_virtual* server) {
  if (server != nullptr) server->world->server.stop();
}

int haptic_virtual_wait(haptic_virtual* server, double seconds) {
  if (server == nullptr || find_error("seconds", seconds, kTimes)) return -1;
  server->world->server.pass(server->world->server.now() + seconds);
  return 0;
}

void haptic_virtual_set_frame(haptic_virtual* server, double seconds) {
  if (server == nullptr) return;
  server->world->frame.reset();
  if (!find_error("seconds", seconds, kTimes)) server->world->frame = seconds;
}

int haptic_virtual_set_network(haptic_virtual* server, const haptic_network* network) {
  if (server == nullptr || network == nullptr) return -1;
  try {
    server->world->server.network().set_conditions(conditions_of(*network));
    return 0;
  } catch (const std::invalid_argument&) {
    return -1;
  }
}

const char* haptic_virtual_columns(void) {
  static const std::string names = server::tick_number_names();
  return names.c_str();
}

std::size_t haptic_virtual_ticks(const haptic_virtual* server) {
  if (server == nullptr) return 0;
  return server->world->server.first_tick() + server->world->server.ticks().size();
}

std::size_t haptic_virtual_copy_ticks(const haptic_virtual* server, std::size_t begin,
                                      std::size_t count, double* numbers) {
  if (server == nullptr || numbers == nullptr) return 0;
  const auto& ticks = server->world->server.ticks();
  const std::size_t first = server->world->server.first_tick();
  if (begin < first || begin - first > ticks.size()) return 0;
  count = std::min(count, ticks.size() - (begin - first));
  for (std::size_t i = 0; i < count; ++i) {
    numbers = server::copy_numbers(ticks[begin - first + i], numbers);
  }
  return count;
}

void haptic_virtual_close(haptic_virtual* server) { delete server; }
