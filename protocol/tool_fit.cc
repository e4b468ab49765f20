#include "hlm/protocol/tool_fit.h"

#include <algorithm>
#include <cmath>

#include "hlm/common/range.h"
#include "hlm/protocol/wire.h"

namespace hlm::protocol {

namespace {

/// Where the quaternion of a free root begins: after its position.
constexpr int kQuaternion = 3;

bool has_free_root(const ToolDescription& tool) noexcept {
  return !tool.links.empty() && tool.links.front().joint == JointType::kFree;
}

ToolModel model_at(const ToolDescription& tool, const Configuration& q) noexcept {
  ToolModel model(tool);
  model.set_configuration(q);
  return model;
}

/// A side on the tool names a link that there is, and of a tool's contact side a is on the tool.
bool has_known_sides(const ToolDescription& tool, const ReportedContact& contact) noexcept {
  const auto is_link = [&](const ContactSide& side) {
    return side.kind == SideKind::kToolLink && side.index < tool.links.size();
  };
  switch (contact.a.kind) {
    case SideKind::kToolLink:
      return is_link(contact.a) && (contact.b.kind != SideKind::kToolLink || is_link(contact.b));
    case SideKind::kMovableBody:
      return contact.b.kind != SideKind::kToolLink;
    case SideKind::kWorld:
      return false;
  }
  return false;
}

/// The first item whose name one before it has too.
template <class Items, class Name>
std::optional<std::size_t> find_duplicate(const Items& items, Name name) noexcept {
  using Named = std::pair<std::uint64_t, std::size_t>;
  StaticVector<Named, kMaxContacts> sorted;
  for (std::size_t i = 0; i < items.size(); ++i) sorted.push_back({name(items[i]), i});
  std::sort(sorted.begin(), sorted.end());
  const auto same = [](const Named& a, const Named& b) { return a.first == b.first; };
  const auto found = std::adjacent_find(sorted.begin(), sorted.end(), same);
  if (found == sorted.end()) return std::nullopt;
  return std::next(found)->second;
}

}  // namespace

void normalize(const ToolDescription& tool, Configuration& q) noexcept {
  if (has_free_root(tool) && q.size() == tool.configuration_size()) {
    normalize_if_near(q.segment<4>(kQuaternion));
  }
}

bool fits(const ToolDescription& tool, const Configuration& q) noexcept {
  if (q.size() != tool.configuration_size() || !q.allFinite()) return false;
  return !has_free_root(tool) || std::abs(q.segment<4>(kQuaternion).norm() - 1) <= kUnitTolerance;
}

std::optional<UpdateMisfit> find_misfit(const ToolDescription& tool,
                                        const ContactUpdate& update) noexcept {
  if (update.q_VE.size() != tool.configuration_size() || update.v_VE.size() != tool.dof()) {
    return UpdateMisfit{.error = UpdateError::kTool};
  }
  if (!fits(tool, update.q_VE)) return UpdateMisfit{.error = UpdateError::kQuaternion};
  for (std::size_t i = 0; i < update.contacts.size(); ++i) {
    if (has_known_sides(tool, update.contacts[i])) continue;
    return UpdateMisfit{UpdateError::kSide, false, i};
  }
  const auto has_link = [&](const ExternalWrench& each) { return each.link < tool.links.size(); };
  if (!std::ranges::all_of(update.external, has_link)) {
    return UpdateMisfit{.error = UpdateError::kSide};
  }
  if (find_error(update.drives, tool)) return UpdateMisfit{.error = UpdateError::kDrive};
  const auto identity = [](const ReportedContact& contact) { return contact.identity; };
  const auto id = [](const MovableBody& body) { return body.id; };
  if (const auto duplicate = find_duplicate(update.contacts, identity)) {
    return UpdateMisfit{UpdateError::kDuplicate, false, *duplicate};
  }
  if (const auto duplicate = find_duplicate(update.bodies, id)) {
    return UpdateMisfit{UpdateError::kDuplicate, false, *duplicate};
  }
  return std::nullopt;
}

std::optional<std::size_t> leave_out_copies(BodyPoses& poses) noexcept {
  const auto body = [](const BodyPose& pose) { return pose.body; };
  const auto first = find_duplicate(poses, body);
  if (!first) return std::nullopt;
  BodyPoses kept;
  for (const BodyPose& pose : poses) {
    if (std::ranges::find(kept, pose.body, body) == kept.end()) kept.push_back(pose);
  }
  poses = kept;
  return first;
}

bool fits(const ToolDescription& tool, const ProxyState& state) noexcept {
  return fits(tool, state.q) && state.v.size() == tool.dof();
}

std::optional<Sentence> find_error(const Hello& hello) {
  if (auto error = find_error(hello.tool)) return error;
  if (hello.q.size() != hello.tool.configuration_size()) {
    return Sentence("initial configuration has ") + hello.q.size() + " coordinates; the tool has " +
           hello.tool.configuration_size();
  }
  if (!fits(hello.tool, hello.q)) {
    return "initial configuration must be finite and its quaternion of length 1";
  }
  if (hello.q.cwiseAbs().maxCoeff() > kLargestLength) {
    return Sentence("initial configuration must be within ±") + brief_text(kLargestLength) +
           " m or rad";
  }
  if (auto error = find_singular_error(model_at(hello.tool, hello.q))) return error;
  if (auto error = find_brief_error("VE rate", hello.ve_rate, Range{0, 1e5, "Hz", true}))
    return error;
  return find_brief_error("epsilon", hello.epsilon, Range{0, 10, "m"});
}

}  // namespace hlm::protocol
