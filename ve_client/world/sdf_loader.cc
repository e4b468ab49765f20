#include "ve_client/world/sdf_loader.h"

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include <sdf/Joint.hh>
#include <sdf/JointAxis.hh>
#include <sdf/Link.hh>
#include <sdf/Model.hh>
#include <sdf/ParserConfig.hh>
#include <sdf/Root.hh>
#include <sdf/World.hh>

#include "common/one_line.h"
#include "common/range.h"
#include "ve_client/world/sdf_geometry.h"
#include "ve_client/world/sdf_messages.h"
#include "ve_client/world/sdf_support.h"

namespace hlm::ve {
namespace {

template <class Named>
Pose resolve_pose(const Named& element, const std::string& where, const std::string& frame = "") {
  ignition::math::Pose3d pose;
  require_none(element.SemanticPose().Resolve(pose, frame), where);
  return to_pose(pose);
}

/// Reads one top-level model with its nested models into a world.
class ModelReader {
 public:
  explicit ModelReader(WorldDescription& world) : world_(world) {}

  void read(const sdf::Model& model) {
    const std::string where = "model '" + model.Name() + "'";
    ModelDescription description;
    description.name = model.Name();
    description.fixed = model.Static();
    description.first_body = static_cast<int>(world_.bodies.size());
    read_tool_elements(*model.Element(), where, description);
    description.X_WM = resolve_pose(model, where);
    read_contents(model, description.X_WM, model.Name(), model.Static());
    description.body_count = static_cast<int>(world_.bodies.size()) - description.first_body;
    world_.models.push_back(description);
  }

 private:
  static void read_tool_elements(sdf::Element& model, const std::string& where,
                                 ModelDescription& description) {
    if (model.HasElement("haptic:tool_joint")) {
      const std::string type = model.Get<std::string>("haptic:tool_joint");
      if (type != "free" && type != "planar") {
        throw std::runtime_error(where + ": <haptic:tool_joint> '" + type +
                                 "' must be free or planar");
      }
      description.tool_joint = type == "free" ? JointType::kFree : JointType::kPlanar;
    }
    if (model.HasElement("haptic:hand"))
      read_hand(*model.GetElement("haptic:hand"), where, description);
    if (!model.HasElement("haptic:start")) return;
    for (sdf::ElementPtr start = model.GetElement("haptic:start"); start;
         start = start->GetNextElement("haptic:start")) {
      description.starts.push_back(read_start(*start, where, description.starts));
    }
  }

  static void read_hand(sdf::Element& hand, const std::string& where,
                        ModelDescription& description) {
    if (!hand.HasElement("link")) {
      throw std::runtime_error(where + ": <haptic:hand> must name the held <link>");
    }
    description.hand_link = hand.Get<std::string>("link");
    if (hand.HasElement("pose")) description.X_SH = read_pose(hand, where + ": <haptic:hand>");
  }

  static StartDescription read_start(sdf::Element& start, const std::string& where,
                                     const std::vector<StartDescription>& others) {
    if (!start.HasElement("name") || !start.HasElement("pose")) {
      throw std::runtime_error(where + ": <haptic:start> must have a <name> and a <pose>");
    }
    const auto name = start.Get<std::string>("name");
    const std::string what = where + ": <haptic:start> '" + name + "'";
    const bool is_taken = std::ranges::find(others, name, &StartDescription::name) != others.end();
    if (name.empty() || is_taken) {
      throw std::runtime_error(what + " must have a name of its own, and not an empty one");
    }
    return {name, read_pose(start, what)};
  }

  static Pose read_pose(sdf::Element& parent, const std::string& where) {
    ignition::math::Pose3d pose;
    std::istringstream text(parent.Get<std::string>("pose"));
    if (!(text >> pose)) {
      throw std::runtime_error(where + " <pose> '" + text.str() +
                               "' must be six numbers: x y z (m) roll pitch yaw (rad)");
    }
    return to_pose(pose);
  }

  void read_contents(const sdf::Model& model, const Pose& X_WM, const std::string& scope,
                     bool fixed) {
    for (std::uint64_t i = 0; i < model.LinkCount(); ++i) {
      read_link(*model.LinkByIndex(i), X_WM, scope, fixed);
    }
    for (std::uint64_t i = 0; i < model.ModelCount(); ++i) {
      const sdf::Model& nested = *model.ModelByIndex(i);
      const std::string name = scope + "::" + nested.Name();
      read_contents(nested, X_WM * resolve_pose(nested, "model '" + name + "'"), name,
                    fixed || nested.Static());
    }
    for (std::uint64_t i = 0; i < model.JointCount(); ++i) {
      read_joint(*model.JointByIndex(i), X_WM, scope);
    }
  }

  void read_link(const sdf::Link& link, const Pose& X_WM, const std::string& scope, bool fixed) {
    const std::string name = scope + "::" + link.Name();
    const std::string where = "link '" + name + "'";
    const Pose X_WS = X_WM * resolve_pose(link, where);
    const Vector3 p_SB = to_vector(link.Inertial().Pose().Pos());

    BodyDescription body;
    body.name = name;
    body.fixed = fixed;
    body.weightless = !link.Element()->Get<bool>("gravity", true).first;
    body.mass = link.Inertial().MassMatrix().Mass();
    body.I_B = to_matrix(link.Inertial().Moi());
    body.X_WB = {X_WS * p_SB, X_WS.R};
    body.p_BS = -p_SB;
    for (std::uint64_t i = 0; i < link.CollisionCount(); ++i) {
      const sdf::Collision& collision = *link.CollisionByIndex(i);
      const std::string what = where + " collision '" + collision.Name() + "'";
      auto pieces = to_collisions(collision, body.p_BS, what, fixed, world_.repairs);
      std::ranges::move(pieces, std::back_inserter(body.collisions));
      if (!fixed && std::holds_alternative<HalfSpace>(body.collisions.back().shape)) {
        throw std::runtime_error(what + ": a plane is allowed in static models only");
      }
    }
    world_.bodies.push_back(std::move(body));
  }

  int find_body(const std::string& scoped_name, const std::string& where) const {
    const auto body = std::ranges::find(world_.bodies, scoped_name, &BodyDescription::name);
    if (body == world_.bodies.end()) {
      throw std::runtime_error(where + ": no link '" + scoped_name + "'");
    }
    return static_cast<int>(body - world_.bodies.begin());
  }

  void read_joint(const sdf::Joint& joint, const Pose& X_WM, const std::string& scope) {
    const std::string where = "joint '" + scope + "::" + joint.Name() + "'";
    JointDescription description;
    description.name = scope + "::" + joint.Name();
    description.type = joint_type(joint, where);
    std::string parent;
    std::string child;
    require_none(joint.ResolveParentLink(parent), where);
    require_none(joint.ResolveChildLink(child), where);
    if (child == "world") throw std::runtime_error(where + ": child 'world' must be a link");
    description.parent = parent == "world" ? -1 : find_body(scope + "::" + parent, where);
    description.child = find_body(scope + "::" + child, where);
    description.X_WJ = X_WM * resolve_pose(joint, where, "__model__");
    if (description.type != JointType::kFixed) read_axis(joint, where, description);
    world_.joints.push_back(description);
  }

  static JointType joint_type(const sdf::Joint& joint, const std::string& where) {
    switch (joint.Type()) {
      case sdf::JointType::FIXED:
        return JointType::kFixed;
      case sdf::JointType::REVOLUTE:
      case sdf::JointType::CONTINUOUS:
        return JointType::kRevolute;
      case sdf::JointType::PRISMATIC:
        return JointType::kPrismatic;
      default:
        throw std::runtime_error(where + ": type '" + joint.Element()->Get<std::string>("type") +
                                 "' must be fixed, revolute, continuous or prismatic");
    }
  }

  static void read_axis(const sdf::Joint& joint, const std::string& where,
                        JointDescription& description) {
    const sdf::JointAxis* axis = joint.Axis(0);
    if (axis == nullptr) throw std::runtime_error(where + ": has no <axis>");
    ignition::math::Vector3d axis_J;
    require_none(axis->ResolveXyz(axis_J), where);
    description.axis_J = to_vector(axis_J).normalized();
    read_dynamics(*axis, where, description);
    if (joint.Type() == sdf::JointType::CONTINUOUS) return;
    // SDF writes "no limit" as a very large number.
    constexpr double kNoLimit = 1e15;
    if (axis->Lower() > -kNoLimit) description.lower = axis->Lower();
    if (axis->Upper() < kNoLimit) description.upper = axis->Upper();
    if (!(description.lower <= 0 && description.upper >= 0)) {
      throw std::runtime_error(where + ": limits " + std::to_string(axis->Lower()) + " to " +
                               std::to_string(axis->Upper()) +
                               " must include 0, the initial position");
    }
  }

  static void read_dynamics(const sdf::JointAxis& axis, const std::string& where,
                            JointDescription& description) {
    description.stiffness = at_least_zero(axis.SpringStiffness(), where + ": spring_stiffness");
    description.damping = at_least_zero(axis.Damping(), where + ": damping");
    description.rest = axis.SpringReference();
  }

  static double at_least_zero(double value, const std::string& what) {
    if (const auto error = find_error(what, value, from_zero(""))) throw std::runtime_error(*error);
    return value;
  }

  WorldDescription& world_;
};

/// <physics>: of all that may stand there, the step and the solver's iterations.
SolverDescription read_solver(sdf::Element& world) {
  constexpr Range kSteps{1e-4, 0.1, "s"};
  constexpr Range kSweeps{1, 1000};
  SolverDescription solver;
  if (!world.HasElement("physics")) return solver;
  const sdf::ElementPtr physics = world.GetElement("physics");
  const sdf::ElementPtr step = physics->FindElement("max_step_size");
  if (step && step->GetExplicitlySetInFile()) {
    solver.largest_step = step->Get<double>();
    const auto error = find_error("physics: max_step_size", *solver.largest_step, kSteps);
    if (error) throw std::runtime_error(*error);
  }
  sdf::ElementPtr sweeps = physics;
  for (const char* child : {"ode", "solver", "iters"}) {
    if (sweeps) sweeps = sweeps->FindElement(child);
  }
  if (sweeps && sweeps->GetExplicitlySetInFile()) {
    solver.sweeps = sweeps->Get<int>();
    const auto error = find_error("physics: iters", *solver.sweeps, kSweeps);
    if (error) throw std::runtime_error(*error);
  }
  return solver;
}

/// The text of a world's own element, with single spaces; empty if there is none.
std::string read_text(sdf::Element& world, const std::string& name) {
  if (!world.HasElement(name)) return "";
  const sdf::ElementPtr element = world.GetElement(name);
  const std::string text = single_spaced(element->Get<std::string>());
  if (text.empty()) throw std::runtime_error("<" + name + "> must not be empty");
  if (element->GetNextElement(name)) {
    throw std::runtime_error("<" + name + "> '" + text + "' must be the only one of the world");
  }
  return text;
}

WorldDescription read(const sdf::Root& root) {
  require_supported(root.Element());
  if (root.WorldCount() != 1) {
    throw std::runtime_error(std::to_string(root.WorldCount()) +
                             " <world> elements; exactly one is allowed");
  }
  const sdf::World& source = *root.WorldByIndex(0);
  WorldDescription world;
  world.gravity_W = to_vector(source.Gravity());
  world.solver = read_solver(*source.Element());
  ModelReader reader(world);
  for (std::uint64_t i = 0; i < source.ModelCount(); ++i) reader.read(*source.ModelByIndex(i));
  world.tool = read_text(*source.Element(), "haptic:tool");
  world.description = read_text(*source.Element(), "haptic:description");
  if (!world.tool.empty()) find_model(world, world.tool);
  return world;
}

/// Loads with `load(root, config)`; every message names `name`.
template <class Load>
WorldDescription load_with(const std::string& name, Load load) {
  const CapturedMessages messages;
  sdf::ParserConfig config;
  config.SetUnrecognizedElementsPolicy(sdf::EnforcementPolicy::ERR);
  sdf::Root root;
  const sdf::Errors errors = load(root, config);
  require_none(errors, name, messages.first_error());
  try {
    return read(root);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(one_line(name + ": " + error.what()));
  }
}

}  // namespace

std::string single_spaced(const std::string& text) {
  std::istringstream words(text);
  std::string line;
  for (std::string word; words >> word;) line.append(line.empty() ? "" : " ").append(word);
  return line;
}

WorldDescription load_world(const std::filesystem::path& file) {
  if (!std::filesystem::is_regular_file(file)) {
    throw std::runtime_error("world file '" + file.string() + "' does not exist");
  }
  return load_with(file.string(), [&](sdf::Root& root, const sdf::ParserConfig& config) {
    return root.Load(file.string(), config);
  });
}

WorldDescription parse_world(const std::string& text, const std::string& name) {
  return load_with(name, [&](sdf::Root& root, const sdf::ParserConfig& config) {
    return root.LoadSdfString(text, config);
  });
}

}  // namespace hlm::ve
