// One run of the client: the world, the sessions on it, and the page that shows both.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "hlm/page/live_page.h"
#include "hlm/ve_client/run/clock.h"
#include "hlm/ve_client/run/frame.h"
#include "hlm/ve_client/run/settings.h"
#include "hlm/ve_client/run/tool_session.h"
#include "hlm/ve_client/scene/scene.h"

namespace hlm::ve {

class ClientRun {
 public:
  /// `settings` must outlive this. Throws std::runtime_error with one line if world, tool, server's
  /// name, page or capture file cannot be used (UsageError for the first two); no file is begun
  /// before the others are known to be usable.
  explicit ClientRun(const Settings& settings);
  /// What is loaded for a page meanwhile is given up.
  ~ClientRun();
  ClientRun(const ClientRun&) = delete;
  ClientRun& operator=(const ClientRun&) = delete;

  /// Frames at their rate until their duration is over or stop() is true. Throws NeverAnswered if
  /// the server has granted no session by the end or in time, std::runtime_error if it cannot be
  /// used, or the capture not be written.
  void go(const std::function<bool()>& stop);

 private:
  /// The sessions that a person asks for, knowing of a fault of their servers.
  enum class Asked { kNone, kFirst, kAll };

  LiveSettings settings_at_start() const;
  /// Sessions with the present scene as it was at the start.
  void begin(Asked asked);
  void offer_scenes();
  void offer_scene(std::size_t tool);
  void frame(double period);
  void report(const std::string& fault);
  void take_page_requests();
  /// Loads the scene that a page has chosen, and then plays it; meanwhile, and if it cannot be
  /// played, the present one goes on.
  void change_scene();
  /// welcome: null before the server has answered.
  void show_world(const protocol::Welcome* welcome);
  void show(const FrameResult& result);
  FramePeriods& periods();
  /// Datagrams that are held back leave in time, within a millisecond.
  void wait_until(double time);
  void set_conditions(const NetworkConditions& conditions);
  HapticClient& first_client() { return sessions_.front().client(); }

  const Settings& settings_;
  Scene scene_;                    ///< Scene as loaded.
  std::vector<ToolChoice> tools_;  ///< Tools as they begin; the scene knows their names.
  std::optional<VirtualEnvironment> environment_;
  std::vector<protocol::Endpoint> servers_;
  std::optional<protocol::noise::Key> key_;
  std::unique_ptr<LivePage> page_;    ///< Null: none.
  std::vector<SceneSummary> scenes_;  ///< Scenes for the page's menu.
  SceneRequest chosen_;               ///< What is loaded for a page.
  std::atomic<bool> ended_ = false;   ///< Nobody waits for what is loaded any more.
  std::future<Scene> loading_;        ///< Valid while it is.
  SteadyClock clock_;
  Tuning own_tuning_;  ///< What the first server was started with.
  LiveSettings live_;
  bool offered_shapes_ = false;  ///< Whether the servers have been offered the shapes.
  double spread_;                ///< Spread of the drawn rates about live_.rate, Hz.
  std::mt19937_64 engine_;
  std::optional<FramePeriods> periods_;
  double low_ = 0;                    ///< Lowest rate of periods_, Hz.
  std::deque<ToolSession> sessions_;  ///< One for each tool; pages show and drive the first.
  bool begun_ = false;                ///< There have been sessions.
  bool fault_reported_ = false;       ///< The present environment's fault was reported.
};

}  // namespace hlm::ve
