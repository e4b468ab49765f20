// The local model of interaction: a dynamic proxy of the virtual tool among local contacts.
//
// Between two updates of the virtual environment it answers, at the servo rate, what the hand
// feels. It knows no socket, clock, thread or device. No function allocates, locks, throws or
// waits.
#pragma once

#include <array>

#include "common/tool_model.h"
#include "common/vocabulary.h"
#include "haptic_server/local_model/collision.h"
#include "haptic_server/local_model/contact_forces.h"
#include "haptic_server/local_model/contact_update.h"
#include "haptic_server/local_model/hand_map.h"
#include "haptic_server/local_model/local_contact.h"
#include "haptic_server/local_model/parameters.h"

namespace hlm::server {

/// What acts on the proxy at the hand during one step: the wrench F at its start, and how that
/// changes with the twist V at its end, F⁺ = F - K Δt V⁺ - B (V⁺ - V). World axes.
struct HandInput {
  Wrench F = Wrench::Zero();
  Vector6 stiffness = Vector6::Zero();  ///< Diagonal of K: N/m, then N·m/rad.
  Vector6 damping = Vector6::Zero();    ///< Diagonal of B: N·s/m, then N·m·s/rad.
};

/// What the contacts do to the hand in one step, world axes, at the hand's frame.
struct ContactWrench {
  Wrench F = Wrench::Zero();        ///< Eq. 8: penalty and friction, N and N·m.
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

  /// Takes over an update of the virtual environment, `age` seconds old, for the tool at q_VE.
  void adopt(const ReportedContacts& reported, const Configuration& q_VE, double age) noexcept;

  /// Moves the proxy by one step under the hand's wrench, weight and contacts (Eqs. 7-12).
  ContactWrench step(const HandInput& hand) noexcept;

  /// Without proxy dynamics: puts the proxy at q with velocity v and evaluates its contacts there.
  /// Weight is felt too. There is no impulse: what collides is the device, whose own mass the
  /// contacts' penalty stops.
  ContactWrench follow(const Configuration& q, const Velocity& v) noexcept;

  const ToolModel& proxy() const noexcept { return proxy_; }
  const Velocity& velocity() const noexcept { return v_; }
  /// Twist of the hand's frame, world axes.
  Twist hand_twist() const noexcept { return proxy_.hand_jacobian().lazyProduct(v_); }
  const LocalContacts& contacts() const noexcept { return contacts_[current_]; }
  ProxyContactState state() const noexcept { return state_; }
  /// Factor on the contacts' stiffness, 1 unless limited.
  double stiffness_scale() const noexcept { return stiffness_scale_; }
  /// The tool at the configuration of the latest update.
  const ToolModel& ve_tool() const noexcept { return ve_tool_; }

 private:
  LocalContacts& present() noexcept { return contacts_[current_]; }
  GeneralisedForce collide(const Eigen::LLT<MassMatrix>& D, const LinkMotion& links) const noexcept;
  void limit_stiffness(const Eigen::LLT<MassMatrix>& D, const LinkMotion& links,
                       const HandMap& H) noexcept;
  void evaluate(const LinkMotion& links) noexcept;
  ContactLaw contact_law(ContactStep step) const noexcept;

  LocalModelParameters parameters_;
  double dt_;
  ToolModel proxy_;
  ToolModel ve_tool_;
  Velocity v_;
  std::array<LocalContacts, 2> contacts_;  ///< The present ones, and room for the next update.
  std::size_t current_ = 0;
  ProxyContactState state_ = ProxyContactState::kFreeMotion;
  double stiffness_scale_ = 1;
};

}  // namespace hlm::server
