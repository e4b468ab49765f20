#include "hlm/tools/doctor/network.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <numeric>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <spdlog/fmt/fmt.h>
#include <sys/socket.h>
#include <unistd.h>

#include "hlm/common/steady_seconds.h"
#include "hlm/protocol/client_session.h"
#include "hlm/protocol/sealing/sealed_client_link.h"
#include "hlm/protocol/transport/udp_socket.h"

namespace hlm::server {
namespace {

constexpr double kAnswerTime = 2;   // s; a server answers a hello within a few ticks.
constexpr double kUpdateRate = 60;  // Hz.
constexpr double kMilliseconds = 1e3;

/// A small rigid body, free in space.
protocol::Hello hello() {
  protocol::Hello hello;
  Link link;
  link.mass = 0.1;
  link.I_LCom = 1e-4 * Matrix3::Identity();
  hello.tool.links.push_back(link);
  hello.q = Configuration(7);
  hello.q << 0, 0, 0, 1, 0, 0, 0;
  hello.ve_rate = kUpdateRate;
  return hello;
}

/// What a session of its own showed.
struct Measurement {
  bool answered = false;
  std::optional<protocol::Reject> reject;
  std::optional<double> answer_time;  ///< Time to the welcome, s.
  std::size_t sent = 0;
  std::size_t acknowledged = 0;
  std::uint64_t late = 0;           ///< Datagrams that came after newer ones.
  std::vector<double> round_trips;  ///< s, sorted.
};

class Measuring {
 public:
  Measuring(protocol::DatagramLink& link, const NetworkOptions& options)
      : options_(options),
        session_(link, {.server = options.server, .hello = hello(), .clears_fault = false}) {}

  Measurement run() {
    const double begin = steady_seconds();
    while (!session_.active() && !result_.reject && steady_seconds() - begin < kAnswerTime) {
      poll();
    }
    if (session_.active()) {
      result_.answered = true;
      result_.answer_time = steady_seconds() - begin;
      measure();
      session_.close(steady_seconds());
    }
    result_.answered |= result_.reject.has_value();
    result_.late = session_.statistics().count(protocol::DropReason::kStale);
    std::sort(result_.round_trips.begin(), result_.round_trips.end());
    return std::move(result_);
  }

 private:
  void measure() {
    const std::uint64_t before = session_.statistics().datagrams;
    const double begin = steady_seconds();
    double due = begin;
    while (session_.active() && steady_seconds() - begin < options_.time) {
      if (steady_seconds() >= due) {
        send();
        // Not sooner after a stall: of several updates in a tick the latest alone is acknowledged.
        due = steady_seconds() + 1 / kUpdateRate;
      }
      poll();
    }
    const double end = steady_seconds() + std::min(1.0, 3 * session_.round_trip() + 0.05);
    while (session_.active() && steady_seconds() < end) poll();
    // All that a server sends without telemetry, also those that came while this process stalled.
    result_.acknowledged = session_.statistics().datagrams - before;
  }

  void send() {
    protocol::ContactUpdate update;
    update.ve_period = 1 / kUpdateRate;
    update.ve_time = static_cast<double>(result_.sent) * update.ve_period;
    update.q_VE = q_;
    update.v_VE = Velocity::Zero(6);
    session_.send(steady_seconds(), update);
    ++result_.sent;
  }

  void poll() {
    constexpr auto kPause = std::chrono::microseconds(200);
    const protocol::ClientSession::Inbox inbox = session_.poll(steady_seconds());
    if (inbox.reject) result_.reject = inbox.reject;
    if (inbox.state != nullptr) {
      q_ = inbox.state->q;
      result_.round_trips.push_back(session_.round_trip());
    }
    std::this_thread::sleep_for(kPause);
  }

  const NetworkOptions& options_;
  protocol::ClientSession session_;
  Configuration q_ = hello().q;
  Measurement result_;
};

/// What the system says of an empty datagram to the server's port; empty: nothing, so that it came
/// to a program or was dropped on the way.
std::string refusal_of_port(const protocol::Endpoint& server) {
  const int descriptor = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(server.address);
  address.sin_port = htons(server.port);
  int error = 0;
  if (connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      send(descriptor, "", 0, 0) < 0) {
    error = errno;
  } else {
    constexpr int kPatience = 500;  // ms.
    pollfd answer{.fd = descriptor, .events = POLLIN, .revents = 0};
    socklen_t size = sizeof error;
    if (::poll(&answer, 1, kPatience) > 0) {
      getsockopt(descriptor, SOL_SOCKET, SO_ERROR, &error, &size);
    }
  }
  close(descriptor);
  if (error == ECONNREFUSED) return "nothing listens at that port, or a firewall rejects it";
  return error == 0 ? "" : std::strerror(error);
}

/// Reasons for which the server has dropped more than before, with what they mean.
std::string new_drops(const RunningServer& before, const RunningServer& after) {
  std::string reasons;
  for (const auto& [reason, count] : after.dropped) {
    const auto known = before.dropped.find(reason);
    const double added = count - (known == before.dropped.end() ? 0 : known->second);
    if (added == 0) continue;
    const auto known_reason = value_of<protocol::DropReason>(reason);
    reasons += fmt::format("{}{:.0f} {}", reasons.empty() ? "" : ", ", added, reason);
    if (known_reason) reasons += fmt::format(" ({})", meaning_of(*known_reason));
  }
  return reasons;
}

/// What became of hellos that nothing answered.
Finding silence(const NetworkOptions& options, const std::optional<RunningServer>& before) {
  const std::string name = "haptic_server at " + options.name;
  const std::string refusal = refusal_of_port(options.server);
  if (!before) {
    if (!refusal.empty()) {
      return {Verdict::kProblem, "answer", "none: " + refusal,
              "start haptic_server there, check --server, or open its UDP port"};
    }
    return {Verdict::kProblem, "answer",
            "none, and no refusal: the host is down, a firewall drops UDP to that port, or the "
            "server's key is another one",
            "run haptic_doctor on the server's machine; open UDP port " +
                std::to_string(options.server.port) + " both ways; give --key-file"};
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));  // Time to the next state.
  const std::optional<RunningServer> after = find_running(options.server);
  if (!after || after->datagrams == before->datagrams) {
    return {Verdict::kProblem, "answer",
            fmt::format("none: {} runs (process {}), but nothing that is sent to it arrives", name,
                        before->process),
            "a firewall of this machine drops it: open UDP port " +
                std::to_string(options.server.port)};
  }
  const std::string drops = new_drops(*before, *after);
  return {Verdict::kProblem, "answer",
          "none: " + name + " gets what is sent" +
              (drops.empty() ? ", but its answers do not arrive" : " and drops it: " + drops),
          drops.empty() ? "a firewall drops what it sends"
                        : "use the same version and the same --key-file on both sides"};
}

std::string text_of(const protocol::Reject& reject) {
  const std::string text(reject.text.begin(), reject.text.end());
  return std::string(meaning_of(reject.reason)) + (text.empty() ? "" : " (" + text + ")");
}

Finding refusal(const protocol::Reject& reject) {
  switch (reject.reason) {
    case protocol::RejectReason::kBusy:
      return {Verdict::kNote, "answer",
              "it answers, and has another client: nothing was measured, to leave that one alone",
              "run haptic_doctor on the server's machine, or without that client"};
    case protocol::RejectReason::kFault:
      return {
          Verdict::kProblem, "answer", "it answers, and is in a fault: " + text_of(reject),
          "haptic_doctor clear on its machine, then restart ve_client, or press Reset on its page"};
    case protocol::RejectReason::kVersion:
    case protocol::RejectReason::kTool:
      break;
  }
  return {Verdict::kProblem, "answer", "it refuses a session: " + text_of(reject),
          "use the same version on both sides"};
}

Finding round_trip(const std::vector<double>& sorted) {
  const auto at = [&](double share) {
    return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
  };
  const double median = at(0.5);
  const double jitter = at(0.99) - median;
  const std::string text =
      fmt::format("{:.2f} ms in the median, 99 % at most {:.2f} ms, the longest {:.2f} ms",
                  kMilliseconds * median, kMilliseconds * at(0.99), kMilliseconds * sorted.back());
  constexpr double kLong = 0.05;      // s: contacts are half of it older than need be.
  constexpr double kUnsteady = 0.02;  // s: more than a frame.
  if (median <= kLong && jitter <= kUnsteady) return {Verdict::kGood, "round trip", text, ""};
  return {Verdict::kWarning, "round trip", text,
          "use a cable in place of radio, and a shorter way; give the server shapes, not contacts"};
}

Finding loss(std::size_t sent, std::size_t acknowledged) {
  const double share =
      sent == 0 ? 0
                : std::max(0.0, 1 - static_cast<double>(acknowledged) / static_cast<double>(sent));
  const std::string text =
      fmt::format("{} of {} updates acknowledged, {:.1f} % lost", acknowledged, sent, 100 * share);
  constexpr double kUsual = 0.01;
  constexpr double kTooMuch = 0.2;  // Both ways together: force comes and goes.
  if (share <= kUsual) return {Verdict::kGood, "loss", text, ""};
  return {share <= kTooMuch ? Verdict::kWarning : Verdict::kProblem, "loss", text,
          "use a cable in place of radio; see the counters of both network cards"};
}

Finding order(std::uint64_t late) {
  if (late == 0) return {Verdict::kGood, "order", "nothing came after something newer", ""};
  return {Verdict::kWarning, "order",
          fmt::format("{} datagrams came after newer ones and were dropped", late), ""};
}

Finding client_of(const RunningServer& running) {
  std::string drops;
  for (const auto& [reason, count] : running.dropped) {
    if (count > 0) drops += fmt::format(", {:.0f} {}", count, reason);
  }
  return {Verdict::kNote, "client",
          fmt::format("it has a client, which is left alone: {:.1f} updates a second, contacts "
                      "{:.1f} ms old on arrival; since its start {:.0f} datagrams dropped{}",
                      running.update_rate.value_or(0), kMilliseconds * running.contact_age,
                      std::accumulate(running.dropped.begin(), running.dropped.end(), 0.0,
                                      [](double sum, const auto& d) { return sum + d.second; }),
                      drops),
          ""};
}

}  // namespace

Examination examine_network(const NetworkOptions& options,
                            const std::optional<RunningServer>& running) {
  Examination examination{"How is the network to haptic_server at " + options.name + "?", {}};
  std::vector<Finding>& findings = examination.findings;
  if (running && running->session) {
    findings.push_back(client_of(*running));
    return examination;
  }
  protocol::UdpSocket socket(protocol::Endpoint{});
  std::optional<protocol::SealedClientLink> sealed;
  if (options.key) sealed.emplace(socket, options.server, *options.key);
  protocol::DatagramLink& link = sealed ? *sealed : static_cast<protocol::DatagramLink&>(socket);
  const Measurement measured = Measuring(link, options).run();
  if (!measured.answered) {
    findings.push_back(silence(options, running));
  } else if (measured.reject) {
    findings.push_back(refusal(*measured.reject));
  } else {
    findings.push_back(
        {Verdict::kGood, "answer",
         fmt::format("a session after {:.1f} ms", kMilliseconds * measured.answer_time.value_or(0)),
         ""});
    if (!measured.round_trips.empty()) findings.push_back(round_trip(measured.round_trips));
    findings.push_back(loss(measured.sent, measured.acknowledged));
    findings.push_back(order(measured.late));
  }
  return examination;
}

}  // namespace hlm::server
