// The contacts of an update, each with the frames of its sides.
#pragma once

#include <optional>

#include "hlm/common/contact.h"
#include "hlm/common/tool_model.h"
#include "hlm/haptic_server/local_model/frames.h"
#include "hlm/haptic_server/local_model/local_contact.h"

namespace hlm::server {

/// Where the frames are that an update is about.
struct UpdateFrames {
  const ToolModel& tool;      ///< Tells which links there are.
  const LocalBodies& bodies;  ///< Bodies of the update; one that is not among them is the world's.
  FramePoses reported;        ///< Poses as the environment had them when it found the contacts.
  FramePoses before;          ///< Now, with the bodies that the existing contacts refer to.
  FramePoses now{};           ///< Poses now, with the bodies of the update.
  FramePoses moved{};         ///< Change from where they were reported to now.

  void set_now(const FramePoses& poses) noexcept;
};

/// The frame of a side: the world's for a body that the local model does not have. Empty for a link
/// that the tool does not have.
std::optional<FrameIndex> frame_of(const ContactSide& side, const ToolModel& tool,
                                   const LocalBodies& bodies) noexcept;

/// A report and the frames of its sides.
struct Placed {
  const ReportedContact* report;
  FrameIndex a;
  FrameIndex b;
};
using PlacedReports = StaticVector<Placed, kMaxContacts>;

/// The reports that are wanted and have a place, sorted by identity, of equal ones the first.
PlacedReports sorted_reports(const ReportedContacts& reported, const UpdateFrames& frames,
                             bool (*wanted)(const ReportedContact&) noexcept) noexcept;

/// Fills in the contact as reported, its constraint `age` (s) older; without its point on a.
void describe(LocalContact& contact, const Placed& placed, const UpdateFrames& frames,
              double age) noexcept;

/// Where a's true point was when the contact was found, world, m.
inline Vector3 reported_point(const Placed& placed) noexcept {
  return placed.report->p_WC + placed.report->separation * placed.report->n_W;
}

/// Evaluates the constraint with the frames at `poses`. Returns σ for a's true point at x_W, m.
double true_separation(LocalContact& contact, const FramePoses& poses, const Vector3& x_W) noexcept;

}  // namespace hlm::server
