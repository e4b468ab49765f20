// What pages ask for: taken, or refused with what is allowed.
#include "hlm/page/page_requests.h"

#include "hlm/page/methods.h"
#include "tests/support/catch.h"

namespace hlm::ve {
namespace {

using Catch::Matchers::ContainsSubstring;

template <class Request>
Request parsed(const std::string& text, const LiveSettings& present = {},
               const WorldTraits& tool = {}) {
  const ParsedRequest request = parse_request(text, present, tool);
  REQUIRE(std::holds_alternative<Request>(request));
  return std::get<Request>(request);
}

TEST_CASE("A hand is held at a target and let go") {
  const auto hand =
      parsed<HandRequest>(R"({"type":"hand","hold":true,"target":[0.1,-0.2,0,1,0,0,0]})");
  REQUIRE(hand.X_WTarget);
  CHECK((hand.X_WTarget->p - Vector3(0.1, -0.2, 0)).norm() < 1e-15);
  CHECK_FALSE(hand.grab);
  CHECK(parsed<HandRequest>(R"({"type":"hand","hold":true,"grab":true,"target":[0,0,0,1,0,0,0]})")
            .grab);
  CHECK_FALSE(parsed<HandRequest>(R"({"type":"hand","hold":false})").X_WTarget);
}

TEST_CASE("Settings change what they name, and leave the rest") {
  LiveSettings present;
  present.tuning.damping = 77;
  const auto settings =
      parsed<SettingsRequest>(R"({"type":"settings","stiffness":8000,"controller":"direct"})",
                              present)
          .settings;
  CHECK(settings.tuning.stiffness == 8000);
  CHECK(settings.tuning.damping == 77);
  CHECK(settings.tuning.controller == ControllerKind::kDirect);

  const auto environment =
      parsed<SettingsRequest>(R"({"type":"environment","loss":0.25,"epsilon":0.01})", present);
  CHECK(environment.settings.network.loss == 0.25);
  CHECK(environment.settings.frame.epsilon == 0.01);
  CHECK(environment.settings.tuning.damping == 77);
}

TEST_CASE("A method sets rule, controller and ε together") {
  const auto ir = parsed<SettingsRequest>(R"({"type":"method","name":"ir"})").settings;
  CHECK(ir.tuning.update_rule == UpdateRule::kIntermediateRepresentation);
  CHECK(ir.tuning.controller == ControllerKind::kDirect);
  CHECK(ir.frame.epsilon == 0);
  CHECK_FALSE(ir.frame.shapes);
  const auto shapes = parsed<SettingsRequest>(R"({"type":"method","name":"shapes"})").settings;
  CHECK(shapes.frame.shapes);
}

TEST_CASE("Each method is recognised by what it sets, and by nothing else") {
  for (const Method& method : kMethods) {
    if (!method.on_page) continue;
    LiveSettings settings = with_method(method, {});
    CHECK(method_in_effect(settings) == &method);
    if (method.shapes) {
      settings.frame.shapes = false;
    } else {
      settings.frame.epsilon += 1e-3;
    }
    CHECK(method_in_effect(settings) != &method);
  }
}

TEST_CASE("What a page changed stays changed when the server is another one, and nothing else") {
  Tuning changed;
  changed.damping = 77;
  Tuning other;
  other.stiffness = 15000;
  other.controller = ControllerKind::kThreeChannel;
  const Tuning carried = carried_over(changed, {}, other);
  CHECK(carried.damping == 77);
  CHECK(carried.stiffness == 15000);
  CHECK(carried.controller == ControllerKind::kThreeChannel);
}

TEST_CASE("A tool of several links is refused what puts the device in its place") {
  const WorldTraits linkage{.links = 3, .starts = {}, .scenes = {}};
  for (const std::string name : {"ir", "coupler", "engine"}) {
    const auto refusal =
        parsed<Refusal>(R"({"type":"method","name":")" + name + R"("})", {}, linkage);
    CHECK(refusal.field == "name");
    CHECK_THAT(refusal.text, ContainsSubstring("must be lm0, lm5, shapes: the tool has several"));
  }
  const auto refusal = parsed<Refusal>(R"({"type":"settings","controller":"direct"})", {}, linkage);
  CHECK_THAT(refusal.text,
             ContainsSubstring("must be four_channel, three_channel, virtual_coupler: the"));
  parsed<SettingsRequest>(R"({"type":"method","name":"lm0"})", {}, linkage);
}

TEST_CASE("A reset is from where the tool began last, or from a start that it has") {
  const WorldTraits peg{.links = 1, .starts = {"hole", "corner"}, .scenes = {}};
  CHECK_FALSE(parsed<ResetRequest>(R"({"type":"reset"})", {}, peg).start);
  CHECK(parsed<ResetRequest>(R"({"type":"reset","start":"corner"})", {}, peg).start == "corner");
  CHECK(parsed<ResetRequest>(R"({"type":"reset","start":""})", {}, peg).start == "");
  const auto refusal = parsed<Refusal>(R"({"type":"reset","start":"moon"})", {}, peg);
  CHECK_THAT(refusal.text, ContainsSubstring("\"moon\" must be empty, hole, corner"));
  CHECK(parsed<Refusal>(R"({"type":"reset","start":7})", {}, peg).field == "start");
}

TEST_CASE("A scene is one of the menu, and nothing else is a way to a file") {
  const WorldTraits world{.links = 1, .starts = {}, .scenes = {"door", "push"}};
  CHECK(parsed<SceneRequest>(R"({"type":"scene","name":"push"})", {}, world).name == "push");
  const std::string name = GENERATE("\"moon\"", "\"../worlds/push\"", "\"push.sdf\"",
                                    "\"/etc/passwd\"", "\"\"", "7", "null");
  const auto refusal = parsed<Refusal>(R"({"type":"scene","name":)" + name + "}", {}, world);
  CHECK(refusal.field == "scene");
  CHECK(refusal.text == "scene " + name + " must be door, push");
}

TEST_CASE("What cannot be done is refused with the field, its value and what is allowed") {
  const auto [text, field, allowed] = GENERATE(table<std::string, std::string, std::string>({
      {R"({"type":"settings","stiffness":-1})", "stiffness", "-1 must be 1 to 1000000 N/m"},
      {R"({"type":"settings","stiffness":"soft"})", "stiffness", "must be 1 to"},
      {R"({"type":"settings","controller":"magic"})", "controller", "four_channel, three_channel"},
      {R"({"type":"settings","colour":1})", "colour", "one of the settings"},
      {R"({"type":"environment","loss":1})", "loss", "0 to 0.5"},
      {R"({"type":"hand","hold":true})", "target", "7 numbers"},
      {R"({"type":"hand","hold":true,"target":[0,0,0,1,1,0,0]})", "target", "unit quaternion"},
      {R"({"type":"hand","hold":true,"target":[1e9,0,0,1,0,0,0]})", "target", "within 10 m"},
      {R"({"type":"hand","hold":7})", "hold", "true or false"},
      {R"({"type":"hand","hold":true,"grab":1,"target":[0,0,0,1,0,0,0]})", "grab", "true or false"},
      {R"({"type":"method","name":"x"})", "name", "lm5, shapes"},
      {R"({"type":"dance"})", "type", "hand, settings"},
      {"[]", "type", "hand, settings"},
      {"{", "", "must be JSON"},
      {"\xff", "", "must be JSON"},
  }));
  INFO(text);
  const auto refusal = parsed<Refusal>(text);
  CHECK(refusal.field == field);
  CHECK_THAT(refusal.text, ContainsSubstring(allowed));
}

}  // namespace
}  // namespace hlm::ve
