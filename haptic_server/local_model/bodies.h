// The movable bodies near the tool, and which of them the local model moves (docs/method.md 11,
// 21).
//
// What bears upon the tool is held: it is moved here until it is let go. Where the environment says
// too little of bodies for that, those of its reports are moved ahead of these.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "hlm/common/static_vector.h"
#include "hlm/haptic_server/local_model/frames.h"
#include "hlm/haptic_server/local_model/local_body.h"
#include "hlm/haptic_server/local_model/model_update.h"
#include "hlm/haptic_server/local_model/near_body.h"
#include "hlm/haptic_server/scene/scene.h"

namespace hlm::server {

/// Where a body is that the server moves, or gives back.
struct HeldState {
  std::uint32_t number = 0;  ///< Of Ownership.
  BodyPose pose;
};

class Bodies {
 public:
  /// Those that the local model moves. Where set(), take() or forget_local() changes which,
  /// contacts must go over to the frames that there are then.
  const LocalBodies& local() const noexcept { return local_; }
  LocalBodies& local() noexcept { return local_; }
  const Mechanisms& mechanisms() const noexcept { return mechanisms_; }
  Mechanisms& mechanisms() noexcept { return mechanisms_; }
  /// All that the scene has near the tool, those that are moved here among them.
  const NearBodies& near() const noexcept { return near_; }

  bool is_local(std::uint32_t body) const noexcept;
  /// Whether a body is moved ahead of the environment's reports.
  bool moves_ahead() const noexcept;
  /// What the environment must place, or take back.
  StaticVector<HeldState, kMaxPoses> held() const noexcept;
  /// The velocity of a body's point, world, m/s; of one that is not known, none.
  Vector3 velocity_of(const ContactSide& side, const Vector3& p_W) const noexcept;

  /// An update begins. Those that are moved on, whatever it says of where they are: what joints
  /// connect stays as a whole, or goes. scene: null: none stays.
  LocalBodies that_stay(const ModelUpdate& update, const Scene* scene) noexcept;
  /// What it says of who moves the bodies, and where those are that the environment moves; these
  /// leave their places in the scene, if there is one. bodies: of the update, as they are reported.
  void adopt_poses(const ModelUpdate& update, const LocalBodies& bodies, Scene* scene) noexcept;
  /// Others are moved here from now on.
  void set(const LocalBodies& bodies) noexcept;
  /// None is moved here, and those that were are not there any more.
  void forget_local(Scene* scene) noexcept;
  /// What is moved ahead of reports stands still where it is. Those that are still to be moved.
  LocalBodies stop_ahead() noexcept;

  /// Takes a body, as the environment reported it last, if there is room, and enough is known of
  /// it, and with it what joints connect. Whether it did.
  bool take(const ContactSide& side, const Scene& scene) noexcept;
  /// A step of dt, s, begins. bears: by body, in the order of local(), whether it bears upon the
  /// tool. Those that have not for a while are given back.
  void give_back(std::span<const bool> bears, double dt) noexcept;
  /// Collisions change the velocities of what is moved here by the unknowns u. first: of its
  /// frames.
  void push(const FrameMotions& frames, FrameIndex first, const Unknowns& u) noexcept;
  /// A step of dt, s, goes by: what is not moved here goes on as it was reported.
  void advance(double dt) noexcept;

 private:
  NearBody* near_of(const ContactSide& side) noexcept;
  bool is_as_it_was(std::uint32_t body, const Scene& scene) const noexcept;
  bool take_mechanism(const Mechanism& mechanism, const Scene& scene) noexcept;
  static void begin_holding(NearBody& near, LocalBody& local) noexcept;

  LocalBodies local_;
  Mechanisms mechanisms_;
  NearBodies near_;
  bool may_hold_ = true;  ///< Bodies that bear upon the tool are taken.
  double unheard_ = 0;    ///< Since the latest update, s.
};

}  // namespace hlm::server
