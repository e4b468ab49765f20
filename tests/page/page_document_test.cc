// docs/page_messages.md against what the client sends to pages and accepts from them.
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>

#include <nlohmann/json.hpp>

#include "hlm/common/freedoms.h"
#include "hlm/page/methods.h"
#include "hlm/page/page_messages.h"
#include "hlm/page/page_requests.h"
#include "hlm/page/tick_columns.h"
#include "hlm/protocol/transport/memory_network.h"
#include "hlm/ve_client/run/world_view.h"
#include "tests/support/catch.h"

namespace hlm::ve {
namespace {

using nlohmann::json;
using Row = std::vector<std::string>;

/// The parts of the document that are checked, by the name of the message.
struct Section {
  std::vector<Row> rows;  ///< Cells of all its tables but their headings, without backquotes.
  std::vector<std::string> examples;

  const Row& row(const std::string& field) const {
    for (const Row& row : rows) {
      if (row.front() == field) return row;
    }
    FAIL("the document has no row " << field);
    throw std::logic_error("unreachable");
  }
};

std::string trimmed(const std::string& text) {
  return std::regex_replace(text, std::regex("^ +| +$|`"), "");
}

Row cells(const std::string& line) {
  Row row;
  std::istringstream text(line.substr(1));
  for (std::string cell; std::getline(text, cell, '|');) row.push_back(trimmed(cell));
  return row;
}

std::map<std::string, Section> read_document() {
  std::ifstream file(HLM_PAGE_DOCUMENT);
  REQUIRE(file);
  std::map<std::string, Section> sections;
  Section* section = nullptr;
  bool in_table = false;
  bool in_example = false;
  const std::string heading = "### Message: ";
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("#")) section = nullptr;
    if (line.starts_with(heading)) section = &sections[line.substr(heading.size())];
    if (line.starts_with("```")) in_example = line == "```json";
    if (section == nullptr) continue;
    if (in_example && line.starts_with("{")) section->examples.push_back(line);
    if (line.starts_with("|---"))
      in_table = true;
    else if (!line.starts_with("|"))
      in_table = false;
    else if (in_table)
      section->rows.push_back(cells(line));
  }
  return sections;
}

const Section& section(const std::string& message) {
  static const std::map<std::string, Section> kSections = read_document();
  REQUIRE(kSections.contains(message));
  return kSections.at(message);
}

bool is_row(const json& value, std::size_t count) {
  return value.is_array() && value.size() == count &&
         std::all_of(value.begin(), value.end(), [](const json& n) { return n.is_number(); });
}

template <class Is>
bool all(const json& list, Is is) {
  return list.is_array() && std::all_of(list.begin(), list.end(), is);
}

/// Whether a value is of a type as the document writes it.
bool has_type(const json& value, const std::string& type) {
  if (const auto either = type.find(" or "); either != std::string::npos) {
    return has_type(value, type.substr(0, either)) || has_type(value, type.substr(either + 4));
  }
  if (type == "null") return value.is_null();
  if (type == "text") return value.is_string();
  if (type == "number") return value.is_number();
  if (type == "integer") return value.is_number_integer();
  if (type == "true/false") return value.is_boolean();
  if (type == "texts") return all(value, [](const json& v) { return v.is_string(); });
  if (type == "numbers") return all(value, [](const json& v) { return v.is_number(); });
  if (type == "integers") return all(value, [](const json& v) { return v.is_number_integer(); });
  if (type == "lists of 7 numbers") return all(value, [](const json& v) { return is_row(v, 7); });
  std::smatch match;
  if (!std::regex_match(type, match, std::regex("(\\d+) numbers"))) return false;
  return is_row(value, std::stoul(match[1]));
}

/// Members whose names are those of settings.
bool has_settings_as_names(const std::string& path) {
  return path == "ranges" || path == "settings" || path == "environment";
}

/// Visits each value that has a row: members of objects, also of those in lists.
template <class Visit>
void visit_fields(const json& object, const std::string& path, Visit&& visit) {
  for (const auto& item : object.items()) {
    const std::string name = has_settings_as_names(path) ? "*" : item.key();
    const std::string field = path.empty() ? name : path + "." + name;
    const json& value = item.value();
    if (path.empty() && name == "type") continue;
    if (value.is_object()) {
      visit_fields(value, field, visit);
    } else if (value.is_array() && !value.empty() && value.front().is_object()) {
      for (const json& element : value) visit_fields(element, field + "[]", visit);
    } else {
      visit(field, value);
    }
  }
}

/// Whether it is empty because the list of objects is.
bool is_empty_list(const Section& described, const std::string& field, const json& value) {
  return value.is_array() && value.empty() &&
         std::any_of(described.rows.begin(), described.rows.end(),
                     [&](const Row& row) { return row.front().starts_with(field + "[]."); });
}

/// Checks that messages have the documented fields, each of its type, and no others.
void check_messages(const std::string& name, const std::vector<std::string>& messages) {
  const Section& described = section(name);
  std::set<std::string> met;
  for (const std::string& text : messages) {
    const json message = json::parse(text);
    CHECK(message["type"] == name);
    visit_fields(message, "", [&](const std::string& field, const json& value) {
      if (is_empty_list(described, field, value)) return;
      INFO(field << " = " << value.dump());
      CHECK(has_type(value, described.row(field).at(1)));
      met.insert(field);
    });
  }
  for (const Row& row : described.rows) {
    INFO(row.front() << " is documented, but never sent");
    CHECK(met.contains(row.front()));
  }
}

/// The words that a row lists after "words:".
void check_words(const std::string& message, const std::string& field,
                 const std::vector<std::string_view>& words) {
  std::string expected = "words: ";
  for (const std::string_view word : words) {
    expected.append(expected.ends_with(" ") ? "" : ", ").append(word);
  }
  INFO(field);
  const Row& row = section(message).row(field);
  CHECK(std::any_of(row.begin(), row.end(),
                    [&](const std::string& c) { return c.ends_with(expected); }));
}

template <class Enum>
std::vector<std::string_view> names() {
  std::vector<std::string_view> all;
  for (const Word<Enum>& word : kWords<Enum>) all.push_back(word.name);
  return all;
}

/// A world with a tool in it, and a client that has no server.
struct Stage {
  Stage(const char* name, const char* tool)
      : scene(load_scene(std::string(HLM_WORLDS) + "/" + name + ".sdf", {{tool, ""}})),
        scenes(scenes_beside(scene.file)),
        environment(scene.world, scene.tools, {}),
        client(network.client(), {.server = protocol::MemoryNetwork::kServer,
                                  .tool = environment.tools.front().assembly.description,
                                  .q = environment.tools.front().assembly.q}) {}

  std::string world_message(const protocol::Welcome* welcome) const {
    return ve::world_message(page_world({environment, scene, scenes, start, welcome}));
  }
  std::string frame_message(const protocol::ProxyState* state,
                            const protocol::LocalState* contacts) const {
    protocol::Reject reject;
    reject.reason = protocol::RejectReason::kFault;
    const ToolAssembly& assembly = environment.tools.front().assembly;
    const PageTool tool{assembly.description, assembly.q, assembly.bodies, assembly.X_LB};
    PageFrame frame = page_frame(environment, client, {});
    frame.tool = &tool;
    frame.state = state;
    frame.contacts = contacts;
    frame.settings = settings;
    frame.rejected = reject;
    return ve::frame_message(frame);
  }
  protocol::ProxyState state() const {
    protocol::ProxyState state;
    state.q = environment.tools.front().assembly.q;
    return state;
  }

  protocol::MemoryNetwork network;
  Scene scene;
  std::vector<SceneSummary> scenes;
  std::string start;
  VirtualEnvironment environment;
  HapticClient client;
  LiveSettings settings;
};

TEST_CASE("Each message to a page has the documented fields and types") {
  const protocol::Welcome welcome;
  Stage testbed("testbed", "peg");
  const Stage linkage("linkage", "arm");
  check_messages("world", {testbed.world_message(nullptr), linkage.world_message(&welcome),
                           Stage("playground", "peg").world_message(&welcome),
                           Stage("mesh", "hook").world_message(&welcome)});

  protocol::ProxyState state = testbed.state();
  std::vector<std::string> frames{testbed.frame_message(nullptr, nullptr),
                                  linkage.frame_message(nullptr, nullptr),
                                  testbed.frame_message(&state, nullptr)};
  protocol::LocalState contacts;
  contacts.contacts.push_back({});
  contacts.contacts.push_back({.a = {SideKind::kToolLink, 0}, .b = {SideKind::kMovableBody, 1}});
  state.active_contacts = 1;
  testbed.settings.tuning.stiffness = 1;
  testbed.settings.frame.epsilon = 0.001;
  frames.push_back(testbed.frame_message(&state, &contacts));
  check_messages("frame", frames);
  check_messages("refused", {refused_message("stiffness", "-1", "must be")});
}

TEST_CASE("The chain of force counts the contacts of the tool alone") {
  const Stage stage("stack", "finger");
  protocol::ProxyState state = stage.state();
  state.active_contacts = 9;
  state.smallest_separation = -0.002;
  const auto value_of = [&](const char* link, const protocol::LocalState& contacts) {
    const json frame = json::parse(stage.frame_message(&state, &contacts));
    for (const json& one : frame["chain"]) {
      if (one["name"] == link) return one["value"].get<std::string>();
    }
    return std::string();
  };
  protocol::LocalState contacts;
  const auto add = [&](SideKind of, double s, const Vector3& f) {
    protocol::LocalContactReport& contact = contacts.contacts.emplace_back();
    contact.a.kind = of;
    contact.s = s;
    contact.f_W = f;
  };
  add(SideKind::kMovableBody, -0.002, {0, 0, 61.8});
  CHECK(value_of("contacts", contacts) == "0");
  CHECK(value_of("separation", contacts) == "–");
  CHECK(value_of("penalty", contacts) == "0.00 N\n0 active");
  add(SideKind::kToolLink, -0.001, {0, 3, 4});
  add(SideKind::kToolLink, 0.003, {0, 0, 0});
  CHECK(value_of("contacts", contacts) == "2");
  CHECK(value_of("separation", contacts) == "-1.00 mm");
  CHECK(value_of("penalty", contacts) == "5.00 N\n1 active");
}

TEST_CASE("A coupling that the device does not bear is shown as it is in effect") {
  Stage stage("testbed", "peg");
  stage.settings.tuning.controller = ControllerKind::kVirtualCoupler;
  stage.settings.tuning.coupling_stiffness = 2000;  // N/m
  protocol::ProxyState state = stage.state();
  state.lowered = 0.75;
  const auto shown = [&] {
    const auto frame = nlohmann::json::parse(stage.frame_message(&state, nullptr));
    return frame["settings"]["coupling_stiffness"].get<double>();
  };
  CHECK(shown() == 500);
  stage.settings.tuning.controller = ControllerKind::kDirect;  // Contacts are lowered.
  CHECK(shown() == 2000);
}

TEST_CASE("A menu of names that are not UTF-8 is still a message") {
  Stage stage("testbed", "peg");
  stage.scenes.push_back({.name = "\xff", .file = {}, .description = "\xe9"});
  const json scenes = json::parse(stage.world_message(nullptr))["scenes"];
  CHECK(scenes.size() == stage.scenes.size());
}

TEST_CASE("A tool in space has no plane, and a planar device lacks its directions") {
  protocol::Welcome welcome;
  welcome.device.freedoms = kPlanarFreedoms;
  const auto message = [&](const char* world, const char* tool) {
    return json::parse(Stage(world, tool).world_message(&welcome));
  };
  for (const json& planar : {message("push", "pusher"), message("scissors", "scissors")}) {
    CHECK(planar["planar"] == true);
    CHECK(planar["mismatch"] == "");
  }
  const json spatial = message("lift", "fork");
  CHECK(spatial["planar"] == false);
  CHECK_THAT(spatial["mismatch"].get<std::string>(),
             Catch::Matchers::Contains("along z and about x, y"));
}

TEST_CASE("The documented words are those of the enumerations") {
  check_words("frame", "rejected", names<protocol::RejectReason>());
  check_words("frame", "limit", names<ForceLimit>());
  check_words("frame", "contacts[].of", names<SideKind>());
  check_words("frame", "contacts[].state", names<ContactState>());
  check_words("frame", "server", names<ServerState>());
  check_words("frame", "fault", names<Fault>());
  check_words("frame", "fade", names<Fade>());
  check_words("frame", "contact_state", names<ProxyContactState>());
  check_words("settings", "update_rule", names<UpdateRule>());
  check_words("settings", "controller", names<ControllerKind>());
  std::vector<std::string_view> methods;
  for (const Method& method : kMethods) {
    if (method.on_page) methods.push_back(method.name);
  }
  check_words("method", "name", methods);
}

TEST_CASE("Ticks have the documented header and columns") {
  std::vector<Row> rows = section("ticks").rows;
  REQUIRE(rows.size() == 4 + protocol::kTickColumns.size());
  for (std::size_t i = 0; i < protocol::kTickColumns.size(); ++i) {
    CHECK(rows[4 + i].at(0) == protocol::kTickColumns[i].name);
    CHECK(rows[4 + i].at(1) == protocol::kTickColumns[i].unit);
  }
  protocol::Ticks ticks;
  ticks.first_step = 0x100000002;
  ticks.ticks.push_back({.F_env = {3, 0, 4}, .limit = ForceLimit::kRate});
  TickBatch batch;
  batch.add(ticks);
  batch.add(ticks);
  const std::string bytes = batch.take();
  CHECK(bytes.substr(0, 16) == std::string("TICK\2\0\0\0\2\0\0\0\1\0\0\0", 16));
  CHECK(bytes.size() == 16 + 2 * 4 * protocol::kTickColumns.size());
  CHECK(bytes.substr(16, 4) == std::string("\0\0\xA0\x40", 4));             // 5 N
  CHECK(bytes.substr(bytes.size() - 4) == std::string("\0\0\x40\x40", 4));  // rate: 3
}

ParsedRequest parsed(const std::string& text) {
  return parse_request(text, {},
                       {.links = 1, .starts = {"hole"}, .scenes = {"push"}, .movable = {2}});
}

std::string text_of(const ParsedRequest& request) {
  const auto* refusal = std::get_if<Refusal>(&request);
  return refusal != nullptr ? refusal->text : "";
}

TEST_CASE("Each documented request is accepted, and together they are all that there are") {
  std::string types;
  for (const std::string name : {"hand", "settings", "environment", "method", "step", "pull",
                                 "telemetry", "reset", "scene"}) {
    types += (types.empty() ? "" : name == "scene" ? " or " : ", ") + name;
    const Section& described = section(name);
    CHECK_FALSE(described.examples.empty());
    for (const std::string& example : described.examples) {
      CAPTURE(example);
      CHECK(text_of(parsed(example)).empty());
      const json message = json::parse(example);
      CHECK(message["type"] == name);
      for (const auto& item : message.items()) {
        if (item.key() == "type") continue;
        INFO(item.key());
        CHECK(has_type(item.value(), described.row(item.key()).at(1)));
      }
    }
  }
  CHECK_THAT(text_of(parsed(R"({"type":"dance"})")), Catch::Matchers::EndsWith("must be " + types));
}

/// Checks rows against a table of ranges in the code.
template <class Ranges>
void check_ranges(const std::string& message, const Ranges& ranges) {
  const Section& described = section(message);
  for (const auto& range : ranges) {
    INFO(range.name);
    const Row& row = described.row(range.name);
    const std::string allowed = shortest_text(range.least) + " to " + shortest_text(range.most);
    CHECK(row.at(1) == "number");
    CHECK(row.at(2) == range.unit);
    CHECK(row.at(3) == allowed);
    const auto request = [&](double value) {
      return parsed(json{{"type", message}, {range.name, value}}.dump());
    };
    CHECK(text_of(request(range.least)).empty());
    CHECK(text_of(request(range.most)).empty());
    CHECK_THAT(text_of(request(range.most * 1.01)), Catch::Matchers::Contains(allowed));
    CHECK_THAT(text_of(request(range.least - 0.01)), Catch::Matchers::Contains(allowed));
  }
  const auto numbers = std::count_if(described.rows.begin(), described.rows.end(),
                                     [](const Row& row) { return row.at(1) == "number"; });
  CHECK(static_cast<std::size_t>(numbers) == ranges.size());
}

TEST_CASE("Settings have the documented units and ranges") {
  check_ranges("settings", kTuningRanges);
  check_ranges("environment", kEnvironmentRanges);
}

}  // namespace
}  // namespace hlm::ve
