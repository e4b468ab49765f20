// The virtual tool that a model of the world makes: its description for the local model, and which
// bodies of the world are its links.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "hlm/common/joint_drive.h"
#include "hlm/common/tool_description.h"
#include "hlm/common/tool_model.h"
#include "hlm/ve_client/scene/world_description.h"

namespace hlm::ve {

/// A tool and its bodies. Link frames L:
/// - free root: origin at the link's centre of mass, the SDF link's axes. J is the world's frame,
/// so
///   q = (position of the centre of mass, m; orientation of the SDF link).
/// - planar root: it moves parallel to the world's xy plane, at its initial height. L has its
/// origin
///   at the centre of mass and the world's axes turned about z, so q = (x, y of the centre of mass,
///   m; θ, rad). θ is the heading of the SDF link's x axis: atan2 of its y and x components.
/// - other links, and a root joined to the world: L is the SDF joint's frame, fixed in the child;
///   q = 0 in the initial pose.
struct ToolAssembly {
  ToolDescription description;
  Configuration q;          ///< Initial configuration.
  std::vector<int> bodies;  ///< Body of each link.
  std::vector<Pose> X_LB;   ///< Body frame in each link's frame.
  JointDrives drives;       ///< Of a gripper, open.
  /// The plane's normal of a planar root, world; contacts are then those of a planar problem.
  std::optional<Vector3> planar_normal_W;
};

/// The tool that the model `name` makes. Throws std::runtime_error with one line if the world has
/// no such model (listing those it has), or if the model is static, is not one tree, or exceeds
/// what a tool may be (ToolDescription).
ToolAssembly assemble_tool(const WorldDescription& world, const std::string& name);

}  // namespace hlm::ve
