#include "hlm/common/joint_drive.h"

#include "hlm/common/range.h"

namespace hlm {
namespace {

constexpr double kFarthest = 1e4;  ///< m or rad.

std::optional<Sentence> find_error(const JointDrive& drive) {
  const Range place{-kFarthest, kFarthest, "m or rad"};
  const Range size{0, kLargestDrive};
  if (auto error = find_brief_error("target", drive.target, place)) return error;
  if (auto error = find_brief_error("closed", drive.closed, place)) return error;
  if (auto error = find_brief_error("open", drive.open, place)) return error;
  if (auto error = find_brief_error("stiffness", drive.stiffness, size)) return error;
  if (auto error = find_brief_error("damping", drive.damping, size)) return error;
  return find_brief_error("largest force", drive.most, size);
}

}  // namespace

std::optional<Sentence> find_error(const JointDrives& drives, const ToolDescription& tool) {
  std::uint32_t driven = 0;
  for (const JointDrive& drive : drives) {
    const Sentence name = Sentence("drive of link ") + unsigned{drive.link} + ": ";
    if (drive.link >= tool.links.size() || !has_one_coordinate(tool.links[drive.link].joint)) {
      return name + "its joint must be revolute, prismatic or guided";
    }
    if ((driven >> drive.link) & 1u) return name + "there must be one, not two";
    driven |= 1u << drive.link;
    if (auto error = find_error(drive)) return name + *error;
  }
  return std::nullopt;
}

}  // namespace hlm
