// The local model of interaction: a dynamic proxy of the virtual tool among local contacts, and the
// movable bodies near it.
//
// Between two updates of the virtual environment it answers, at the servo rate, what the hand
// feels. It knows no socket, clock, thread or device. No function allocates, locks, throws or
// waits.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "hlm/common/tool_model.h"
#include "hlm/common/vocabulary.h"
#include "hlm/haptic_server/local_model/bodies.h"
#include "hlm/haptic_server/local_model/body_impulses.h"
#include "hlm/haptic_server/local_model/contact_forces.h"
#include "hlm/haptic_server/local_model/contact_sets.h"
#include "hlm/haptic_server/local_model/contact_update.h"
#include "hlm/haptic_server/local_model/hand_map.h"
#include "hlm/haptic_server/local_model/healing_tank.h"
#include "hlm/haptic_server/local_model/joint_limits.h"
#include "hlm/haptic_server/local_model/loads.h"
#include "hlm/haptic_server/local_model/model_update.h"
#include "hlm/haptic_server/local_model/parameters.h"
#include "hlm/haptic_server/local_model/scene_search.h"
#include "hlm/haptic_server/local_model/stiffness_limit.h"

namespace hlm::server {

/// What acts on the proxy at the hand during one step: the wrench F at its start, and how that
/// changes with the twist V at its end, F⁺ = F - K Δt V⁺ - B (V⁺ - V). World axes.
struct HandInput {
  Wrench F = Wrench::Zero();
  Vector6 stiffness = Vector6::Zero();  ///< Diagonal of K: N/m, then N·m/rad.
  Vector6 damping = Vector6::Zero();    ///< Diagonal of B: N·s/m, then N·m·s/rad.
  std::optional<double> opening = {};   ///< Of the device's gripper, 0 closed to 1 open.
};

/// What contacts and weight do to the hand in one step, world axes, at the hand's frame.
struct ContactWrench {
  /// Eq. 8: penalty, friction, the tool's weight and external wrenches, N and N·m.
  Wrench F = Wrench::Zero();
  Wrench weight = Wrench::Zero();   ///< The part of F that is no contact's, N and N·m.
  Wrench impulse = Wrench::Zero();  ///< Eq. 12 before division by Δt: N·s and N·m·s.
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
  void set_scene(Scene* scene) noexcept { search_.set_scene(scene, bodies_.near()); }
  const Scene* scene() const noexcept { return search_.scene(); }
  /// Whether it says enough of bodies that the server moves what the hand holds.
  bool holds() const noexcept { return search_.holds(); }
  /// What would be left out of a scene whose contacts were searched for now: more than a tick has
  /// time for.
  geometry::FinderCut try_scene(Scene& scene) noexcept;
  /// What the latest search for contacts in the scene left out. Loaded ones that it may have missed
  /// stay as planes.
  const geometry::FinderCut& cut() const noexcept { return search_.cut(); }
  /// There is no scene from here on, but the contacts found in it stay, as planes, until the next
  /// update or set_scene().
  void keep_contacts() noexcept { search_.keep_contacts(); }
  bool keeps_contacts() const noexcept { return search_.keeps_contacts(); }

  /// External wrenches act with this force at most, N.
  void bound_external(double most) noexcept { loads_.external.bound(most); }

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
  bool moves_ahead() const noexcept { return bodies_.moves_ahead(); }

  /// Moves the proxy and the bodies by one step under the hand's wrench, weight and contacts
  /// (Eqs. 7-12). floats: the proxy weighs nothing.
  ContactWrench step(const HandInput& hand, bool floats = false) noexcept;

  /// Without proxy dynamics: puts the proxy at q with velocity v and evaluates its contacts there.
  /// There is no impulse: what collides is the device, whose own mass the contacts' penalty stops.
  ContactWrench follow(const Configuration& q, const Velocity& v) noexcept;
  /// Share in [0, 1] of the work of follow()'s wrench that the device renders. Work that was not
  /// rendered does not fill the healing tank.
  void set_rendered(double share) noexcept { tank_.set_rendered(share); }

  const ToolModel& proxy() const noexcept { return proxy_; }
  const Velocity& velocity() const noexcept { return v_; }
  /// Twist of the hand's frame, world axes.
  Twist hand_twist() const noexcept { return proxy_.hand_jacobian().lazyProduct(v_); }
  /// Contacts of the tool, sorted by identity.
  const LocalContacts& contacts() const noexcept { return contacts_.contacts(); }
  /// Contacts of the bodies without the tool.
  const LocalContacts& supports() const noexcept { return contacts_.supports(); }
  /// Limits of the tool's joints.
  const LocalContacts& limits() const noexcept { return limits_.contacts(); }
  const LocalBodies& bodies() const noexcept { return bodies_.local(); }
  /// What the environment must place, or take back.
  StaticVector<HeldState, kMaxPoses> held() const noexcept { return bodies_.held(); }
  /// τ of weight, external wrenches and drives in the latest step, N or N·m.
  const GeneralisedForce& load() const noexcept { return loads_.latest; }
  /// The drives of its joints.
  const DrivenJoints& drives() const noexcept { return loads_.drives; }
  const BodyImpulses& impulses() const noexcept { return impulses_; }
  ProxyContactState state() const noexcept { return state_; }
  /// Factor on the contacts' stiffness, 1 unless limited.
  double stiffness_scale() const noexcept { return stiffness_limit_.factor(); }
  /// Energy that contacts may use to come back to where they are reported, J; below 0 it is owed.
  double healing_tank() const noexcept { return tank_.energy(); }
  /// The tool at the configuration of the latest update.
  const ToolModel& ve_tool() const noexcept { return ve_tool_; }

 private:
  UpdatePolicy policy() const noexcept;
  ContactLaw contact_law(ContactStep step) const noexcept;
  ContactLaw support_law(double dt, double ahead) const noexcept;

  // local_model.cc: a step.
  void evaluate(const FrameMotions& frames) noexcept;
  GeneralisedForce collide(const FrameMotions& frames, const Eigen::LLT<MassMatrix>& D) noexcept;
  GeneralisedForce apply_implicitly(const FrameMotions& frames, const ContactLaw& law,
                                    MassMatrix& E, GeneralisedForce& r, Unknowns& x) noexcept;
  GeneralisedForce apply_explicitly(const FrameMotions& frames, const ContactLaw& law,
                                    Unknowns& x) noexcept;
  void add_impulse(const LocalContact& contact, const Vector3& P_W) noexcept;
  void end_step(const FrameMotions& frames, const Unknowns& x) noexcept;

  // local_model_update.cc: an update.
  LocalBodies with_reported(const LocalBodies& held, const ModelUpdate& update,
                            double state_step) noexcept;
  void adopt_held(const ModelUpdate& update, const LocalBodies& held) noexcept;
  void adopt_ahead(const ModelUpdate& update, const LocalBodies& held,
                   const LocalBodies& as_reported, double state_step) noexcept;
  void set_bodies(const LocalBodies& others) noexcept;
  void reframe_contacts() noexcept;
  double replay_start(double from) const noexcept;
  void replay(LocalBodies& bodies, double from) noexcept;
  void correct_gradually(LocalBodies& updated, double period) const noexcept;
  double damping_on(const LocalBody& body) const noexcept;

  // local_model_scene.cc: what tool and bodies meet.
  Around around(const LocalBodies& bodies) const noexcept {
    return {proxy_, v_, bodies, bodies_.near()};
  }
  UpdateFrames frames_here(const LocalBodies& bodies) const noexcept;
  void look_around() noexcept;
  void look_along(LocalBodies& bodies, double dt) noexcept;
  void meet_tool(const Around& around, const LocalContacts& existing, bool takes,
                 MetContacts& met) noexcept;
  void meet_bodies(const Around& around, const LocalContacts& existing, double dt, bool takes,
                   MetContacts& met) noexcept;
  void adopt_supports_of_scene(const LocalContacts& existing, UpdateFrames& frames,
                               const LocalBodies& bodies) noexcept;
  void adopt_contacts_of_scene(const LocalContacts& existing, const UpdateFrames& frames,
                               const LocalBodies& bodies) noexcept;
  struct StepEnd {
    FramePoses poses;
    MetContacts met;
  };
  std::optional<StepEnd> meet_at_end(const FrameMotions& frames, const Unknowns& x) noexcept;
  void correct_step(ContactGroups groups, const FrameMotions& frames, const StepSystem& system,
                    Unknowns& x) noexcept;
  bool is_touched(const LocalBody& body) const noexcept;
  bool bears(const geometry::FoundContact& found) const noexcept;
  void take_bearing(std::span<const geometry::FoundContact> found) noexcept;
  void give_back(const MetContacts& met, const MetContacts& met_by_bodies) noexcept;

  LocalModelParameters parameters_;
  double dt_;
  ToolModel proxy_;
  ToolModel ve_tool_;
  Velocity v_;
  ContactSets contacts_;
  JointLimits limits_;
  Loads loads_;
  Bodies bodies_;
  BodyImpulses impulses_;
  ProxyContactState state_ = ProxyContactState::kFreeMotion;
  StiffnessLimit stiffness_limit_;
  HealingTank tank_;
  SceneSearch search_;
};

}  // namespace hlm::server
