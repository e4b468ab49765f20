// The live page: takes what pages ask for, and shows them the session (docs/page_messages.md).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "hlm/page/live_settings.h"
#include "hlm/page/page_messages.h"
#include "hlm/page/page_requests.h"
#include "hlm/page/web/page_server.h"
#include "hlm/protocol/client_session.h"

namespace hlm::ve {

/// Between the frame's thread, which owns this, and the page server's. Never waits.
class LivePage final : public protocol::TelemetryObserver {
 public:
  /// Throws std::runtime_error as PageServer does.
  explicit LivePage(const PageServerOptions& options)
      : server_(options), recordings_(options.recordings) {}

  std::uint16_t port() const noexcept { return server_.port(); }

  /// Before a frame, grants the requests of pages in the order of arrival, and refuses settings out
  /// of range with the range. Non-empty if the session has to begin again, with the world as it was
  /// at the start; the settings are then `at_start`, except those changed after the reset.
  /// A hold that its page does not repeat for kLease ends. now: a steady clock, s.
  std::optional<ResetRequest> take_requests(double now, LiveSettings& settings,
                                            const LiveSettings& at_start);
  /// How many single steps of the world were asked for since the last call.
  int take_steps() { return std::exchange(steps_, 0); }
  /// What a page pulls at. It ends as a hold of the hand does.
  const std::optional<BodyPull>& pull() const { return pull_; }
  /// The scene that was chosen last, once.
  std::optional<SceneRequest> take_scene() { return std::exchange(chosen_, std::nullopt); }
  /// The scene cannot be played: `text` says why, in one line.
  void refuse(const SceneRequest& scene, const std::string& text);
  /// The control for a haptic server that was started with the tuning `own`.
  protocol::Control control(const LiveSettings& settings, const Tuning& own) const;

  /// The world as built, for all pages, now and later.
  void show_world(const PageWorld& world);
  /// Shows a frame that has ended. `state` may be null: the latest of the session is kept, as is
  /// what `rejected` says. `tool` and what is the page's own are filled in here.
  void show_frame(PageFrame frame);
  /// The session is over, or another began. Whoever held the hand has to grab it again.
  void forget_session();

  void observe(const protocol::Ticks& ticks) override;
  void observe(const protocol::LocalState& state) override { contacts_ = state; }

 private:
  /// Pages repeat what they hold every 0.2 s.
  static constexpr double kLease = 1;  // s

  void take_hand(std::uint64_t page, const HandRequest& hand, double now);
  void take_pull(std::uint64_t page, const PullRequest& wanted, double now);
  /// What the page holds.
  void let_go(std::uint64_t page);
  void take(const PageRequest& request, double now, LiveSettings& settings,
            const LiveSettings& at_start, std::optional<ResetRequest>& reset);

  void look_for_recordings(double now);

  PageServer server_;
  std::vector<std::filesystem::path> recordings_;  ///< Where they may be.
  std::string recording_;                          ///< Name of the latest; empty: none.
  double looked_at_ = -1e9;                        ///< Time of the latest look for recordings, s.
  WorldTraits world_;
  PageTool tool_;
  std::optional<SceneRequest> chosen_;
  std::optional<std::uint64_t> holding_page_;  ///< The page that holds the hand.
  double held_at_ = 0;                         ///< When it last repeated the hold, s.
  Pose X_WTarget_;
  std::optional<BodyPull> pull_;
  std::uint64_t pulling_page_ = 0;
  double pulled_at_ = 0;  ///< s.
  int steps_ = 0;
  std::optional<protocol::ProxyState> state_;  ///< Latest state of the session.
  std::optional<protocol::Reject> rejected_;   ///< The server's latest answer, if it was that.
  std::optional<protocol::LocalState> contacts_;
  TickBatch ticks_;
};

}  // namespace hlm::ve
