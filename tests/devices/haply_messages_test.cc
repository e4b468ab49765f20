// Messages of the Inverse Service, good and bad.
#include "hlm/devices/haply_messages.h"

#include <cmath>

#include <nlohmann/json.hpp>

#include "hlm/devices/inverse_service.h"
#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;
using nlohmann::json;

/// A message as the service's documents show it, with two devices and a grip.
json message() {
  return json::parse(R"({
    "inverse3": [
      {"device_id": "049D", "config": {"handedness": "right"},
       "state": {"cursor_position": {"x": 0.01, "y": -0.02, "z": 0.15},
                 "cursor_velocity": {"x": 0.1, "y": 0.0, "z": -0.3}}},
      {"device_id": "049E", "config": {},
       "state": {"cursor_position": {"x": 1, "y": 2, "z": 3},
                 "cursor_velocity": {"x": 0, "y": 0, "z": 0}}}],
    "wireless_verse_grip": [
      {"device_id": "61548",
       "state": {"orientation": {"w": 0.6, "x": 0.0, "y": 0.8, "z": 0.0},
                 "buttons": {"a": true, "b": false, "c": true}}}]})");
}

const HaplyChoice kBoth{"049D", "61548", "wireless_verse_grip"};

std::string error_of(const json& bad, const HaplyChoice& choice = kBoth) {
  try {
    parse_haply_state(bad.dump(), choice);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST_CASE("The first message names devices, their handedness and grips") {
  const HaplyInventory inventory = parse_haply_inventory(message().dump());
  REQUIRE(inventory.devices.size() == 2);
  CHECK(inventory.devices[0].id == "049D");
  CHECK(inventory.devices[0].handedness == "right");
  CHECK(inventory.devices[1].handedness.empty());
  REQUIRE(inventory.grips.size() == 1);
  CHECK(inventory.grips[0].id == "61548");
  CHECK(inventory.grips[0].kind == "wireless_verse_grip");
  CHECK(parse_haply_inventory("{}").devices.empty());
}

TEST_CASE("A state has the chosen device's position and velocity and the grip's orientation") {
  const HandleState state = parse_haply_state(message().dump(), kBoth).handle;
  CHECK(state.X.p == Vector3(0.01, -0.02, 0.15));
  CHECK(state.V.head<3>() == Vector3(0.1, 0, -0.3));
  CHECK(state.X.R.coeffs() == Quaternion(0.6, 0, 0.8, 0).coeffs());
  CHECK(state.buttons == 0b101);
  const HandleState other = parse_haply_state(message().dump(), {"049E"}).handle;
  CHECK(other.X.p == Vector3(1, 2, 3));
  CHECK(other.X.R.coeffs() == Quaternion::Identity().coeffs());
  CHECK(other.buttons == 0);
}

TEST_CASE("A wired grip has one button, and a custom one is a grip too") {
  for (const char* kind : {"verse_grip", "custom_verse_grip"}) {
    INFO(kind);
    json wired = message();
    wired[kind] = {
        {{"device_id", "W"},
         {"state", {{"orientation", {{"w", 1}, {"x", 0}, {"y", 0}, {"z", 0}}}, {"button", true}}}}};
    const HaplyInventory inventory = parse_haply_inventory(wired.dump());
    REQUIRE(inventory.grips.size() == 2);
    CHECK(inventory.grips[1].kind == kind);
    CHECK(parse_haply_state(wired.dump(), {"049D", "W", kind}).handle.buttons == 1);
    wired[kind][0]["state"]["button"] = false;
    CHECK(parse_haply_state(wired.dump(), {"049D", "W", kind}).handle.buttons == 0);
  }
}

TEST_CASE("Buttons are an object, a list of bools, or the names of those that are down") {
  json listed = message();
  json& state = listed["wireless_verse_grip"][0]["state"];
  state["buttons"] = {true, false, true};
  CHECK(parse_haply_state(listed.dump(), kBoth).handle.buttons == 0b101);
  state["buttons"] = {"a", "c"};
  CHECK(parse_haply_state(listed.dump(), kBoth).handle.buttons == 0b101);
  state["buttons"] = json::array();
  CHECK(parse_haply_state(listed.dump(), kBoth).handle.buttons == 0);
}

TEST_CASE("What a state leaves out is as it was, and a speed of a handle that stands is zero") {
  json first = message();
  first["inverse3"][0]["status"] = {{"calibrated", false}};
  const HaplyState before = parse_haply_state(first.dump(), kBoth);
  REQUIRE(before.handle.force_off != nullptr);
  json partial = message();
  partial["inverse3"][0]["state"].erase("cursor_position");
  partial["inverse3"][0]["state"].erase("cursor_velocity");
  partial["wireless_verse_grip"][0]["state"].clear();
  const HaplyState same = parse_haply_state(partial.dump(), kBoth, before);
  CHECK(same.handle.X.p == before.handle.X.p);
  CHECK(same.handle.V == before.handle.V);
  CHECK(same.handle.X.R.coeffs() == before.handle.X.R.coeffs());
  CHECK(same.handle.buttons == 0b101);
  CHECK(same.handle.force_off == before.handle.force_off);
  partial["inverse3"][0]["state"]["cursor_position"] =
      message()["inverse3"][0]["state"]["cursor_position"];
  CHECK(parse_haply_state(partial.dump(), kBoth, before).handle.V.isZero());
}

TEST_CASE("Metres of a scaled mount and transform are those of the handle again") {
  json scaled = message();
  scaled["inverse3"][0]["config"]["mount"]["scale"] = {{"x", 2}, {"y", 2}, {"z", 2}};
  scaled["inverse3"][0]["state"]["transform"]["scale"] = {{"x", 0.5}, {"y", 0.5}, {"z", 0.5}};
  HaplyState state = parse_haply_state(scaled.dump(), kBoth);
  CHECK(state.mount_scale == 2);
  CHECK(state.session_scale == 0.5);
  CHECK(state.handle.X.p == Vector3(0.01, -0.02, 0.15));  // m
  scaled["inverse3"][0].erase("config");
  scaled["inverse3"][0]["state"]["transform"] = json::object();  // The identity is left out.
  state = parse_haply_state(scaled.dump(), kBoth, state);
  CHECK(state.handle.X.p.isApprox(Vector3(0.005, -0.01, 0.075)));
  CHECK(state.handle.V[2] == Approx(-0.15));  // m/s
  scaled["inverse3"][0]["state"]["transform"]["scale"] = {{"x", 1}, {"y", 2}, {"z", 1}};
  CHECK_THAT(error_of(scaled), ContainsSubstring("must be one positive number"));
}

TEST_CASE("A Minverse in a list of its own is commanded there") {
  json own = message();
  own["minverse"] = own["inverse3"];
  own.erase("inverse3");
  const HaplyInventory inventory = parse_haply_inventory(own.dump());
  REQUIRE(inventory.devices.size() == 2);
  const HaplyChoice choice = choose(inventory, {.device = "049D"});
  CHECK(choice.device_kind == "minverse");
  CHECK_NOTHROW(parse_haply_state(own.dump(), choice));
  CHECK_THAT(haply_force_request(choice, "vector", {1, 0, 0}), ContainsSubstring("minverse"));
}

TEST_CASE("A setting is a number, by itself or within what wraps it") {
  CHECK(parse_haply_setting("0.5") == 0.5);
  CHECK(parse_haply_setting(R"({"ok": true, "data": 2})") == 2);
  CHECK(parse_haply_setting(R"({"data": {"key": "devices/force_scale", "value": 0.7}})") == 0.7);
  CHECK_FALSE(parse_haply_setting("nothing"));
  CHECK_FALSE(parse_haply_setting(R"({"ok": false})"));
}

TEST_CASE("A device that its service calls without power, not calibrated or not ready is off") {
  const auto cause_of = [](const json& status) {
    json said = message();
    said["inverse3"][0]["status"] = status;
    const char* const cause = parse_haply_state(said.dump(), kBoth).handle.force_off;
    return std::string(cause != nullptr ? cause : "");
  };
  CHECK(cause_of({{"power_supply", true}, {"calibrated", true}, {"ready", true}}).empty());
  CHECK(cause_of({{"power_supply", false}}) == "its power supply is off");
  CHECK_THAT(cause_of({{"calibrated", false}}), ContainsSubstring("not calibrated"));
  CHECK_THAT(cause_of({{"ready", false}}), ContainsSubstring("not ready"));
  CHECK(cause_of(json::object()).empty());
  CHECK(cause_of("fine").empty());
}

TEST_CASE("An event names itself, its device and what was triggered") {
  const HaplyEvent event = parse_haply_event(R"({"name": "device-safety-triggered",
    "category": "device", "level": "error", "message": "Emergency brake engaged",
    "data": {"device_family": "inverse", "device_id": "049D", "safety_type": "ebrake_triggered"}})");
  CHECK(event.name == "device-safety-triggered");
  CHECK(event.device == "049D");
  CHECK(event.safety == "ebrake_triggered");
  CHECK(event.text == "Emergency brake engaged");
  CHECK(parse_haply_event(R"({"name": 1, "data": []})").name.empty());
}

TEST_CASE("An address is also that of a WebSocket, as the service's documents print it") {
  CHECK(host_and_port("localhost:10001") == "localhost:10001");
  CHECK(host_and_port("ws://localhost:10001") == "localhost:10001");
  CHECK(host_and_port("ws://127.0.0.1:7/") == "127.0.0.1:7");
}

TEST_CASE("What is wrong in a message is named with its value") {
  json bad = message();
  auto& state = bad["inverse3"][0]["state"];
  SECTION("a field that is missing") {
    state["cursor_velocity"].erase("y");
    CHECK_THAT(error_of(bad), ContainsSubstring("has no inverse3[].state.cursor_velocity.y"));
  }
  SECTION("a number that is none") {
    state["cursor_position"]["z"] = std::nan("");  // JSON has no such number: null.
    CHECK_THAT(error_of(bad), ContainsSubstring("cursor_position.z null, must be a number"));
  }
  SECTION("a vector that is a text") {
    state["cursor_position"] = "here";
    CHECK_THAT(error_of(bad), ContainsSubstring("has no inverse3[].state.cursor_position.x"));
  }
  SECTION("a device that went") {
    bad["inverse3"].erase(0);
    CHECK_THAT(error_of(bad),
               ContainsSubstring("inverse3 '049D' no more") && ContainsSubstring("unplugged"));
  }
  SECTION("a grip that went") {
    bad.erase("wireless_verse_grip");
    CHECK_THAT(error_of(bad), ContainsSubstring("wireless_verse_grip '61548' no more"));
  }
  SECTION("an orientation that is no rotation") {
    bad["wireless_verse_grip"][0]["state"]["orientation"]["w"] = 2.0;
    CHECK_THAT(error_of(bad), ContainsSubstring("orientation of length 2.15"));
  }
  SECTION("devices that are no list") {
    bad["inverse3"] = 3;
    CHECK_THAT(error_of(bad), ContainsSubstring("inverse3 that is no list"));
  }
  SECTION("an error of the service") {
    CHECK_THAT(error_of({{"error", "device lost"}}), ContainsSubstring("\"device lost\""));
  }
}

TEST_CASE("What is no JSON, or beyond every number, is refused in one line") {
  for (const char* text : {"", "{", "[1, 2]", "\xff\xfe", "{\"inverse3\": 1e999}", "null\nnull"}) {
    INFO(text);
    CHECK_THROWS_WITH(
        parse_haply_state(text, kBoth),
        ContainsSubstring("the Inverse Service's message") && !ContainsSubstring("\n"));
  }
}

TEST_CASE("An inventory of something else is refused, and what it does not say is empty") {
  for (const char* text :
       {R"({"inverse3": [1]})", R"({"inverse3": [[]]})", R"({"inverse3": [null]})",
        R"({"wireless_verse_grip": ["a"]})", R"({"verse_grip": [{"device_id": 3}]})",
        R"({"inverse3": [{"device_id": "A\nB"}]})"}) {
    INFO(text);
    CHECK_THROWS_WITH(parse_haply_inventory(text), ContainsSubstring("[].device_id"));
  }
  const json long_id{{"inverse3", {{{"device_id", std::string(101, 'A')}}}}};
  CHECK_THROWS_WITH(parse_haply_inventory(long_id.dump()), ContainsSubstring("100 bytes at most"));
  for (const char* config : {"1", "[]", "null", "\"left\"", R"({"handedness": 1})"}) {
    INFO(config);
    const std::string text =
        std::string(R"({"inverse3": [{"device_id": "A", "config": )") + config + "}]}";
    CHECK(parse_haply_inventory(text).devices.at(0).handedness.empty());
  }
}

TEST_CASE("A message that is nested deeply is refused, and overflows no stack") {
  constexpr std::size_t kDepth = 120'000;
  const std::string text =
      R"({"error": )" + std::string(kDepth, '[') + std::string(kDepth, ']') + "}";
  CHECK_THROWS_WITH(parse_haply_state(text, kBoth), ContainsSubstring("nested"));
  CHECK_THROWS_WITH(parse_haply_inventory(text), ContainsSubstring("nested"));
}

TEST_CASE("A request holds the force under the field's name, bit for bit") {
  const json request = json::parse(haply_force_request({"049D"}, "vector", {0.1, -2.5, 1e-17}));
  const json& force = request["inverse3"][0]["commands"]["set_cursor_force"]["vector"];
  CHECK(request["inverse3"][0]["device_id"] == "049D");
  CHECK(force["x"].get<double>() == 0.1);
  CHECK(force["y"].get<double>() == -2.5);
  CHECK(force["z"].get<double>() == 1e-17);
  CHECK_THAT(haply_force_request({"049D"}, "values", Vector3::Zero()),
             ContainsSubstring("\"values\""));
}

TEST_CASE("A request without a force probes device and grip") {
  const json request = json::parse(haply_probe_request(kBoth));
  CHECK(request["inverse3"][0]["device_id"] == "049D");
  CHECK(request["inverse3"][0]["commands"]["probe_position"] == json::object());
  CHECK(request["wireless_verse_grip"][0]["commands"]["probe_orientation"] == json::object());
  CHECK_FALSE(json::parse(haply_probe_request({"049D"})).contains("verse_grip"));
}

TEST_CASE("A device is chosen by its id, or as the only one, and another handedness is refused") {
  const HaplyInventory two{{{"A", "left"}, {"B", "right"}}, {{"G", "verse_grip"}}};
  CHECK_THROWS_WITH(choose(two, {}), ContainsSubstring("several Inverse3s: A, B"));
  CHECK_THROWS_WITH(choose(two, {.device = "C"}),
                    ContainsSubstring("no Inverse3 'C'") && ContainsSubstring("there are: A, B"));
  CHECK(choose(two, {.device = "B"}).grip == "G");
  CHECK(choose(two, {.device = "B"}).grip_kind == "verse_grip");
  CHECK(choose(two, {.device = "B", .grip = "none"}).grip.empty());
  CHECK(choose(two, {.device = "B", .handedness = "right"}).device == "B");
  CHECK_THROWS_WITH(choose(two, {.device = "B", .handedness = "left"}),
                    ContainsSubstring("'right', must be 'left'"));
  const HaplyInventory one{{{"A", ""}}, {}};
  CHECK(choose(one, {}).device == "A");
  CHECK(choose(one, {}).grip.empty());
  CHECK_THROWS_WITH(choose({}, {}), ContainsSubstring("plug it in"));
}

TEST_CASE("A choice that is made again takes no other device, and no other grip") {
  const HaplyInventory both{{{"A", ""}}, {{"G", "verse_grip"}}};
  const HaplyInventory alone{{{"A", ""}}, {}};
  const HaplyInventory others{{{"B", ""}}, {{"H", "verse_grip"}}};
  const InverseServiceOptions with_grip = choosing(choose(both, {}), {});
  CHECK(choose(both, with_grip).grip == "G");
  CHECK_THROWS_WITH(choose(others, with_grip), ContainsSubstring("no Inverse3 'A'"));
  CHECK_THROWS_WITH(choose(alone, with_grip), ContainsSubstring("no grip 'G'"));
  CHECK(choose(both, choosing(choose(alone, {}), {})).grip.empty());
}

}  // namespace
}  // namespace hlm::server
