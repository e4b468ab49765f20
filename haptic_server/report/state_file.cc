#include "hlm/haptic_server/report/state_file.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <fstream>
#include <utility>

#include <nlohmann/json.hpp>
#include <unistd.h>

#include "hlm/protocol/messages.h"
#include "hlm/protocol/transport/udp_socket.h"

namespace hlm::server {
namespace {

using nlohmann::json;

constexpr double kRateTime = 2;  // s over which updates are counted.

/// JSON has no infinity: null.
json finite(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

/// Of all threads of this process, s.
double processor_time() noexcept {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

json drops(const TickRecord& record) {
  json by_reason = json::object();
  for (const auto& word : kWords<protocol::DropReason>) {
    by_reason[std::string(word.name)] = record.dropped_for[static_cast<std::size_t>(word.value)];
  }
  return by_reason;
}

json scene_json(const TickRecord& record) {
  return {{"number", record.scene},
          {"placements", record.placements},
          {"pieces", record.pieces},
          {"left_out", record.left_out}};
}

json chain_json(const ForceFacts& facts) {
  json chain = json::array();
  for (const ChainLink& link : force_chain(facts)) {
    chain.push_back({{"name", link.name}, {"value", link.value}, {"reason", link.reason}});
  }
  return chain;
}

}  // namespace

StateFile::StateFile(const std::filesystem::path& directory, ServerFacts facts)
    : facts_(std::move(facts)), processor_time_(processor_time()) {
  if (directory.empty()) return;
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (!error) path_ = directory / (facts_.listen + kStateSuffix);
}

StateFile::~StateFile() {
  std::error_code ignored;
  if (!path_.empty()) std::filesystem::remove(path_, ignored);
}

void StateFile::observe(const TickRecord& record) {
  if (path_.empty()) return;
  count(record);
  if (record.time - written_ < kPeriod) return;
  const double used = processor_time();
  write(text(record, (used - processor_time_) / (record.time - written_)));
  processor_time_ = used;
  written_ = record.time;
  missed_ = record.overruns;
  lateness_ = Histogram();
}

void StateFile::count(const TickRecord& record) {
  lateness_.record(record.lateness);
  if (record.session != session_) {
    session_ = record.session;
    began_ = heard_ = record.time;
    adoptions_.clear();
  }
  const std::uint64_t usable = record.datagrams - record.dropped;
  if (usable != std::exchange(usable_, usable)) heard_ = record.time;
  if (record.adopted != 0) {
    adoptions_.push_back(record.time);
    age_ = record.age;
  }
  while (!adoptions_.empty() && adoptions_.front() < record.time - kRateTime) {
    adoptions_.pop_front();
  }
}

ForceFacts StateFile::force_facts(const TickRecord& record) const {
  ForceFacts facts;
  facts.session =
      record.session_open || record.server == ServerState::kFading || record.fault != Fault::kNone;
  facts.server = record.server;
  facts.fault = record.fault;
  facts.silence = record.time - heard_;
  const double counted = std::min(kRateTime, record.time - began_);
  if (counted >= kPeriod / 2) {
    facts.update_rate = static_cast<double>(adoptions_.size()) / counted;
  }
  facts.least_update_rate = facts_.least_update_rate;
  facts.age = age_;
  facts.motors_off = record.health == DeviceHealth::kForceOff;
  facts.p_WD = record.X_WD.p;
  if (record.hand_measured) facts.F_hand = record.F_hand.head<3>();
  facts.uses_contacts = record.uses_contacts;
  facts.active = static_cast<std::size_t>(record.active_contacts);
  facts.reported = facts.active + static_cast<std::size_t>(record.predicted_contacts);
  facts.smallest_separation = record.smallest_separation;
  facts.stiffness = record.stiffness;
  facts.F_env = record.F_env.head<3>();
  facts.F_command = record.F_command.head<3>();
  facts.limit = record.limit;
  return facts;
}

std::string StateFile::text(const TickRecord& record, double load) const {
  const ForceFacts facts = force_facts(record);
  const double now =
      std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  const json state{{"process", getpid()},
                   {"written", now},
                   {"listen", facts_.listen},
                   {"capture", facts_.capture},
                   {"rate", facts_.rate},
                   {"server", name_of(record.server)},
                   {"fault", name_of(record.fault)},
                   {"session", facts.session},
                   {"client", record.session_open ? protocol::to_string(record.client) : ""},
                   {"silence", *facts.silence},
                   {"update_rate", facts.update_rate ? json(*facts.update_rate) : json(nullptr)},
                   {"least_update_rate", facts_.least_update_rate},
                   {"age", age_},
                   {"datagrams", record.datagrams},
                   {"dropped", drops(record)},
                   {"load", load},
                   {"overruns", record.overruns},
                   {"loop",
                    {{"ticks", lateness_.count()},
                     {"missed", record.overruns - missed_},
                     {"lateness_p50", lateness_.quantile(0.5)},
                     {"lateness_p99", lateness_.quantile(0.99)},
                     {"lateness_max", lateness_.max()}}},
                   {"device",
                    {{"name", facts_.device},
                     {"health", name_of(record.health)},
                     {"cause", record.cause},
                     {"hand", protocol::hand_source(record.hand_measured, record.hand_observed)},
                     {"max_force", finite(facts_.ratings.max_force)},
                     {"max_torque", finite(facts_.ratings.max_torque)},
                     {"halts", facts_.ratings.halts},
                     {"time_guard", finite(facts_.ratings.time_guard)}}},
                   {"scene", scene_json(record)},
                   {"force", facts.F_command.norm()},
                   {"chain", chain_json(facts)}};
  using Handler = nlohmann::json::error_handler_t;  // A device's name may be no UTF-8.
  return state.dump(2, ' ', false, Handler::replace) + '\n';
}

void StateFile::write(const std::string& text) const {
  const std::filesystem::path unfinished = path_.string() + ".part";
  std::ofstream file(unfinished, std::ios::trunc);
  file << text;
  file.close();
  std::error_code ignored;
  if (file) {
    using std::filesystem::perms;
    std::filesystem::permissions(
        unfinished, perms::owner_read | perms::owner_write | perms::group_read | perms::others_read,
        ignored);
    std::filesystem::rename(unfinished, path_, ignored);
  } else {
    std::filesystem::remove(unfinished, ignored);
  }
}

}  // namespace hlm::server
