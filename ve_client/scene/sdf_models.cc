#include "hlm/ve_client/scene/sdf_models.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <set>

#include <sdf/Collision.hh>
#include <sdf/Geometry.hh>
#include <sdf/Joint.hh>
#include <sdf/Link.hh>

#include "hlm/common/range.h"
#include "hlm/ve_client/scene/link_inertia.h"
#include "hlm/ve_client/scene/sdf_geometry.h"
#include "hlm/ve_client/scene/sdf_joints.h"
#include "hlm/ve_client/scene/sdf_messages.h"
#include "hlm/ve_client/scene/sdf_places.h"

namespace hlm::ve {
namespace {

std::string text_of(const sdf::ElementPtr& parent, const std::string& child) {
  return parent->HasElement(child) ? parent->Get<std::string>(child) : "";
}

Pose pose_of(const sdf::ElementPtr& element) {
  return to_pose(element->GetElement("pose")->Get<ignition::math::Pose3d>());
}

class ModelReader {
 public:
  ModelReader(WorldDescription& world, Diagnostics& diagnostics)
      : world_(world), diagnostics_(diagnostics) {}

  void read(const sdf::Model& model) {
    ModelDescription description;
    description.name = model.Name();
    description.place = place_of(model.Element());
    description.fixed = model.Static();
    description.first_body = static_cast<int>(world_.bodies.size());
    read_tool_elements(model.Element(), description);
    description.X_WM = resolve_pose(model);
    read_contents(model, description.X_WM, model.Name(), model.Static());
    start_within_limits();
    description.body_count = static_cast<int>(world_.bodies.size()) - description.first_body;
    world_.models.push_back(description);
  }

 private:
  template <class Named>
  Pose resolve_pose(const Named& named, const std::string& frame = "") {
    try {
      ignition::math::Pose3d pose;
      require_none(named.SemanticPose().Resolve(pose, frame));
      return to_pose(pose);
    } catch (const std::runtime_error& error) {
      // Why, is mostly said already.
      if (diagnostics_.usable()) diagnostics_.refuse(place_of(named.Element()), error.what());
      return {};
    }
  }

  void read_tool_elements(const sdf::ElementPtr& model, ModelDescription& description) {
    if (model->HasElement("haptic:tool_joint")) {
      const std::string type = text_of(model, "haptic:tool_joint");
      if (type != "free" && type != "planar") {
        diagnostics_.refuse(place_of(model->GetElement("haptic:tool_joint")),
                            "<haptic:tool_joint> '" + type + "' must be free or planar");
      }
      description.tool_joint = type == "planar" ? JointType::kPlanar : JointType::kFree;
    }
    if (model->HasElement("haptic:hand")) read_hand(model->GetElement("haptic:hand"), description);
    if (model->HasElement("haptic:gripper")) {
      description.gripper = read_gripper(model->GetElement("haptic:gripper"));
    }
    if (!model->HasElement("haptic:start")) return;
    for (sdf::ElementPtr start = model->GetElement("haptic:start"); start;
         start = start->GetNextElement("haptic:start")) {
      read_start(start, description.starts);
    }
  }

  void read_hand(const sdf::ElementPtr& hand, ModelDescription& description) {
    if (!hand->HasElement("link")) {
      return diagnostics_.refuse(place_of(hand), "<haptic:hand> must name the held <link>");
    }
    description.hand_link = text_of(hand, "link");
    if (hand->HasElement("pose")) description.X_SH = pose_of(hand);
  }

  GripperDescription read_gripper(const sdf::ElementPtr& element) {
    GripperDescription gripper;
    for (sdf::ElementPtr joint = element->HasElement("joint") ? element->GetElement("joint")
                                                              : nullptr;
         joint; joint = joint->GetNextElement("joint")) {
      gripper.joints.push_back(joint->Get<std::string>());
    }
    if (element->GetNextElement("haptic:gripper")) {
      diagnostics_.refuse(place_of(element), "a model must have one <haptic:gripper>, not two");
    }
    if (gripper.joints.empty()) {
      diagnostics_.refuse(place_of(element), "<haptic:gripper> must name the <joint>s of its jaws");
    }
    const auto number = [&](const char* name, double least) {
      const double value = element->HasElement(name) ? element->Get<double>(name) : NAN;
      if (!(value >= least) || !std::isfinite(value)) {
        diagnostics_.refuse(place_of(element), "<haptic:gripper> must have a <" +
                                                   std::string(name) + ">, a number" +
                                                   (least == 0 ? " from 0 on" : ""));
      }
      return value;
    };
    constexpr double kAny = -std::numeric_limits<double>::max();
    gripper.closed = number("closed", kAny);
    gripper.open = number("open", kAny);
    gripper.stiffness = number("stiffness", 0);
    gripper.damping = number("damping", 0);
    gripper.force = number("force", 0);
    return gripper;
  }

  void read_start(const sdf::ElementPtr& start, std::vector<StartDescription>& starts) {
    if (!start->HasElement("name") || !start->HasElement("pose")) {
      return diagnostics_.refuse(place_of(start), "<haptic:start> must have a <name> and a <pose>");
    }
    const std::string name = text_of(start, "name");
    const bool is_taken = std::ranges::find(starts, name, &StartDescription::name) != starts.end();
    if (name.empty() || is_taken) {
      diagnostics_.refuse(place_of(start), "<haptic:start> '" + name +
                                               "' must have a name of its own, and not an empty "
                                               "one");
    }
    starts.push_back({name, pose_of(start)});
  }

  void read_contents(const sdf::Model& model, const Pose& X_WM, const std::string& scope,
                     bool fixed) {
    find_held(model, scope);
    for (std::uint64_t i = 0; i < model.LinkCount(); ++i) {
      const sdf::Link& link = *model.LinkByIndex(i);
      read_link(link, X_WM, scope, fixed || held_.contains(scope + "::" + link.Name()));
    }
    for (std::uint64_t i = 0; i < model.ModelCount(); ++i) {
      const sdf::Model& nested = *model.ModelByIndex(i);
      const std::string name = scope + "::" + nested.Name();
      read_contents(nested, X_WM * resolve_pose(nested), name, fixed || nested.Static());
    }
    for (std::uint64_t i = 0; i < model.JointCount(); ++i) {
      read_joint(*model.JointByIndex(i), X_WM, scope);
    }
  }

  /// Links that fixed joints join to the world, directly or by others, never move.
  void find_held(const sdf::Model& model, const std::string& scope) {
    for (bool found = true; found;) {
      found = false;
      for (std::uint64_t i = 0; i < model.JointCount(); ++i) {
        const sdf::Joint& joint = *model.JointByIndex(i);
        std::string parent;
        std::string child;
        if (joint.Type() != sdf::JointType::FIXED || !joint.ResolveParentLink(parent).empty() ||
            !joint.ResolveChildLink(child).empty()) {
          continue;
        }
        if (parent == "world" || held_.contains(scope + "::" + parent)) {
          found = held_.insert(scope + "::" + child).second || found;
        }
      }
    }
  }

  void read_link(const sdf::Link& link, const Pose& X_WM, const std::string& scope, bool fixed) {
    const sdf::ElementPtr element = link.Element();
    const Pose X_WS = X_WM * resolve_pose(link);
    const Vector3 p_SB = to_vector(link.Inertial().Pose().Pos());

    BodyDescription body;
    body.name = scope + "::" + link.Name();
    body.fixed = fixed;
    body.weightless = !element->Get<bool>("gravity", true).first;
    body.X_WB = {X_WS * p_SB, X_WS.R};
    body.p_BS = -p_SB;
    if (element->Get<bool>("kinematic", false).first) {
      diagnostics_.refuse(place_of(element),
                          "<kinematic> true is not supported; make the model <static>, or let the "
                          "link move freely");
    }
    const std::optional<Solid> solid = read_collisions(link, body);
    // In a static model it does not count.
    if (!fixed) read_inertia(link, solid, body, diagnostics_);
    world_.bodies.push_back(std::move(body));
  }

  /// Returns what all of them fill, in B; empty for a link that is fixed.
  std::optional<Solid> read_collisions(const sdf::Link& link, BodyDescription& body) {
    std::optional<Solid> all;
    for (std::uint64_t i = 0; i < link.CollisionCount(); ++i) {
      const sdf::Collision& source = *link.CollisionByIndex(i);
      if (source.Geom()->Type() == sdf::GeometryType::EMPTY && !cone_of(*source.Geom())) {
        diagnostics_.approximate(place_of(source.Element()),
                                 "a collision without a shape that can be used is left out");
        continue;
      }
      FileCollision read = to_collision(source, body.p_BS, body.fixed, diagnostics_);
      if (read.solid_B) all = all ? together(*all, *read.solid_B) : *read.solid_B;
      std::ranges::move(read.pieces, std::back_inserter(body.collisions));
    }
    return all;
  }

  void read_joint(const sdf::Joint& joint, const Pose& X_WM, const std::string& scope) {
    std::string parent;
    std::string child;
    // Where there is no such link, the parser has said so.
    if (!joint.ResolveParentLink(parent).empty() || !joint.ResolveChildLink(child).empty()) return;
    const FileJoint read = to_joint(joint, diagnostics_);
    JointDescription description = read.joint;
    description.name = scope + "::" + joint.Name();
    description.parent = parent == "world" ? -1 : find_body(scope + "::" + parent);
    description.child = find_body(scope + "::" + child);
    if (description.child < 0) {
      return diagnostics_.refuse(place_of(joint.Element()), "no link '" + child + "'");
    }
    description.X_WJ = X_WM * resolve_pose(joint, "__model__");
    if (read.start != 0) starts_.push_back({world_.joints.size(), read.start, read.limits});
    world_.joints.push_back(description);
  }

  /// Joints whose limits do not include 0 start at the one nearest to it.
  void start_within_limits() {
    for (const auto& [joint, position, place] : starts_) {
      const JointDescription& moved = world_.joints[joint];
      if (world_.bodies[static_cast<std::size_t>(moved.child)].fixed) continue;
      const std::string text =
          "limit " + shortest_text(position) + (moved.type == BodyJoint::kRevolute ? " rad" : " m");
      if (move_child(world_, joint, position)) {
        diagnostics_.approximate(
            place, text + ": the joint starts there, as its limits do not include 0, its position");
      } else {
        diagnostics_.refuse(place, text +
                                       " must include 0, the initial position: the child is joined "
                                       "to its parent or to something fixed in other ways, too");
      }
    }
  }

  /// -1 if there is none of that name.
  int find_body(const std::string& scoped_name) const {
    const auto body = std::ranges::find(world_.bodies, scoped_name, &BodyDescription::name);
    return body == world_.bodies.end() ? -1 : static_cast<int>(body - world_.bodies.begin());
  }

  /// A joint that does not start at 0.
  struct Start {
    std::size_t joint = 0;
    double position = 0;
    Place place;
  };

  WorldDescription& world_;
  Diagnostics& diagnostics_;
  std::vector<Start> starts_;
  std::set<std::string> held_;  ///< Scoped names of links.
};

}  // namespace

void add_model(const sdf::Model& model, WorldDescription& world, Diagnostics& diagnostics) {
  ModelReader(world, diagnostics).read(model);
}

}  // namespace hlm::ve
