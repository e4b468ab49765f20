#include "hlm/haptic_server/local_model/placed_reports.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace hlm::server {

void UpdateFrames::set_now(const FramePoses& poses) noexcept {
  now = poses;
  moved.clear();
  for (std::size_t i = 0; i < now.size(); ++i) moved.push_back(now[i] * reported[i].inverse());
}

std::optional<FrameIndex> frame_of(const ContactSide& side, const ToolModel& tool,
                                   const LocalBodies& bodies) noexcept {
  switch (side.kind) {
    case SideKind::kWorld:
      return kWorldFrame;
    case SideKind::kToolLink:
      if (side.index >= static_cast<std::uint32_t>(tool.links())) return std::nullopt;
      return frame_of_link(side.index);
    case SideKind::kMovableBody:
      for (std::size_t slot = 0; slot < bodies.size(); ++slot) {
        if (bodies[slot].id == side.index) return frame_of_body(tool, slot);
      }
      return kWorldFrame;
  }
  return std::nullopt;
}

PlacedReports sorted_reports(const ReportedContacts& reported, const UpdateFrames& frames,
                             bool (*wanted)(const ReportedContact&) noexcept) noexcept {
  PlacedReports sorted;
  for (const ReportedContact& report : reported) {
    if (!wanted(report)) continue;
    const auto a = frame_of(report.a, frames.tool, frames.bodies);
    const auto b = frame_of(report.b, frames.tool, frames.bodies);
    if (!a || !b || *a == kWorldFrame || *a == *b) continue;
    sorted.push_back({&report, *a, *b});
  }
  const auto before = [](const Placed& x, const Placed& y) {
    if (x.report->identity != y.report->identity) return x.report->identity < y.report->identity;
    return x.report < y.report;
  };
  if (!std::is_sorted(sorted.begin(), sorted.end(), before)) {
    std::sort(sorted.begin(), sorted.end(), before);
  }
  const auto same = [](const Placed& x, const Placed& y) {
    return x.report->identity == y.report->identity;
  };
  sorted.erase(std::unique(sorted.begin(), sorted.end(), same), sorted.end());
  return sorted;
}

void describe(LocalContact& contact, const Placed& placed, const UpdateFrames& frames,
              double age) noexcept {
  const ReportedContact& report = *placed.report;
  contact.identity = report.identity;
  contact.a = report.a;
  contact.b = report.b;
  contact.frame_a = placed.a;
  contact.frame_b = placed.b;
  contact.material.friction = report.friction;
  if (placed.b == kWorldFrame) {
    contact.constraint.v_constr = report.n_W.dot(report.v_WC);
    contact.constraint.v_WC = contact.constraint.v_reported_W = report.v_WC;
    contact.constraint.c_B = report.p_WC + contact.constraint.v_constr * age * report.n_W;
    contact.constraint.n_P = report.n_W;
  } else {
    contact.constraint.plane = report.plane;
    const Placement& X_WP = frames.reported[report.plane == PlaneOwner::kA ? placed.a : placed.b];
    contact.constraint.c_B = frames.reported[placed.b].inverse() * report.p_WC;
    contact.constraint.n_P = X_WP.R.transpose() * report.n_W;
  }
}

double true_separation(LocalContact& contact, const FramePoses& poses,
                       const Vector3& x_W) noexcept {
  const Placement& X_WB = poses[contact.frame_b];
  contact.now.c_W = constraint_point_W(contact, X_WB);
  contact.now.n_W = normal_W(contact, poses[contact.frame_a], X_WB);
  return contact.now.n_W.dot(x_W - contact.now.c_W);
}

}  // namespace hlm::server
