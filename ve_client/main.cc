// ve_client: the virtual environment as a process.
#include <algorithm>
#include <csignal>
#include <iostream>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include "protocol/capture.h"
#include "protocol/recording_link.h"
#include "protocol/udp_socket.h"
#include "ve_client/client/impaired_link.h"
#include "ve_client/frame.h"
#include "ve_client/settings.h"
#include "ve_client/status.h"
#include "ve_client/web/live_page.h"
#include "ve_client/world/sdf_loader.h"

namespace hlm::ve {
namespace {

volatile std::sig_atomic_t stop_requested = 0;

void request_stop(int) { stop_requested = 1; }

void install_signal_handlers() {
  struct sigaction action {};
  action.sa_handler = request_stop;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

void configure_logging(const std::string& level) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("ve_client"));
  spdlog::set_pattern("%H:%M:%S.%e ve_client %^%l%$: %v");
  spdlog::set_level(spdlog::level::from_str(level == "warn" ? "warning" : level));
}

HapticClientOptions client_options(const Settings& settings, const VirtualEnvironment& environment,
                                   const protocol::Endpoint& server) {
  std::random_device random;
  HapticClientOptions options;
  options.server = server;
  options.tool = environment.assembly.description;
  options.q = environment.assembly.q;
  options.ve_rate = (settings.rate_low + settings.rate_high) / 2;
  options.epsilon = settings.frame.epsilon;
  options.nonce = (static_cast<std::uint64_t>(random()) << 32) | random();
  return options;
}

/// A capture file and the link whose datagrams it gets.
struct Recording {
  Recording(const std::string& path, protocol::UdpSocket& socket)
      : file(path), link(socket, socket.local()) {}

  protocol::CaptureWriter file;
  protocol::RecordingLink link;
};

/// The page's server, if one is asked for.
std::unique_ptr<LivePage> open_page(const Settings& settings) {
  if (settings.page.empty()) return nullptr;
  const protocol::Endpoint at = protocol::resolve(settings.page);
  PageServerOptions options;
  options.address = settings.page.substr(0, settings.page.rfind(':'));
  options.port = at.port;
  options.root = settings.page_root.empty() ? HLM_PAGE : settings.page_root;
  auto page = std::make_unique<LivePage>(options);
  spdlog::info("live page: http://{}:{}", options.address, page->port());
  return page;
}

/// One run of the client: the world, the session, and the page that shows them.
class Run {
 public:
  Run(const Settings& settings, WorldDescription world, protocol::DatagramLink& link,
      LivePage* page, Recording* recording)
      : settings_(settings),
        description_(std::move(world)),
        page_(page),
        recording_(recording),
        server_(protocol::resolve(settings.server)),
        link_(
            link, [this] { return clock_.now(); }, settings.seed),
        live_{settings.frame, (settings.rate_low + settings.rate_high) / 2, settings.network, {}},
        spread_((settings.rate_high - settings.rate_low) / 2),
        engine_(settings.seed) {
    link_.set_conditions(live_.network);
    begin();
  }

  /// Frames at their rate until the end is asked for.
  void go() {
    double next = clock_.now();
    while (!stop_requested && (settings_.duration == 0 || clock_.now() < settings_.duration)) {
      const double period = periods().next();
      frame(period);
      // After an overrun the next frame starts at once; what was missed is not made up for.
      next = std::max(next + period, clock_.now());
      wait_until(next);
    }
    client_->close(clock_.now());
    link_.pump();
    if (recording_) recording_->link.drain(recording_->file);
  }

 private:
  /// The world as it was at the start, and a session on it.
  void begin() {
    if (client_) client_->close(clock_.now());
    client_.reset();
    environment_.emplace(description_, settings_.tool, settings_.follow);
    HapticClientOptions options = client_options(settings_, *environment_, server_);
    options.telemetry = page_;
    client_.emplace(link_, options);
    if (page_) page_->show_world(*environment_, 0);
  }

  void frame(double period) {
    if (page_) obey_page();
    const FrameResult result = run_frame(*environment_, *client_, clock_, period, live_.frame);
    connection_.watch(clock_.now(), result.inbox, client_->connected());
    status_.count(result);
    status_.report(clock_.now(), *client_, environment_->proximity.statistics());
    if (page_) show(result);
    if (recording_) recording_->link.drain(recording_->file);
  }

  void obey_page() {
    // Changes start from what the server was started with; set back to that, nothing is tuned.
    const protocol::Tuning own =
        client_->connected() ? client_->welcome().tuning : protocol::Tuning{};
    if (!live_.tuning) live_.tuning = own;
    const PageWishes wishes = page_->take_requests(live_);
    if (live_.tuning == own) live_.tuning.reset();
    link_.set_conditions(live_.network);
    if (wishes.reset) begin();
    client_->control(page_->control(live_));
  }

  void show(const FrameResult& result) {
    if (result.inbox.welcomed) {
      page_->forget_session();
      page_->show_world(*environment_, client_->welcome().servo_rate);
    }
    if (result.inbox.lost) page_->forget_session();
    page_->show_frame({.environment = *environment_,
                       .client = *client_,
                       .state = result.inbox.state,
                       .result = result,
                       .settings = live_});
  }

  FramePeriods& periods() {
    // A page may have changed the rate.
    const double low = std::max(1.0, live_.rate - spread_);
    if (!periods_ || low != low_) {
      low_ = low;
      periods_.emplace(low, low + 2 * spread_, engine_());
    }
    return *periods_;
  }

  /// Datagrams that are held back leave in time, within a millisecond.
  void wait_until(double time) {
    constexpr double kTurn = 1e-3;  // s
    while (live_.network != NetworkConditions{} && clock_.now() + kTurn < time) {
      link_.pump();
      clock_.sleep_until(clock_.now() + kTurn);
    }
    clock_.sleep_until(time);
  }

  const Settings& settings_;
  WorldDescription description_;
  LivePage* page_;  ///< May be null, as may recording_.
  Recording* recording_;
  SteadyClock clock_;
  protocol::Endpoint server_;
  ImpairedLink link_;
  LiveSettings live_;
  double spread_;  ///< Of the drawn rates about live_.rate, Hz.
  std::mt19937_64 engine_;
  std::optional<FramePeriods> periods_;
  double low_ = 0;  ///< Of periods_, Hz.
  std::optional<VirtualEnvironment> environment_;
  std::optional<HapticClient> client_;
  Connection connection_{settings_.server, settings_.connect_timeout};
  Status status_;
};

void run_client(const Settings& settings) {
  configure_logging(settings.log_level);
  install_signal_handlers();
  // What cannot be used is found before a file is begun.
  WorldDescription world = load_world(settings.world);
  assemble_tool(world, settings.tool);
  const std::unique_ptr<LivePage> page = open_page(settings);
  protocol::UdpSocket socket(protocol::Endpoint{});
  std::optional<Recording> recording;
  if (!settings.record.empty()) recording.emplace(settings.record, socket);
  protocol::DatagramLink& link =
      recording ? static_cast<protocol::DatagramLink&>(recording->link) : socket;
  Run(settings, std::move(world), link, page.get(), recording ? &*recording : nullptr).go();
}

}  // namespace
}  // namespace hlm::ve

int main(int argc, char** argv) {
  const hlm::ve::ParsedArguments arguments = hlm::ve::parse_arguments(argc, argv);
  if (!arguments.settings) return arguments.exit_code;
  try {
    hlm::ve::run_client(*arguments.settings);
  } catch (const std::exception& error) {
    std::cerr << "ve_client: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
