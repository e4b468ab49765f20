#include "hlm/page/page_messages.h"

#include <algorithm>
#include <bit>
#include <limits>

#include <boost/endian/conversion.hpp>
#include <nlohmann/json.hpp>

#include "hlm/common/force_chain.h"
#include "hlm/common/freedoms.h"
#include "hlm/geometry/hull.h"
#include "hlm/page/methods.h"
#include "hlm/page/tick_columns.h"

namespace hlm::ve {

using namespace geometry;

namespace {

using nlohmann::json;

json to_json(const Vector3& v) { return {v.x(), v.y(), v.z()}; }

json to_json(const Wrench& F) { return {F[0], F[1], F[2], F[3], F[4], F[5]}; }

json to_json(const Pose& X) {
  return {X.p.x(), X.p.y(), X.p.z(), X.R.w(), X.R.x(), X.R.y(), X.R.z()};
}

/// Triangles as lists of coordinates and of corners.
json mesh_json(const std::vector<Vector3>& points, json corners) {
  json coordinates = json::array();
  for (const Vector3& p : points) {
    for (const double coordinate : p) coordinates.push_back(coordinate);
  }
  return {{"kind", "mesh"}, {"points", std::move(coordinates)}, {"corners", std::move(corners)}};
}

json to_json(const HullFaces& hull) {
  json corners = json::array();
  for (const auto& loop : hull.loops) {
    for (std::size_t i = 2; i < loop.size(); ++i) {
      for (const std::uint16_t corner : {loop[0], loop[i - 1], loop[i]}) corners.push_back(corner);
    }
  }
  return mesh_json(hull.vertices, std::move(corners));
}

json to_json(const Mesh& mesh) {
  json corners = json::array();
  for (const auto& triangle : mesh.triangles) {
    for (const int corner : triangle) corners.push_back(corner);
  }
  return mesh_json(mesh.points, std::move(corners));
}

json to_json(const Shape& shape) {
  struct Describe {
    json operator()(const Sphere& s) const { return {{"kind", "sphere"}, {"radius", s.radius}}; }
    json operator()(const Capsule& s) const {
      return {{"kind", "capsule"}, {"radius", s.radius}, {"length", s.length}};
    }
    json operator()(const Cylinder& s) const {
      return {{"kind", "cylinder"}, {"radius", s.radius}, {"length", s.length}};
    }
    json operator()(const Box& s) const { return {{"kind", "box"}, {"size", to_json(s.size)}}; }
    json operator()(const Ellipsoid& s) const {
      return {{"kind", "ellipsoid"}, {"radii", to_json(s.radii)}};
    }
    json operator()(const Hull& s) const { return to_json(convex_hull(s.vertices)); }
    json operator()(const HalfSpace&) const { return {{"kind", "plane"}}; }
  };
  return std::visit(Describe{}, shape);
}

json to_json(const std::shared_ptr<const Mesh>& mesh) { return to_json(*mesh); }

json to_json(const PageBody& body) {
  json shapes = json::array();
  for (const PageShape& each : body.shapes) {
    json shape = std::visit([](const auto& geometry) { return to_json(geometry); }, each.geometry);
    shape["pose"] = to_json(each.X_BG);
    shapes.push_back(std::move(shape));
  }
  return {{"name", body.name},
          {"fixed", body.fixed},
          {"tool", body.is_tool},
          {"pose", to_json(body.X_WB)},
          {"shapes", std::move(shapes)}};
}

json ranges(bool environment) {
  json all;
  const auto add = [&](const char* name, double least, double most, const char* unit) {
    all[name] = {{"least", least}, {"most", most}, {"unit", unit}};
  };
  for (const auto& r : kTuningRanges) add(r.name, r.least, r.most, r.unit);
  if (!environment) return all;
  for (const auto& r : kEnvironmentRanges) add(r.name, r.least, r.most, r.unit);
  return all;
}

json tick_columns() {
  json columns = json::array();
  for (const protocol::TickColumn& column : protocol::kTickColumns) {
    columns.push_back({{"name", column.name}, {"unit", column.unit}});
  }
  return columns;
}

template <class Enum>
json names() {
  json all = json::array();
  for (const Word<Enum>& word : kWords<Enum>) all.push_back(word.name);
  return all;
}

json controllers(std::size_t links) {
  json all = json::array();
  for (const Word<ControllerKind>& word : kWords<ControllerKind>) {
    all.push_back({{"name", word.name},
                   {"suits_tool", suits(word.value, links)},
                   {"uses_contacts", traits(word.value).uses_contacts}});
  }
  return all;
}

json methods(std::size_t links) {
  json all = json::array();
  for (const Method& method : kMethods) {
    if (!method.on_page) continue;
    all.push_back({{"name", method.name},
                   {"label", method.label},
                   {"help", method.help},
                   {"suits_tool", suits(method.controller, links)}});
  }
  return all;
}

json scenes_json(const std::vector<SceneSummary>& scenes) {
  json all = json::array();
  for (const SceneSummary& scene : scenes) {
    all.push_back({{"name", scene.name}, {"description", scene.description}});
  }
  return all;
}

std::string mismatch_of(const ToolModel& tool, const protocol::Welcome* welcome) {
  if (welcome == nullptr) return "";
  const Freedoms missing = missing_freedoms(tool, welcome->device.freedoms);
  return missing == 0 ? "" : describe_mismatch(missing);
}

/// The settings in effect: the haptic server lowers a coupling that its device does not
/// support.
Tuning in_effect(Tuning tuning, const protocol::ProxyState* state) {
  const ControllerTraits controller = traits(tuning.controller);
  const bool lowers_contacts = controller.uses_contacts && !controller.couples_translation;
  if (state == nullptr || lowers_contacts) return tuning;
  for (double Tuning::*gain :
       {&Tuning::coupling_stiffness, &Tuning::coupling_damping, &Tuning::coupling_angular_stiffness,
        &Tuning::coupling_angular_damping}) {
    tuning.*gain *= 1 - state->lowered;
  }
  return tuning;
}

json settings_json(const Tuning& tuning) {
  json settings{{"update_rule", name_of(tuning.update_rule)},
                {"controller", name_of(tuning.controller)}};
  for (const auto& range : kTuningRanges) {
    settings[range.name] = tuning.*range.number;
  }
  return settings;
}

json environment_json(LiveSettings settings) {
  json environment;
  for (const auto& range : kEnvironmentRanges) environment[range.name] = range.number(settings);
  return environment;
}

json contacts_json(const protocol::LocalState* state) {
  json contacts = json::array();
  if (state == nullptr) return contacts;
  for (const protocol::LocalContactReport& c : state->contacts) {
    const bool on_body = c.b.kind == SideKind::kMovableBody;
    contacts.push_back({{"of", name_of(c.a.kind)},
                        {"body", on_body ? json(c.b.index) : json(nullptr)},
                        {"c", to_json(c.c_W)},
                        {"n", to_json(c.n_W)},
                        {"p", to_json(c.p_W)},
                        {"s", c.s},
                        {"f", to_json(c.f_W)},
                        {"state", name_of(c.state)}});
  }
  return contacts;
}

/// What caused a fault or a fade: what it is, and what a person can do.
std::string_view cause_of(const protocol::ProxyState& state) {
  if (state.fault != Fault::kNone) return meaning_of(state.fault);
  return state.fade != Fade::kNone ? meaning_of(state.fade) : std::string_view();
}
std::string_view remedy_of(const protocol::ProxyState& state) {
  if (state.fault != Fault::kNone) return hlm::remedy_of(state.fault);
  return state.fade != Fade::kNone ? hlm::remedy_of(state.fade) : std::string_view();
}

void add_state(json& frame, const PageTool& tool, const protocol::ProxyState& state) {
  ToolModel proxy(tool.description);
  proxy.set_configuration(state.q);
  json links = json::array();
  for (int link = 0; link < proxy.links(); ++link) {
    links.push_back(to_json(proxy.X_WL(link) * tool.X_LB[static_cast<std::size_t>(link)]));
  }
  const bool any = state.active_contacts + state.predicted_contacts > 0;
  frame["proxy"] = std::move(links);
  frame["device"] = to_json(state.X_WD);
  frame["F_env"] = to_json(state.F_env);
  frame["grip"] = state.grip;
  frame["F_command"] = to_json(state.F_command);
  frame["F_hand"] = to_json(state.F_hand);
  frame["hand"] = protocol::hand_source(state.hand_measured, state.hand_observed);
  frame["server"] = name_of(state.server);
  frame["fault"] = name_of(state.fault);
  frame["fade"] = name_of(state.fade);
  frame["cause"] = cause_of(state);
  frame["remedy"] = remedy_of(state);
  frame["contact_state"] = name_of(state.contact_state);
  frame["smallest_separation"] = any ? json(state.smallest_separation) : json(nullptr);
  frame["active"] = state.active_contacts;
  frame["age"] = state.age;
}

/// What the server says to a tool that it cannot use; to other refusals the page has its own words.
std::string rejection_of(const PageFrame& view) {
  if (!view.rejected || view.rejected->reason != protocol::RejectReason::kTool) return {};
  return {view.rejected->text.begin(), view.rejected->text.end()};
}

std::string refusal_of(const PageFrame& view) {
  if (!view.rejected) return "haptic_server does not answer";
  return "haptic_server gives no session: " + std::string(meaning_of(view.rejected->reason));
}

/// What the hand has to do with: contacts of bodies with each other and the world give it no force.
void count_contacts_of_tool(const protocol::LocalState& local, ForceFacts& facts) {
  facts.reported = 0;
  facts.active = 0;
  facts.penalty = 0;
  facts.smallest_separation = std::numeric_limits<double>::infinity();
  for (const protocol::LocalContactReport& c : local.contacts) {
    if (c.a.kind != SideKind::kToolLink) continue;
    ++facts.reported;
    if (c.s <= 0) ++facts.active;
    *facts.penalty += c.f_W.norm();
    facts.smallest_separation = std::min(facts.smallest_separation, c.s);
  }
}

ForceFacts facts_of(const PageFrame& view) {
  ForceFacts facts;
  facts.session = view.connected && view.state != nullptr;
  if (!view.connected) facts.refused = refusal_of(view);
  facts.uses_contacts = traits(view.settings.tuning.controller).uses_contacts;
  facts.reported = view.reported;
  facts.epsilon = view.epsilon;
  facts.stiffness = view.settings.tuning.stiffness;
  if (view.state == nullptr) return facts;
  const protocol::ProxyState& state = *view.state;
  facts.server = state.server;
  facts.fault = state.fault;
  facts.age = state.age;
  facts.p_WD = state.X_WD.p;
  if (state.hand_measured) facts.F_hand = state.F_hand.head<3>();
  facts.active = state.active_contacts;
  facts.smallest_separation = state.smallest_separation;
  facts.F_env = state.F_env.head<3>();
  facts.F_command = state.F_command.head<3>();
  facts.limit = state.limit;
  if (view.contacts != nullptr) count_contacts_of_tool(*view.contacts, facts);
  return facts;
}

json chain_json(const PageFrame& view) {
  json chain = json::array();
  for (const ChainLink& link : force_chain(facts_of(view))) {
    chain.push_back({{"name", link.name},
                     {"value", link.value},
                     {"reason", link.reason.empty() ? json(nullptr) : json(link.reason)}});
  }
  return chain;
}

void append(std::string& bytes, std::uint32_t value) {
  boost::endian::native_to_little_inplace(value);
  const auto raw = std::bit_cast<std::array<char, sizeof value>>(value);
  bytes.append(raw.data(), raw.size());
}

void append(std::string& bytes, double value) {
  append(bytes, std::bit_cast<std::uint32_t>(static_cast<float>(value)));
}

}  // namespace

std::string world_message(const PageWorld& world) {
  json described = json::array();
  for (const PageBody& body : world.bodies) described.push_back(to_json(body));
  const std::size_t links = world.tool.description.links.size();
  ToolModel tool(world.tool.description);
  tool.set_configuration(world.tool.q);
  return json{{"type", "world"},
              {"scenes", scenes_json(world.scenes)},
              {"scene", world.scene},
              {"planar", missing_freedoms(tool, kPlanarFreedoms) == 0},
              {"mismatch", mismatch_of(tool, world.welcome)},
              {"bodies", std::move(described)},
              {"tool_links", world.tool.bodies},
              {"gripper", world.tool.gripper},
              {"starts", world.starts},
              {"start", world.start},
              {"ranges", ranges(world.environment)},
              {"methods", world.environment ? methods(links) : json::array()},
              {"update_rules", names<UpdateRule>()},
              {"controllers", controllers(links)},
              {"limits", names<ForceLimit>()},
              {"tick_columns", tick_columns()},
              {"servo_rate", world.welcome != nullptr ? world.welcome->servo_rate : 0},
              {"guidable", world.welcome == nullptr || world.welcome->device.guidable}}
      .dump(-1, ' ', false, json::error_handler_t::replace);  // Names may be any bytes.
}

std::string frame_message(const PageFrame& view) {
  json bodies = json::array();
  for (const Pose& X_WB : view.X_WB) bodies.push_back(to_json(X_WB));
  const Method* const method = method_in_effect(view.settings);
  json frame{{"type", "frame"},
             {"connected", view.connected},
             {"rejected", view.rejected ? name_of(view.rejected->reason) : ""},
             {"rejection", rejection_of(view)},
             {"bodies", std::move(bodies)},
             {"world_time", view.world_time},
             {"held", view.held},
             {"reported", view.reported},
             {"round_trip", view.round_trip},
             {"epsilon", view.epsilon},
             {"limit", view.state ? name_of(view.state->limit) : name_of(ForceLimit::kNone)},
             {"contacts", contacts_json(view.contacts)},
             {"settings", settings_json(in_effect(view.settings.tuning, view.state))},
             {"environment", environment_json(view.settings)},
             {"method", method != nullptr ? json(method->name) : json(nullptr)},
             {"chain", chain_json(view)},
             {"recording", view.recording}};
  if (view.state != nullptr) add_state(frame, *view.tool, *view.state);
  return frame.dump(-1, ' ', false, json::error_handler_t::replace);  // A server's text, too.
}

std::string refused_message(const std::string& field, const std::string& value,
                            const std::string& text) {
  return json{{"type", "refused"}, {"field", field}, {"value", value}, {"text", text}}.dump(
      -1, ' ', false, json::error_handler_t::replace);
}

void TickBatch::add(const protocol::Ticks& ticks) {
  if (count_ == 0) first_step_ = ticks.first_step;
  count_ += ticks.ticks.size();
  for (const protocol::TickSignals& tick : ticks.ticks) {
    for (const protocol::TickColumn& column : protocol::kTickColumns) {
      append(rows_, column.value(tick));
    }
  }
}

std::string TickBatch::take() {
  constexpr std::uint32_t kMagic = 0x4b434954;  // "TICK"
  std::string bytes;
  append(bytes, kMagic);
  append(bytes, static_cast<std::uint32_t>(count_));
  append(bytes, static_cast<std::uint32_t>(first_step_));
  append(bytes, static_cast<std::uint32_t>(first_step_ >> 32));
  bytes += rows_;
  rows_.clear();
  count_ = 0;
  return bytes;
}

}  // namespace hlm::ve
