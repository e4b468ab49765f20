// The local model of interaction: a dynamic proxy of the virtual tool among local contacts, and the
// movable bodies near it.
//
// Between two updates of the virtual environment it answers, at the servo rate, what the hand
// feels. It knows no socket, clock, thread or device. No function allocates, locks, throws or
// waits.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include "hlm/common/tool_model.h"
#include "hlm/common/vocabulary.h"
#include "hlm/haptic_server/local_model/body_impulses.h"
#include "hlm/haptic_server/local_model/contact_forces.h"
#include "hlm/haptic_server/local_model/contact_update.h"
#include "hlm/haptic_server/local_model/hand_map.h"
#include "hlm/haptic_server/local_model/joint_limits.h"
#include "hlm/haptic_server/local_model/local_contact.h"
#include "hlm/haptic_server/local_model/near_body.h"
#include "hlm/haptic_server/local_model/parameters.h"
#include "hlm/haptic_server/local_model/scene_contacts.h"
#include "hlm/haptic_server/local_model/stiffness_limit.h"
#include "hlm/haptic_server/local_model/wrench_field.h"

namespace hlm::server {

/// What acts on the proxy at the hand during one step: the wrench F at its start, and how that
/// changes with the twist V at its end, F⁺ = F - K Δt V⁺ - B (V⁺ - V). World axes.
struct HandInput {
  Wrench F = Wrench::Zero();
  Vector6 stiffness = Vector6::Zero();  ///< Diagonal of K: N/m, then N·m/rad.
  Vector6 damping = Vector6::Zero();    ///< Diagonal of B: N·s/m, then N·m·s/rad.
};

/// What contacts and weight do to the hand in one step, world axes, at the hand's frame.
struct ContactWrench {
  /// Eq. 8: penalty, friction, the tool's weight and external wrenches, N and N·m.
  Wrench F = Wrench::Zero();
  Wrench weight = Wrench::Zero();   ///< The part of F that is no contact's, N and N·m.
  Wrench impulse = Wrench::Zero();  ///< Eq. 12 before division by Δt: N·s and N·m·s.
};

inline const MovableBodies kNoBodies;
inline const BodyPoses kNoPoses;
inline const AccelerationRates kNoRates;
inline const ExternalWrenches kNoWrenches;
inline const Ownerships kNoOwners;

/// What the environment reports.
struct ModelUpdate {
  const ReportedContacts& contacts;
  const Configuration& q_VE;  ///< Configuration of the tool for which the contacts hold.
  double age = 0;             ///< Age of the contacts with constraints of the world, s.
  const MovableBodies& bodies = kNoBodies;
  double impulse_step = 0;  ///< The bodies' state is that of this step, or part of one; 0: unknown.
  double period = 0;        ///< Period of the environment's frames, s.
  const BodyPoses& poses = kNoPoses;  ///< Where the scene's bodies are; others are not there.
  const AccelerationRates& rates = kNoRates;  ///< Of bodies.
  double time = 0;                            ///< The environment's, s.
  const Velocity* v_VE = nullptr;             ///< Of the tool at q_VE; null: nothing is external.
  /// Several on one link add up; of a link that is not named there is none.
  const ExternalWrenches& external = kNoWrenches;
  const Ownerships& owners = kNoOwners;  ///< Of `poses`.
  bool holds = true;                     ///< The server may move what bears upon the tool.
};

/// Where a body is that the server moves, or gives back.
struct HeldState {
  std::uint32_t number = 0;  ///< Of Ownership.
  BodyPose pose;
};

class LocalModel {
 public:
  /// `tool` and `parameters` must be valid. q: the proxy's initial configuration; it starts at
  /// rest. dt: step, s.
  LocalModel(const ToolDescription& tool, const Configuration& q,
             const LocalModelParameters& parameters, double dt) noexcept;

  /// Other parameters from here on; they must be valid.
  void set_parameters(const LocalModelParameters& parameters) noexcept { parameters_ = parameters; }
  const LocalModelParameters& parameters() const noexcept { return parameters_; }

  /// The geometry near the hand is that of `scene` from here on, which outlives its use; null:
  /// there is none. Its bodies are where the latest update said.
  void set_scene(Scene* scene) noexcept;
  const Scene* scene() const noexcept { return scene_; }
  /// Whether it says enough of bodies that the server moves what the hand holds.
  bool holds() const noexcept { return scene_ != nullptr && scene_->holds(); }
  /// What would be left out of a scene whose contacts were searched for now: more than a tick has
  /// time for.
  geometry::FinderCut try_scene(Scene& scene) noexcept;
  /// What the latest search for contacts in the scene left out. Loaded ones that it may have missed
  /// stay as planes.
  const geometry::FinderCut& cut() const noexcept { return cut_; }
  /// There is no scene from here on, but the contacts found in it stay, as planes, until the next
  /// update or set_scene().
  void keep_contacts() noexcept;
  bool keeps_contacts() const noexcept { return keeps_contacts_; }

  /// External wrenches act with this force at most, N.
  void bound_external(double most) noexcept { most_external_ = most; }

  void adopt(const ModelUpdate& update) noexcept;

  /// `steps` periods of the loop were missed. While the device `holds` its force, contacts keep the
  /// force of the previous step, without its impulses, and bodies get it; the proxy waits.
  void miss(std::uint64_t steps, bool holds) noexcept;
  /// What bodies have received so far is reported to the environment.
  void report_impulses() noexcept;
  /// The environment is silent: the tool lets go of the bodies. The next update brings them back as
  /// they are then.
  void release_bodies() noexcept;
  /// Or it goes on holding, and what is moved ahead of reports stands still until then.
  void stop_ahead() noexcept;
  /// Whether a body is moved ahead of the environment's reports.
  bool moves_ahead() const noexcept;

  /// Moves the proxy and the bodies by one step under the hand's wrench, weight and contacts
  /// (Eqs. 7-12). floats: the proxy weighs nothing.
  ContactWrench step(const HandInput& hand, bool floats = false) noexcept;

  /// Without proxy dynamics: puts the proxy at q with velocity v and evaluates its contacts there.
  /// There is no impulse: what collides is the device, whose own mass the contacts' penalty stops.
  ContactWrench follow(const Configuration& q, const Velocity& v) noexcept;
  /// Share in [0, 1] of the work of follow()'s wrench that the device renders. Work that was not
  /// rendered does not fill the healing tank.
  void set_rendered(double share) noexcept { rendered_ = share; }

  const ToolModel& proxy() const noexcept { return proxy_; }
  const Velocity& velocity() const noexcept { return v_; }
  /// Twist of the hand's frame, world axes.
  Twist hand_twist() const noexcept { return proxy_.hand_jacobian().lazyProduct(v_); }
  /// Contacts of the tool, sorted by identity.
  const LocalContacts& contacts() const noexcept { return contacts_[current_]; }
  /// Contacts of the bodies without the tool.
  const LocalContacts& supports() const noexcept { return supports_[current_]; }
  /// Limits of the tool's joints.
  const LocalContacts& limits() const noexcept { return limits_.contacts(); }
  const LocalBodies& bodies() const noexcept { return bodies_; }
  /// What the environment must place, or take back.
  StaticVector<HeldState, kMaxPoses> held() const noexcept;
  /// τ of weight and external wrenches in the latest step, N or N·m.
  const GeneralisedForce& load() const noexcept { return load_; }
  const BodyImpulses& impulses() const noexcept { return impulses_; }
  ProxyContactState state() const noexcept { return state_; }
  /// Factor on the contacts' stiffness, 1 unless limited.
  double stiffness_scale() const noexcept { return stiffness_scale_; }
  /// Energy that contacts may use to come back to where they are reported, J; below 0 it is owed.
  double healing_tank() const noexcept { return tank_; }
  /// The tool at the configuration of the latest update.
  const ToolModel& ve_tool() const noexcept { return ve_tool_; }

 private:
  /// Shares of a tick's work of searching: the tool's, which is what is felt, and each look of it
  /// at the end of a step, of which there are two at most; bodies have the rest.
  static constexpr double kWorkOfTool = 0.6;
  static constexpr double kWorkAtEnd = 0.05;

  LocalContacts& present() noexcept { return contacts_[current_]; }
  LocalContacts& present_supports() noexcept { return supports_[current_]; }
  UpdatePolicy policy() const noexcept;
  ContactLaw contact_law(ContactStep step) const noexcept;
  ContactLaw support_law(double dt, double ahead) const noexcept;

  void adopt_external(const ModelUpdate& update) noexcept;
  void begin_external(MassMatrix& E, GeneralisedForce& r) noexcept;
  GeneralisedForce end_external() noexcept;
  LocalBodies with_reported(const LocalBodies& held, const ModelUpdate& update,
                            double state_step) noexcept;
  void adopt_poses(const ModelUpdate& update, const LocalBodies& bodies) noexcept;
  void adopt_held(const ModelUpdate& update, const LocalBodies& held) noexcept;
  void set_bodies(const LocalBodies& bodies) noexcept;
  bool is_local(std::uint32_t body) const noexcept;
  NearBody* near_body(const ContactSide& side) noexcept;
  bool is_as_it_was(std::uint32_t body) const noexcept;
  LocalBodies that_stay(const ModelUpdate& update) noexcept;
  void take(NearBody& body) noexcept;
  void take_mechanism(const Mechanism& mechanism) noexcept;
  void begin_holding(NearBody& near, LocalBody& local) noexcept;
  void keep_mechanisms(LocalBodies& bodies) noexcept;
  bool bears(const geometry::FoundContact& found) noexcept;
  void take_bearing(std::span<const geometry::FoundContact> found) noexcept;
  void give_back(const MetContacts& met, const MetContacts& met_by_bodies) noexcept;
  Vector3 velocity_of(const ContactSide& side, const Vector3& p_W) noexcept;
  void adopt_supports_of_scene(const LocalContacts& existing, UpdateFrames& frames,
                               const LocalBodies& bodies) noexcept;
  void adopt_contacts_of_scene(const LocalContacts& existing, const UpdateFrames& frames,
                               const LocalBodies& bodies) noexcept;
  void forget_bodies_of_scene() noexcept;
  bool is_touched(const LocalBody& body) const noexcept;
  double replay_start(double from) const noexcept;
  void advance_near_bodies() noexcept;
  void place_scene(const ToolModel& tool, const LocalBodies& bodies, double ahead = 0) noexcept;
  void look_around() noexcept;
  struct StepEnd {
    FramePoses poses;
    MetContacts met;
  };
  std::optional<StepEnd> meet_at_end(const FrameMotions& frames, const Unknowns& x) noexcept;
  void correct_step(ContactGroups groups, const FrameMotions& frames, const StepSystem& system,
                    Unknowns& x) noexcept;
  void meet_tool(const LocalBodies& bodies, const LocalContacts& existing, bool takes,
                 MetContacts& met) noexcept;
  void meet_bodies(const LocalBodies& bodies, const LocalContacts& existing, double dt, bool takes,
                   MetContacts& met) noexcept;
  void meet(std::span<const geometry::FoundContact> found, const LocalBodies& bodies,
            MetContacts& met) const noexcept;
  /// Of searching, as a share of what a tick allows.
  std::uint64_t work_in_tick(double share) const noexcept;
  double fastest_body(const LocalBodies& bodies) const noexcept;
  double margin(double speed, const LocalContacts& contacts, double dt) const noexcept;
  void replay(LocalBodies& bodies, double from) noexcept;
  void look_along(LocalBodies& bodies, double dt) noexcept;
  void correct_gradually(LocalBodies& updated, double period) const noexcept;
  double damping_on(const LocalBody& body) const noexcept;
  void evaluate(const FrameMotions& frames) noexcept;
  GeneralisedForce apply_explicitly(const FrameMotions& frames, const ContactLaw& law,
                                    Unknowns& x) noexcept;
  GeneralisedForce collide(const FrameMotions& frames, const Eigen::LLT<MassMatrix>& D) noexcept;
  void limit_stiffness(const FrameMotions& frames, const Eigen::LLT<MassMatrix>& D,
                       const HandMap& H) noexcept;
  void add_impulse(const LocalContact& contact, const Vector3& P_W) noexcept;
  /// Adds energy that there is to heal with, J, up to what the tank holds.
  void fill_tank(double energy) noexcept;
  void end_step(const FrameMotions& frames, const Unknowns& x) noexcept;

  LocalModelParameters parameters_;
  double dt_;
  ToolModel proxy_;
  ToolModel ve_tool_;
  Velocity v_;
  std::array<LocalContacts, 2> contacts_;  ///< The present ones, and room for the next update.
  std::array<LocalContacts, 2> supports_;  ///< Supports, in the same two places.
  std::size_t current_ = 0;
  JointLimits limits_;
  StaticVector<WrenchField, kMaxLinks> external_;                   ///< Of each link.
  double most_external_ = std::numeric_limits<double>::infinity();  ///< N.
  GeneralisedForce load_;
  LocalBodies bodies_;
  Mechanisms mechanisms_;
  double adopted_step_ = 0;  ///< World step that the latest update is about.
  BodyImpulses impulses_;
  ProxyContactState state_ = ProxyContactState::kFreeMotion;
  StiffnessLimit stiffness_limit_;
  double stiffness_scale_ = 1;
  double tank_ = 0;  ///< J.
  double rendered_ = 1;

  Scene* scene_ = nullptr;
  NearBodies near_bodies_;
  bool may_hold_ = true;         ///< Bodies that bear upon the tool are taken.
  double unheard_ = 0;           ///< Since the latest update, s.
  GeometryChange change_;        ///< Since its contacts were found.
  geometry::FinderCut cut_;      ///< Of tool and bodies.
  bool looked_ = false;          ///< They are those of the present poses.
  bool keeps_contacts_ = false;  ///< They are those of the scene that was.
};

}  // namespace hlm::server
