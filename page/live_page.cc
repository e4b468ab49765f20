#include "hlm/page/live_page.h"

#include <memory>

#include "hlm/common/settings/directories.h"

namespace hlm::ve {

std::optional<ResetRequest> LivePage::take_requests(double now, LiveSettings& settings,
                                                    const LiveSettings& at_start) {
  std::optional<ResetRequest> reset;
  for (const PageRequest& request : server_.take_requests()) {
    take(request, now, settings, at_start, reset);
  }
  if (now - held_at_ > kLease) holding_page_.reset();
  if (now - pulled_at_ > kLease) pull_.reset();
  if (server_.pages() > 0) look_for_recordings(now);
  return reset;
}

void LivePage::look_for_recordings(double now) {
  constexpr double kPeriod = 1;  // s.
  if (now - looked_at_ < kPeriod) return;
  looked_at_ = now;
  const auto newest = settings::find_newest_recording(recordings_);
  recording_ = newest ? newest->filename().string() : "";
}

void LivePage::take_hand(std::uint64_t page, const HandRequest& hand, double now) {
  const bool holds = holding_page_ == page;
  if (!hand.X_WTarget) {
    if (holds) holding_page_.reset();
    return;
  }
  if (!holds && holding_page_) {
    return server_.answer(page, refused_message("hand", "", "another page holds the hand"));
  }
  if (!holds && !hand.grab) {
    return server_.answer(page,
                          refused_message("hand", "", "the hand was released: grab it again"));
  }
  holding_page_ = page;
  X_WTarget_ = *hand.X_WTarget;
  held_at_ = now;
}

void LivePage::take_pull(std::uint64_t page, const PullRequest& wanted, double now) {
  if (pull_ && pulling_page_ != page) {
    if (!wanted.pull) return;
    return server_.answer(page, refused_message("pull", "", "another page pulls a body"));
  }
  pull_ = wanted.pull;
  pulling_page_ = page;
  pulled_at_ = now;
}

void LivePage::let_go(std::uint64_t page) {
  if (holding_page_ == page) holding_page_.reset();
  if (pulling_page_ == page) pull_.reset();
}

void LivePage::take(const PageRequest& request, double now, LiveSettings& settings,
                    const LiveSettings& at_start, std::optional<ResetRequest>& reset) {
  if (request.closed) return let_go(request.page);
  const ParsedRequest parsed = parse_request(request.text, settings, world_);
  if (const auto* hand = std::get_if<HandRequest>(&parsed)) {
    take_hand(request.page, *hand, now);
  } else if (const auto* pull = std::get_if<PullRequest>(&parsed)) {
    take_pull(request.page, *pull, now);
  } else if (std::holds_alternative<StepRequest>(parsed)) {
    ++steps_;
  } else if (const auto* changed = std::get_if<SettingsRequest>(&parsed)) {
    settings = changed->settings;
  } else if (const auto* telemetry = std::get_if<TelemetryRequest>(&parsed)) {
    server_.set_telemetry(request.page, telemetry->on);
  } else if (const auto* refusal = std::get_if<Refusal>(&parsed)) {
    server_.answer(request.page, refused_message(refusal->field, refusal->value, refusal->text));
  } else if (const auto* scene = std::get_if<SceneRequest>(&parsed)) {
    chosen_ = {scene->name, request.page};
  } else if (const auto* wanted = std::get_if<ResetRequest>(&parsed)) {
    holding_page_.reset();
    pull_.reset();
    settings = at_start;
    if (!reset || wanted->start) reset = *wanted;
  }
}

void LivePage::refuse(const SceneRequest& scene, const std::string& text) {
  server_.answer(scene.page, refused_message("scene", scene.name, text));
}

protocol::Control LivePage::control(const LiveSettings& settings, const Tuning& own) const {
  protocol::Control control;
  control.telemetry = server_.telemetry_wanted();
  control.holds = holding_page_.has_value();
  control.X_WTarget = X_WTarget_;
  control.tuned = settings.tuning != own;
  control.tuning = settings.tuning;
  return control;
}

void LivePage::show_world(const PageWorld& world) {
  world_ = {.links = world.tool.description.links.size(),
            .starts = world.starts,
            .scenes = {},
            .movable = {},
            .environment = world.environment};
  for (const SceneSummary& scene : world.scenes) world_.scenes.push_back(scene.name);
  for (std::size_t i = 0; i < world.bodies.size(); ++i) {
    const PageBody& body = world.bodies[i];
    if (!body.fixed && !body.is_tool) world_.movable.push_back(static_cast<int>(i));
  }
  pull_.reset();
  tool_ = world.tool;
  server_.set_greeting(std::make_shared<const std::string>(world_message(world)));
}

void LivePage::show_frame(PageFrame frame) {
  if (frame.state != nullptr) state_ = *frame.state;
  if (frame.rejected) rejected_ = frame.rejected;
  if (frame.connected) rejected_.reset();
  if (server_.pages() == 0) {
    if (!ticks_.empty()) ticks_.take();
    return;
  }
  frame.tool = &tool_;
  frame.state = state_ ? &*state_ : nullptr;
  if (!server_.telemetry_wanted()) contacts_.reset();  // or old ones would be shown later
  frame.contacts = contacts_ ? &*contacts_ : nullptr;
  frame.held = holding_page_.has_value();
  frame.rejected = rejected_;
  frame.recording = recording_;
  server_.publish(std::make_shared<const std::string>(frame_message(frame)));
  if (!ticks_.empty()) server_.publish_binary(std::make_shared<const std::string>(ticks_.take()));
}

void LivePage::forget_session() {
  state_.reset();
  rejected_.reset();
  contacts_.reset();
  holding_page_.reset();
}

void LivePage::observe(const protocol::Ticks& ticks) {
  // A batch has consecutive steps: after a lost datagram another one begins.
  if (!ticks_.continues(ticks)) {
    server_.publish_binary(std::make_shared<const std::string>(ticks_.take()));
  }
  ticks_.add(ticks);
}

}  // namespace hlm::ve
