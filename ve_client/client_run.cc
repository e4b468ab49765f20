#include "ve_client/client_run.h"

#include <algorithm>
#include <chrono>
#include <filesystem>

#include <spdlog/spdlog.h>

#include "common/settings/directories.h"
#include "common/settings/table.h"
#include "protocol/sealing/key_file.h"

namespace hlm::ve {
namespace {

HapticClientOptions client_options(const Settings& settings, const VirtualEnvironment& environment,
                                   const protocol::Endpoint& server) {
  HapticClientOptions options;
  options.server = server;
  options.tool = environment.assembly.description;
  options.q = environment.assembly.q;
  options.ve_rate = (settings.rate_low + settings.rate_high) / 2;
  options.epsilon = settings.frame.epsilon;
  return options;
}

/// Loads a scene, and says what was done to its meshes.
Scene load_and_tell(const std::filesystem::path& file, const std::string& tool,
                    const std::string& start = "") {
  Scene scene = load_scene(file, tool, start);
  for (const std::string& repair : scene.world.repairs) spdlog::warn("{}", repair);
  return scene;
}

/// The scene of the options. What is wrong with it, an option is.
Scene first_scene(const Settings& settings) {
  try {
    return load_and_tell(settings.world, settings.tool, settings.start);
  } catch (const std::runtime_error& error) {
    throw settings::UsageError(error.what());
  }
}

/// The server's key, if there is one.
std::optional<protocol::noise::Key> read_key(const Settings& settings) {
  if (settings.key_file.empty()) return std::nullopt;
  try {
    return protocol::read_key(settings.key_file);
  } catch (const std::runtime_error& error) {
    throw settings::UsageError(error.what());
  }
}

/// The page's files stand at a fixed place beside the program, built or installed.
std::filesystem::path page_beside_program() {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path() / HLM_PAGE;
}

/// The endpoint that an option gives; `example` is one.
protocol::Endpoint resolved(const char* option, const std::string& value, const char* example) {
  try {
    return protocol::resolve(value);
  } catch (const std::runtime_error& error) {
    throw settings::UsageError(
        fmt::format("{} {}: {}; for example {}", option, value, error.what(), example));
  }
}

/// Where the server's flight recordings are, if it runs on this machine.
std::vector<std::filesystem::path> recordings_of(const protocol::Endpoint& server,
                                                 const std::string& given) {
  if (!given.empty()) return {given};
  if (!protocol::is_own_address(server)) return {};
  return settings::state_directories();
}

/// The page's server, if one is asked for.
std::unique_ptr<LivePage> open_page(const Settings& settings, const protocol::Endpoint& server) {
  if (settings.page.empty()) return nullptr;
  const protocol::Endpoint at = resolved("--page", settings.page, "127.0.0.1:8080");
  PageServerOptions options;
  const std::string resolved = protocol::to_string(at);
  options.address = resolved.substr(0, resolved.rfind(':'));
  options.port = at.port;
  options.root = settings.page_root;
  if (options.root.empty()) options.root = page_beside_program();
  options.recordings = recordings_of(server, settings.recordings);
  auto page = std::make_unique<LivePage>(options);
  const bool everywhere = options.address == "0.0.0.0";
  spdlog::info("live page: http://{}:{}{}", everywhere ? "127.0.0.1" : options.address,
               page->port(), everywhere ? ", and at every other address of this machine" : "");
  return page;
}

}  // namespace

ClientRun::ClientRun(const Settings& settings)
    : settings_(settings),
      scene_(first_scene(settings)),
      start_(settings.start),
      environment_(std::in_place, with_start(scene_.world, scene_.tool, start_), scene_.tool,
                   settings.follow),
      server_(resolved("--server", settings.server, "127.0.0.1:47800")),
      key_(read_key(settings)),
      page_(open_page(settings, server_)),
      scenes_(page_ ? scenes_beside(scene_.file) : std::vector<SceneSummary>{}),
      link_(
          wire(), [this] { return clock_.now(); }, settings.seed),
      live_(settings_at_start()),
      spread_((settings.rate_high - settings.rate_low) / 2),
      engine_(settings.seed),
      connection_(settings.server, settings.key_file, settings.connect_timeout) {
  link_.set_conditions(live_.network);
  begin(true);
}

protocol::DatagramLink& ClientRun::wire() {
  protocol::DatagramLink* link = &socket_;
  if (key_) link = &sealed_.emplace(*link, server_, *key_);
  if (settings_.record.empty()) return *link;
  return recording_.emplace(settings_.record, *link, socket_.local()).link;
}

LiveSettings ClientRun::settings_at_start() const {
  const double rate = (settings_.rate_low + settings_.rate_high) / 2;
  return {settings_.frame, rate, settings_.network, own_tuning_};
}

void ClientRun::go(const std::function<bool()>& stop) {
  double next = clock_.now();
  while (!stop() && (settings_.duration == 0 || clock_.now() < settings_.duration)) {
    const double period = periods().next();
    frame(period);
    // After an overrun the next frame starts at once; what was missed is not made up for.
    next = std::max(next + period, clock_.now());
    wait_until(next);
  }
  // The goodbye is not held back.
  link_.set_conditions({});
  client_->close(clock_.now());
  if (recording_) recording_->link.drain(recording_->file);
  if (!stop()) connection_.end(clock_.now());
}

void ClientRun::begin(bool clears_fault) {
  fault_reported_ = false;
  if (client_) {
    client_->close(clock_.now());
    environment_.emplace(with_start(scene_.world, scene_.tool, start_), scene_.tool,
                         settings_.follow);
  }
  HapticClientOptions options = client_options(settings_, *environment_, server_);
  options.clears_fault = clears_fault;
  options.telemetry = page_.get();
  client_.emplace(link_, options);
  if (page_) {
    page_->forget_session();
    show_world(nullptr);
  }
}

void ClientRun::frame(double period) {
  if (page_) take_page_requests();
  // Friction that a person has set holds instead of the materials'.
  live_.frame.report_friction = live_.tuning.friction == own_tuning_.friction;
  const FrameResult result = run_frame(*environment_, *client_, clock_, period, live_.frame);
  if (result.fault != nullptr) report(*result.fault);
  connection_.watch(clock_.now(), result.inbox, client_->connected());
  if (result.inbox.welcomed) warn_of_mismatch(environment_->assembly, client_->welcome().device);
  status_.count(result);
  status_.report(clock_.now(), *client_, environment_->proximity.statistics());
  if (page_) show(result);
  if (recording_) recording_->link.drain(recording_->file);
}

/// The world stands still. A page can reset it, and show it until then.
void ClientRun::report(const std::string& fault) {
  if (!page_) {
    client_->close(clock_.now());
    throw std::runtime_error(fault + ": the simulation went wrong");
  }
  if (!fault_reported_) {
    spdlog::error("{}: the world stands still and force fades; Reset on the page starts it anew",
                  fault);
  }
  fault_reported_ = true;
}

void ClientRun::take_page_requests() {
  if (const auto reset = page_->take_requests(clock_.now(), live_, settings_at_start())) {
    start_ = reset->start.value_or(start_);
    begin(true);
  }
  change_scene();
  link_.set_conditions(live_.network);
  client_->control(page_->control(live_, own_tuning_));
}

void ClientRun::change_scene() {
  using namespace std::chrono_literals;
  if (!loading_.valid()) {
    const auto chosen = page_->take_scene();
    if (!chosen) return;
    chosen_ = *chosen;
    const auto& file = std::ranges::find(scenes_, chosen_.name, &SceneSummary::name)->file;
    // --tool is for --world; others are played with the tool that they name.
    const std::string tool = file == settings_.world ? settings_.tool : "";
    loading_ = std::async(std::launch::async, [=] { return load_and_tell(file, tool); });
  }
  if (loading_.wait_for(0s) != std::future_status::ready) return;
  try {
    Scene scene = loading_.get();
    // What only the engine or the session finds wrong, before the present one ends.
    const VirtualEnvironment trial(scene.world, scene.tool, settings_.follow);
    scene_ = std::move(scene);
  } catch (const std::exception& error) {
    return page_->refuse(chosen_, error.what());
  }
  spdlog::info("{} with tool '{}', chosen on the page", scene_.file.string(), scene_.tool);
  start_.clear();
  live_ = settings_at_start();
  begin(false);
}

void ClientRun::show_world(const protocol::Welcome* welcome) {
  page_->show_world({.environment = *environment_,
                     .scene = scene_,
                     .scenes = scenes_,
                     .start = start_,
                     .welcome = welcome});
}

void ClientRun::show(const FrameResult& result) {
  if (result.inbox.welcomed) {
    page_->forget_session();
    // What no page has changed is as the server was started.
    const Tuning& own = client_->welcome().tuning;
    live_.tuning = carried_over(live_.tuning, own_tuning_, own);
    own_tuning_ = own;
    show_world(&client_->welcome());
  }
  if (result.inbox.lost) page_->forget_session();
  page_->show_frame({.environment = *environment_,
                     .client = *client_,
                     .state = result.inbox.state,
                     .result = result,
                     .settings = live_});
}

FramePeriods& ClientRun::periods() {
  // A page may have changed the rate.
  const double low = std::max(1.0, live_.rate - spread_);
  if (!periods_ || low != low_) {
    low_ = low;
    periods_.emplace(low, low + 2 * spread_, engine_());
  }
  return *periods_;
}

void ClientRun::wait_until(double time) {
  constexpr double kPumpPeriod = 1e-3;  // s
  while (live_.network != NetworkConditions{} && clock_.now() + kPumpPeriod < time) {
    link_.pump();
    clock_.sleep_until(clock_.now() + kPumpPeriod);
  }
  clock_.sleep_until(time);
}

}  // namespace hlm::ve
