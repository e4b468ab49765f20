// How contacts with the geometry near the hand go on from step to step (docs/method.md 18).
//
// s = σ + δ. The motion of tool and bodies changes σ, which the geometry tells exactly, and never
// δ. δ begins where the geometry changes: a scene that arrives while the tool is inside of it, a
// body whose pose an update corrects, a shape that goes. There the rules of an update decide it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "hlm/haptic_server/local_model/contact_forces.h"
#include "hlm/haptic_server/local_model/contact_update.h"
#include "hlm/haptic_server/scene/scene.h"

namespace hlm::server {

/// A contact that was found, with the frames of its sides.
struct MetContact {
  const geometry::FoundContact* found = nullptr;
  std::uint64_t identity = 0;
  FrameIndex a = kFirstLinkFrame;
  FrameIndex b = kWorldFrame;
  Vector3 v_WC = Vector3::Zero();  ///< Of b's point, if b moves in the world's frame, m/s.
};
using MetContacts = StaticVector<MetContact, kMaxLocalContacts>;

/// Sorted by identity, of equal ones the first.
void sort_met(MetContacts& met) noexcept;

/// What has changed besides where the tool and the bodies are.
struct GeometryChange {
  bool of_bodies = false;  ///< Poses of bodies were corrected,
  bool of_all = false;     ///< or the scene is another one.
  /// A search was cut: what it did not find may be there still.
  bool is_known_in_part = false;
  /// Bodies that the local model moves itself, and moved before: nothing corrects them.
  StaticVector<std::uint32_t, kMaxMovedBodies> steady{};

  /// Whether a contact that was not met stays as it was, as a plane.
  bool keeps(const LocalContact& contact) const noexcept {
    return is_known_in_part && contact.latest.loaded && !concerns(contact);
  }
  bool concerns(const LocalContact& contact) const noexcept {
    const auto is_body = [this](const ContactSide& side) {
      return side.kind == SideKind::kMovableBody &&
             std::ranges::find(steady, side.index) == steady.end();
    };
    return of_all || (of_bodies && (is_body(contact.a) || is_body(contact.b)));
  }
};

/// Adds the contacts of the tool that were met, `existing` ones as they go on, and of those that
/// are gone because the geometry has changed the load that is being released. frames: as for
/// adopt_update(). Returns the energy that contacts with movable bodies may heal with for it, J.
double renew_contacts(const LocalContacts& existing, const MetContacts& met,
                      const UpdateFrames& frames, const GeometryChange& change,
                      const UpdatePolicy& policy, LocalContacts& updated) noexcept;

/// The same of bodies without the tool, which nobody feels: they keep their load where a body is
/// corrected.
void renew_supports(const LocalContacts& existing, const MetContacts& met,
                    const UpdateFrames& frames, const GeometryChange& change,
                    LocalContacts& updated) noexcept;

/// Adds those of the scene that touch no body that is moved ahead of reports, as they are. Sorts
/// all by identity.
void keep_supports_of_held(const LocalContacts& from, const UpdateFrames& frames,
                           LocalContacts& to) noexcept;

/// Adds those of the scene, as they are.
void keep_scene(const LocalContacts& from, LocalContacts& to) noexcept;

/// Contacts of the scene that were open at the start of a step.
using ClosingContacts = StaticVector<LocalContact*, kMaxLocalContacts>;

/// Those of a group that act in a step that ends with x.
ClosingContacts find_closing(const ContactGroup& group, const FrameMotions& frames,
                             const Unknowns& x) noexcept;

/// Leaves those out of the step whose planes are not among those that were met where it ends with
/// x, and returns them.
ClosingContacts leave_out(const ClosingContacts& closing, const MetContacts& met,
                          const FrameMotions& frames, const Unknowns& x, double dt) noexcept;

/// Gives those that were left out and touch where the step ends with x the planes that were met
/// there. end: the poses there. Returns whether there are any.
bool bring_back(const ClosingContacts& left_out, MetContacts& met, const FramePoses& end,
                const FrameMotions& frames, const Unknowns& x, double dt) noexcept;

}  // namespace hlm::server
