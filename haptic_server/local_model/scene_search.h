// What tool and bodies meet in the scene: where it is looked, how far, and with how much work
// (docs/method.md 18).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "hlm/common/tool_model.h"
#include "hlm/haptic_server/local_model/local_body.h"
#include "hlm/haptic_server/local_model/near_body.h"
#include "hlm/haptic_server/local_model/scene_contacts.h"
#include "hlm/haptic_server/scene/scene.h"

namespace hlm::server {

/// Where tool and bodies are, and how they move.
struct Around {
  const ToolModel& tool;
  const Velocity& v;
  const LocalBodies& bodies;  ///< Those that the local model moves.
  const NearBodies& near;     ///< All of the scene.
};

class SceneSearch {
 public:
  /// dt: step, s.
  explicit SceneSearch(double dt) noexcept : dt_(dt) {}

  Scene* scene() const noexcept { return scene_; }
  /// The geometry is that of `scene` from here on; null: there is none.
  void set_scene(Scene* scene, const NearBodies& near) noexcept;
  /// There is no scene from here on, but the contacts found in it stay, as planes, until the next
  /// update or set_scene().
  void keep_contacts() noexcept;
  bool keeps_contacts() const noexcept { return keeps_contacts_; }
  /// Whether it says enough of bodies that the server moves what the hand holds.
  bool holds() const noexcept { return scene_ != nullptr && scene_->holds(); }

  /// Contacts are those of the present poses, or are not.
  void set_looked(bool looked) noexcept { looked_ = looked; }
  bool must_look() const noexcept { return !looked_; }
  /// What has changed since contacts were found; take_change() forgets it.
  GeometryChange& change() noexcept { return change_; }
  GeometryChange take_change() noexcept { return std::exchange(change_, {}); }

  /// What the searches since begin() left out.
  const geometry::FinderCut& cut() const noexcept { return cut_; }
  bool is_cut() const noexcept { return cut_ != geometry::FinderCut{}; }
  /// Places everything and forgets what was found. ahead: bodies that the local model does not move
  /// where they will be so much later, s.
  void place(const Around& around, double ahead = 0) noexcept;
  /// A search begins that leaves out nothing yet.
  void begin() noexcept { cut_ = {}; }

  /// Contacts of the tool, which had those in `existing` before. Valid until place().
  std::span<const geometry::FoundContact> of_tool(const Around& around,
                                                  const LocalContacts& existing) noexcept;
  /// How far, and with how much work, contacts of each of the moved bodies are looked for, in steps
  /// of dt, s.
  struct Reach {
    double epsilon = 0;  ///< m.
    std::uint64_t work = 0;
  };
  Reach reach_of_bodies(const Around& around, const LocalContacts& existing,
                        double dt) const noexcept;
  std::span<const geometry::FoundContact> of_body(std::uint32_t id, const Reach& reach) noexcept;
  /// Those of the tool where a step ends. Empty: not all are known.
  std::optional<MetContacts> of_tool_at_end(const Around& around) noexcept;
  /// Adds those between what is there, with the frames of their sides.
  void meet(std::span<const geometry::FoundContact> found, const Around& around,
            MetContacts& met) const noexcept;

  /// Share of a tick's work of searching that bodies may have; the tool has the rest.
  static constexpr double kWorkOfBodies = 0.4;
  std::uint64_t work_in_tick(double share) const noexcept;

 private:
  double fastest_body(const Around& around) const noexcept;

  double dt_;
  Scene* scene_ = nullptr;
  GeometryChange change_;
  geometry::FinderCut cut_;
  bool looked_ = false;          ///< Contacts are those of the present poses.
  bool keeps_contacts_ = false;  ///< They are those of the scene that was.
};

}  // namespace hlm::server
