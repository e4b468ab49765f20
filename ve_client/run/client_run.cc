#include "hlm/ve_client/run/client_run.h"

#include <algorithm>
#include <chrono>
#include <filesystem>

#include <spdlog/fmt/ranges.h>
#include <spdlog/spdlog.h>

#include "hlm/common/settings/directories.h"
#include "hlm/common/settings/table.h"
#include "hlm/page/page_root.h"
#include "hlm/page/web/page_token.h"
#include "hlm/protocol/sealing/key_file.h"
#include "hlm/ve_client/run/world_view.h"
#include "hlm/ve_client/world/scene_shapes.h"

namespace hlm::ve {
namespace {

/// What of the world's file is not used as it stands.
void report(const Diagnostics& diagnostics) {
  for (const Finding& finding : diagnostics.findings()) {
    switch (finding.verdict) {
      case Verdict::kRefused:
        spdlog::error("{}", to_string(finding));
        break;
      case Verdict::kApproximated:
        spdlog::warn("approximated: {}", to_string(finding));
        break;
      case Verdict::kIgnored:
        spdlog::info("ignored: {}", to_string(finding));
        break;
    }
  }
}

void say(const std::string& line) { spdlog::info("{}", line); }

/// The scene of the options. What is wrong with it, an option is.
Scene first_scene(const Settings& settings) {
  try {
    Diagnostics diagnostics({.say = say, .stopped = {}});
    Scene scene = load_scene(settings.world, choices(settings), diagnostics);
    require_usable(scene, diagnostics);
    report(diagnostics);
    return scene;
  } catch (const RefusedWorld& error) {
    if (error.diagnostics().count(Verdict::kRefused) > 1) report(error.diagnostics());
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

std::vector<protocol::Endpoint> endpoints(const Settings& settings) {
  std::vector<protocol::Endpoint> servers;
  for (const ToolSettings& tool : settings.tools) {
    const char* option = servers.empty() ? "--server" : "--second-server";
    servers.push_back(resolved(option, tool.server, "127.0.0.1:47800"));
    if (std::find(servers.begin(), servers.end() - 1, servers.back()) != servers.end() - 1) {
      throw settings::UsageError(std::string(option) + ' ' + tool.server +
                                 " must be another server: each serves one tool");
    }
  }
  return servers;
}

/// Where the server's flight recordings are, if it runs on this machine.
std::vector<std::filesystem::path> recordings_of(const protocol::Endpoint& server,
                                                 const std::string& given) {
  if (!given.empty()) return {given};
  if (!protocol::is_own_address(server)) return {};
  return settings::state_directories();
}

/// The tools that the options name, where the file places them.
std::vector<ToolChoice> placed_as_in_file(const Settings& settings) {
  std::vector<ToolChoice> tools = choices(settings);
  for (ToolChoice& tool : tools) tool.start.clear();
  return tools;
}

/// Tools named for messages: "tool 'peg'", or "tools 'peg', 'tray'".
std::string names(const std::vector<std::string>& tools) {
  return fmt::format("tool{} '{}'", tools.size() > 1 ? "s" : "", fmt::join(tools, "', '"));
}

/// Says where the page is, and what that exposes. A blank follows the address, which people click.
void announce(const PageServerOptions& page, std::uint16_t port, bool beyond) {
  const bool everywhere = page.address == "0.0.0.0";
  const std::string query = page.token.empty() ? "" : "/?token=" + page.token;
  const std::string where =
      fmt::format("http://{}:{}{}{}", everywhere ? "127.0.0.1" : page.address, port, query,
                  everywhere ? " and at every other address of this machine" : "");
  if (!page.token.empty()) {
    // Also with --quiet: nobody opens the page without it.
    spdlog::warn(
        "live page: {} (whoever has this address can move the tool{})", where,
        beyond ? ", and whoever listens in on the network can have it: nothing is encrypted" : "");
    return;
  }
  spdlog::info("live page: {}", where);
  if (!beyond) return;
  spdlog::warn(
      "--insecure: the live page asks nobody for a token: whoever reaches {} can look on, "
      "change settings and move the tool",
      page.address + ':' + std::to_string(port));
}

/// The page's server, if one is asked for.
std::unique_ptr<LivePage> open_page(const Settings& settings, const protocol::Endpoint& server) {
  if (settings.page.empty()) return nullptr;
  const protocol::Endpoint at = resolved("--page", settings.page, "127.0.0.1:8080");
  const bool beyond = !protocol::is_loopback(at);
  PageServerOptions options;
  const std::string resolved = protocol::to_string(at);
  options.address = resolved.substr(0, resolved.rfind(':'));
  options.port = at.port;
  options.partner = settings.page_partner;
  options.root = settings.page_root;
  if (options.root.empty()) options.root = page_beside_program();
  options.recordings = recordings_of(server, settings.recordings);
  if (!settings.insecure && (beyond || !settings.key_file.empty())) {
    options.token = PageToken::random();
  }
  options.own_user_only = !settings.insecure && options.token.empty();
  auto page = std::make_unique<LivePage>(options);
  announce(options, page->port(), beyond);
  return page;
}

}  // namespace

ClientRun::ClientRun(const Settings& settings)
    : settings_(settings),
      scene_(first_scene(settings)),
      tools_(choices(settings)),
      environment_(std::in_place, with_starts(scene_, tools_), scene_.tools, settings.follow),
      servers_(endpoints(settings)),
      key_(read_key(settings)),
      page_(open_page(settings, servers_.front())),
      scenes_(page_ ? scenes_beside(scene_.file) : std::vector<SceneSummary>{}),
      live_(settings_at_start()),
      spread_((settings.rate_high - settings.rate_low) / 2),
      engine_(settings.seed) {
  for (std::size_t i = 0; i < servers_.size(); ++i) {
    sessions_.emplace_back(settings.tools[i], servers_[i], settings.seed + i,
                           ToolSession::Common{.key = key_,
                                               .key_file = settings.key_file,
                                               .connect_timeout = settings.connect_timeout,
                                               .tool_may_change = page_ != nullptr,
                                               .alone = servers_.size() == 1,
                                               .now = [this] { return clock_.now(); }});
  }
  set_conditions(live_.network);
  begin(Asked::kAll);
}

ClientRun::~ClientRun() { ended_ = true; }

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
  for (ToolSession& session : sessions_) session.close();
  if (stop()) return;
  for (const ToolSession& session : sessions_) session.require_connected();
}

void ClientRun::begin(Asked asked) {
  fault_reported_ = false;
  if (begun_) {
    environment_.emplace(with_starts(scene_, tools_), scene_.tools, settings_.follow);
  }
  begun_ = true;
  HapticClientOptions options;
  options.ve_rate = (settings_.rate_low + settings_.rate_high) / 2;
  options.epsilon = settings_.frame.epsilon;
  for (std::size_t i = 0; i < sessions_.size(); ++i) {
    options.clears_fault = asked == Asked::kAll || (asked == Asked::kFirst && i == 0);
    options.telemetry = i == 0 ? page_.get() : nullptr;
    const ToolAssembly& tool = environment_->tools[i].assembly;
    sessions_[i].begin(options, tool);
  }
  offered_shapes_ = false;
  offer_scenes();
  if (page_) {
    page_->forget_session();
    show_world(nullptr);
  }
}

/// The world's shapes; none where a person does not want them any more.
void ClientRun::offer_scenes() {
  if (live_.frame.shapes == offered_shapes_) return;
  offered_shapes_ = live_.frame.shapes;
  for (std::size_t i = 0; i < sessions_.size(); ++i) offer_scene(i);
}

void ClientRun::offer_scene(std::size_t tool) {
  protocol::SceneOffer scene;
  if (live_.frame.shapes) {
    scene = scene_of(environment_->world, environment_->tools[tool].assembly,
                     settings_.frame.report_friction[tool]);
  }
  try {
    sessions_[tool].client().offer_scene(std::move(scene));
  } catch (const std::invalid_argument& error) {
    spdlog::warn("no shapes, but contacts: {}", error.what());
  }
}

void ClientRun::frame(double period) {
  if (page_) take_page_requests();
  // Friction that a person has set, of the page's tool, holds instead of the materials'.
  live_.frame.report_friction.front() = live_.tuning.friction == own_tuning_.friction;
  std::vector<HapticClient*> clients;
  for (ToolSession& session : sessions_) clients.push_back(&session.client());
  FrameOptions options = live_.frame;
  if (page_) options.pull = page_->pull();
  const std::vector<FrameResult> results =
      run_frame(*environment_, clients, clock_, period, options);
  if (results.front().fault != nullptr) report(*results.front().fault);
  for (std::size_t i = 0; i < sessions_.size(); ++i) {
    const HeldTool& held = environment_->tools[i];
    sessions_[i].report(results[i], held.tool, held.proximity);
  }
  if (page_) show(results.front());
}

/// The world stands still. A page can reset it, and show it until then.
void ClientRun::report(const std::string& fault) {
  if (!page_) {
    for (ToolSession& session : sessions_) session.close();
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
    if (reset->start) tools_.front().start = *reset->start;
    // Whoever is at the page knows of the first tool's device, and not who holds the others.
    begin(Asked::kFirst);
  }
  change_scene();
  for (int steps = page_->take_steps(); steps > 0; --steps) environment_->pace.step();
  set_conditions(live_.network);
  offer_scenes();
  first_client().control(page_->control(live_, own_tuning_));
}

void ClientRun::change_scene() {
  using namespace std::chrono_literals;
  if (!loading_.valid()) {
    const auto chosen = page_->take_scene();
    if (!chosen) return;
    chosen_ = *chosen;
    const auto& file = std::ranges::find(scenes_, chosen_.name, &SceneSummary::name)->file;
    // --tool is for --world; others are played with the tools that they name.
    std::vector<ToolChoice> tools = placed_as_in_file(settings_);
    if (file != settings_.world) tools.assign(tools.size(), {});
    loading_ = std::async(std::launch::async, [this, file = file, tools] {
      return load_scene(file, tools, {.say = say, .stopped = [this] { return ended_.load(); }});
    });
  }
  if (loading_.wait_for(0s) != std::future_status::ready) return;
  try {
    Scene scene = loading_.get();
    // What only the engine or the session finds wrong, before the present one ends.
    const VirtualEnvironment trial(scene.world, scene.tools, settings_.follow);
    scene_ = std::move(scene);
  } catch (const std::exception& error) {
    return page_->refuse(chosen_, error.what());
  }
  spdlog::info("{} with {}, chosen on the page", scene_.file.string(), names(scene_.tools));
  for (ToolChoice& tool : tools_) tool.start.clear();
  live_ = settings_at_start();
  begin(Asked::kNone);
}

void ClientRun::show_world(const protocol::Welcome* welcome) {
  page_->show_world(page_world({.environment = *environment_,
                                .scene = scene_,
                                .scenes = scenes_,
                                .start = tools_.front().start,
                                .welcome = welcome}));
}

void ClientRun::show(const FrameResult& result) {
  if (result.inbox.welcomed) {
    page_->forget_session();
    // What no page has changed is as the server was started.
    const Tuning& own = first_client().welcome().tuning;
    live_.tuning = carried_over(live_.tuning, own_tuning_, own);
    own_tuning_ = own;
    show_world(&first_client().welcome());
  }
  if (result.inbox.lost) page_->forget_session();
  PageFrame frame = page_frame(*environment_, first_client(), result);
  frame.rejected = result.inbox.reject;
  frame.settings = live_;
  page_->show_frame(std::move(frame));
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
    for (ToolSession& session : sessions_) session.link().pump();
    clock_.sleep_until(clock_.now() + kPumpPeriod);
  }
  clock_.sleep_until(time);
}

void ClientRun::set_conditions(const NetworkConditions& conditions) {
  for (ToolSession& session : sessions_) session.link().set_conditions(conditions);
}

}  // namespace hlm::ve
