// The client library: a simulator gives its contacts and gets the proxy. It depends on no engine.
// examples/client is a whole simulator built on it.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hlm/client/acceleration_trend.h"
#include "hlm/client/impulse_playout.h"
#include "hlm/client/session_page.h"
#include "hlm/client/world_time.h"
#include "hlm/common/contact.h"
#include "hlm/common/tool_description.h"
#include "hlm/common/tool_model.h"
#include "hlm/protocol/client_session.h"
#include "hlm/protocol/scene_offer.h"

namespace hlm {

struct HapticClientOptions {
  protocol::Endpoint server;
  ToolDescription tool;     ///< Must be valid (find_error).
  Configuration q;          ///< Where the tool is: the proxy of the first session starts there.
  double ve_rate = 60;      ///< Nominal step rate of the simulator, Hz.
  double epsilon = 0.005;   ///< Contacts up to this separation are given to send(), m.
  std::uint64_t nonce = 0;  ///< Nonce of the first session; 0: random, as all later ones are.
  /// A person asks for the first session: if it begins within 2 s, it ends a fault that was
  /// released at the device.
  bool clears_fault = true;
  protocol::TelemetryObserver* telemetry = nullptr;  ///< See control(). Must outlive the client.
};

/// Where the server has a body; with an even number for the last time.
struct HeldPlace : protocol::HeldBody {
  JointState joint{};  ///< Of the joint that it hangs on.
};
using HeldPlaces = std::vector<HeldPlace>;

/// The simulator's side of one haptic session at a time; it asks for a new one when the server has
/// been silent or restarted. Never waits. Not thread-safe. `now`: s, any steady origin.
class HapticClient {
 public:
  using Inbox = protocol::ClientSession::Inbox;

  HapticClient(protocol::DatagramLink& link, const HapticClientOptions& options);

  /// Takes what arrived, and keeps asking while there is no session. Call once before each step.
  /// Inbox::state is the latest proxy state, null if none came since the last call; draw the tool
  /// toward its q (and q̇).
  Inbox poll(double now);
  /// How many steps of `step` seconds a real-time engine must take in the frame that begins, after
  /// poll(). This makes up for late frames. With 0 there is nothing to take, sample or send. It is
  /// 0 until the server has the offered shapes, for up to 10 s: what lies on the tool would fall.
  int take_steps(double step);
  /// The tool's impulses on movable bodies (N·s; about the centre of mass N·m·s; world axes) for a
  /// step of H = `period` seconds that begins. The simulator must apply them, as a wrench P/H on
  /// the body: the next update says that its bodies contain them. Nothing else of the tool may push
  /// those bodies.
  DueImpulses take_impulses(double period);

  /// Bodies that the simulator must place in the frame that begins, before its step, as it places
  /// the tool: those that the hand holds, in each frame, and once more one that it has let go of,
  /// which is the simulator's from there on. It says which are the server's in send().
  HeldPlaces take_held();
  /// Whether the server moves what the hand holds, or will as soon as it has the shapes: of the
  /// bodies whose inertia was offered. send() needs those alone that touch one without.
  bool holds() const noexcept;
  /// Whether that is one of them.
  bool holds(std::uint32_t body) const noexcept;
  /// Whether the simulator's tool itself pushes what it touches in the frame that begins, for a
  /// program that calls take_steps(): until the impulses cover whole frames and, where send() had
  /// no bodies as the server moves what the hand holds, while it holds none.
  bool tool_pushes() const noexcept;

  /// The simulator's time goes at this pace in the hand's, 0 (it stands still) to 1, from the next
  /// send() on, which reports what moves as the hand's time sees it.
  void set_pace(double pace) { slowed_ = static_cast<std::uint8_t>(std::lround(255 * (1 - pace))); }
  /// After a step of `period` simulated seconds: the tool's configuration and velocity, for which
  /// the contacts of the next send() are computed.
  void sample(double now, const Configuration& q, const Velocity& v, double period);
  /// Finds how the accelerations of the latest sample's bodies change, for the next send(). Call
  /// once for each sample. `bodies`: without what other hands do to them, which responds to this
  /// one.
  void follow_accelerations(const MovableBodies& bodies);
  /// What pushes the tool of the latest sample besides contacts and its weight, for the next
  /// send(): a weld, a tendon, a payload, drag, a force sensor. The server finds how it depends on
  /// the tool's motion. F_W: about the origin of the link's frame; several on one link add up. Call
  /// after sample(). Throws std::invalid_argument if the tool has no such link.
  void add_external(std::uint8_t link, const Wrench& F_W);
  /// Their sum on a link, of the latest sample.
  Wrench external(std::uint8_t link) const;
  /// The drives of the tool's joints, from the next send() on.
  void drive(const JointDrives& drives) { update_.drives = drives; }
  /// Whether there are some that the server does not know: joints are loose then.
  bool drives_in_vain() const noexcept {
    return connected() && !update_.drives.empty() && !welcome().capabilities.guides;
  }
  /// Sends the contacts within ε of the latest sample, and the bodies that the tool can push. A
  /// body that a contact names but that is not in `bodies` moves as the contact's v_WC says. With a
  /// scene (below) `contacts` are only those that no shape of it makes, and `poses` those of its
  /// bodies, pushable ones included. Returns the update's sequence number, 0 without a session.
  std::uint64_t send(double now, const ReportedContacts& contacts, const MovableBodies& bodies = {},
                     const BodyPoses& poses = {});

  /// Gives servers that take scenes the shapes of the world, in this session and all later ones, in
  /// place of earlier offers. They go out with send() and are in force when has_scene(); until then
  /// the previous ones are. Throws std::invalid_argument that names the shape, its value and what
  /// is allowed.
  void offer_scene(protocol::SceneOffer scene);
  /// Whether the server finds the contacts of the offered shapes, so that send() needs none.
  bool has_scene() const noexcept { return connected() && scene_in_force_; }
  /// Why the server does not find contacts in the offered scene, for a person; empty while there is
  /// no known reason.
  const std::string& scene_problem() const noexcept { return scene_problem_; }
  /// What the server says about the scene.
  const protocol::SceneState& scene_state() const noexcept { return session_.scene_state(); }

  /// What the person here asks of the server, from the next send() on: telemetry, the hand of a
  /// simulated device, other physics. What people at the page ask for comes first.
  void control(const protocol::Control& control);

  /// Starts a program that serves the page of this session to browsers on this machine: the offered
  /// shapes, contacts and forces, charts; the mouse is the hand of a simulated device. It ends with
  /// the client. Waits until the page is ready. A second call returns the same address, or starts
  /// another page if that one has ended. Throws std::runtime_error that says why there is no page.
  const std::string& show(const SessionPageOptions& options = {});
  /// Ends the session.
  void close(double now) { session_.close(now); }

  bool connected() const noexcept { return session_.active(); }
  /// Number of the present session; 0 without one.
  std::uint64_t session_id() const noexcept { return session_.id(); }
  /// Latest measured round trip without the server's hold, s; 0 before the first.
  double round_trip() const noexcept { return session_.round_trip(); }
  /// Simulated time, s: the sum of all periods.
  double ve_time() const noexcept { return update_.ve_time; }
  /// The welcome of the present session; valid while connected().
  const protocol::Welcome& welcome() const noexcept { return session_.welcome(); }
  const protocol::ReceiveStatistics& statistics() const noexcept { return session_.statistics(); }

 private:
  /// Hands telemetry on to whoever asked for it.
  struct Telemetry final : protocol::TelemetryObserver {
    void observe(const protocol::Ticks& ticks) override;
    void observe(const protocol::LocalState& state) override;

    TelemetryObserver* own = nullptr;
    std::unique_ptr<SessionPage> page;
  };

  void hear_held(const Inbox& inbox);
  void let_go(const HeldPlace& body);
  void take_back();
  void take_back(HeldPlace& body);
  void find_joints(HeldPlaces& places) const;
  void tell_owners(const BodyPoses& poses);
  bool waits_for_scene() const noexcept;
  void offer();
  void queue_scene();
  void show_scene();
  void tell_page(double now, const Inbox& inbox);

  HapticClientOptions options_;
  Telemetry telemetry_;
  protocol::ClientSession session_;
  protocol::Control control_;       ///< What the program asks for.
  protocol::ContactUpdate update_;  ///< Update of the latest sample.
  ImpulsePlayout playout_;
  AccelerationTrend trend_;
  HeldPlaces held_;          ///< The newest that is known of each body.
  std::uint8_t slowed_ = 0;  ///< As in Ownership, of all bodies.
  HeldPlaces let_go_;        ///< Those to be placed for the last time.
  WorldTime world_time_;
  double ve_rate_;             ///< Hz.
  bool in_real_time_ = false;  ///< The simulator asks how many steps to take.
  bool stood_still_ = false;   ///< The world does not make up for the time before this frame.
  bool is_answered_ = false;   ///< With the latest poll(), since what counts was sent.
  std::uint64_t first_in_scene_ = 0;  ///< Sequence of the first update in a scene; 0: none yet.
  int answered_ = 0;  ///< Frames since the session's first one, up to kHandOver + 1.
  double sampled_at_ = 0;
  double polled_at_ = 0;
  double welcomed_at_ = 0;
  std::size_t tool_links_;
  std::optional<protocol::SceneOffer> scene_;  ///< What is offered.
  protocol::OfferedBefore offered_;            ///< In this session.
  bool scene_in_force_ = false;
  std::string scene_problem_;
};

}  // namespace hlm
