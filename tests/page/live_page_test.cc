// Who holds the hand, and what a reset brings back: pages over real sockets on loopback.
#include "hlm/page/live_page.h"

#include <chrono>
#include <functional>
#include <thread>

#include "hlm/ve_client/run/world_view.h"
#include "tests/page/page_client.h"
#include "tests/page/web_root.h"
#include "tests/support/catch.h"

namespace hlm::ve {
namespace {

using Catch::Matchers::ContainsSubstring;
using test::PageClient;

constexpr const char* kGrab =
    R"({"type":"hand","hold":true,"grab":true,"target":[0.1,0,0,1,0,0,0]})";
constexpr const char* kGoOn = R"({"type":"hand","hold":true,"target":[0.2,0,0,1,0,0,0]})";

struct Desk {
  static PageServerOptions options(const test::WebRoot& root) {
    root.write("index.html", "<!doctype html>");
    return {.port = 0, .root = root.path()};
  }

  bool held() const { return page.control(settings, {}).holds; }

  /// Takes requests at time `now` until it holds.
  bool soon(const std::function<bool()>& condition) {
    const auto end = std::chrono::steady_clock::now() + test::kPatience;
    while (std::chrono::steady_clock::now() < end) {
      if (const auto wanted = page.take_requests(now, settings, {})) reset = wanted;
      if (condition()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  }

  test::WebRoot root;
  LivePage page{options(root)};
  LiveSettings settings;
  std::optional<ResetRequest> reset;
  double now = 10;
};

TEST_CASE("A page holds the hand until it lets go, or is silent about it for a second") {
  Desk desk;
  PageClient browser(desk.page.port());
  browser.send(kGrab);
  REQUIRE(desk.soon([&] { return desk.held(); }));
  CHECK(desk.page.control(desk.settings, {}).X_WTarget.p == Vector3(0.1, 0, 0));
  browser.send(R"({"type":"hand","hold":false})");
  REQUIRE(desk.soon([&] { return !desk.held(); }));

  browser.send(kGrab);
  REQUIRE(desk.soon([&] { return desk.held(); }));
  desk.now += 0.9;
  desk.page.take_requests(desk.now, desk.settings, {});
  CHECK(desk.held());
  desk.now += 0.2;
  desk.page.take_requests(desk.now, desk.settings, {});
  CHECK_FALSE(desk.held());
}

PageWorld world_of_a_brick() {
  PageWorld world;
  world.bodies = {
      {.name = "table", .fixed = true}, {.name = "tool", .is_tool = true}, {.name = "brick"}};
  world.tool.description.links.emplace_back();
  world.tool.q = (Configuration(7) << 0, 0, 0, 1, 0, 0, 0).finished();
  return world;
}

TEST_CASE("One page pulls a body, until it lets go, is silent for a second, or is gone") {
  Desk desk;
  desk.page.show_world(world_of_a_brick());
  const char* const pull =
      R"({"type":"pull","hold":true,"body":2,"point":[0,0,0.01],"target":[0.1,0,0]})";
  PageClient other(desk.page.port());
  REQUIRE(other.read());  // the world
  {
    PageClient browser(desk.page.port());
    browser.send(pull);
    REQUIRE(desk.soon([&] { return desk.page.pull().has_value(); }));
    CHECK(desk.page.pull()->body == 2);
    CHECK(desk.page.pull()->p_B == Vector3(0, 0, 0.01));
    CHECK(desk.page.pull()->target_W == Vector3(0.1, 0, 0));
    other.send(pull);
    other.send(R"({"type":"step"})");
    REQUIRE(desk.soon([&] { return desk.page.take_steps() == 1; }));
    CHECK_THAT(other.text(), ContainsSubstring("another page pulls a body"));
    browser.send(R"({"type":"pull","hold":false})");
    REQUIRE(desk.soon([&] { return !desk.page.pull(); }));
    browser.send(pull);
    REQUIRE(desk.soon([&] { return desk.page.pull().has_value(); }));
    desk.now += 1.1;
    CHECK(desk.soon([&] { return !desk.page.pull(); }));
    browser.send(pull);
    REQUIRE(desk.soon([&] { return desk.page.pull().has_value(); }));
  }
  CHECK(desk.soon([&] { return !desk.page.pull(); }));
}

TEST_CASE("A page that is gone holds nothing") {
  Desk desk;
  {
    PageClient browser(desk.page.port());
    browser.send(kGrab);
    REQUIRE(desk.soon([&] { return desk.held(); }));
  }
  CHECK(desk.soon([&] { return !desk.held(); }));
}

TEST_CASE("A hold goes on only where it was begun, and ends with the session") {
  Desk desk;
  PageClient browser(desk.page.port());
  browser.send(kGoOn);
  browser.send(kGrab);
  REQUIRE(desk.soon([&] { return desk.held(); }));
  CHECK_THAT(browser.text(), ContainsSubstring("grab it again"));
  browser.send(kGoOn);
  REQUIRE(desk.soon(
      [&] { return desk.page.control(desk.settings, {}).X_WTarget.p == Vector3(0.2, 0, 0); }));

  desk.page.forget_session();
  CHECK_FALSE(desk.held());
  browser.send(kGoOn);
  browser.send(R"({"type":"settings","damping":50})");
  REQUIRE(desk.soon([&] { return desk.settings.tuning.damping == 50; }));
  CHECK_FALSE(desk.held());
  CHECK_THAT(browser.text(), ContainsSubstring("grab it again"));
  browser.send(kGrab);
  CHECK(desk.soon([&] { return desk.held(); }));
}

TEST_CASE("Of two pages the first has the hand, and the second learns it") {
  Desk desk;
  PageClient first(desk.page.port());
  PageClient second(desk.page.port());
  first.send(kGrab);
  REQUIRE(desk.soon([&] { return desk.held(); }));
  second.send(R"({"type":"hand","hold":true,"grab":true,"target":[-0.1,0,0,1,0,0,0]})");
  second.send(R"({"type":"hand","hold":false})");
  second.send(R"({"type":"settings","damping":50})");
  REQUIRE(desk.soon([&] { return desk.settings.tuning.damping == 50; }));
  CHECK_THAT(second.text(), ContainsSubstring("another page holds the hand"));
  CHECK(desk.held());
  CHECK(desk.page.control(desk.settings, {}).X_WTarget.p == Vector3(0.1, 0, 0));
}

TEST_CASE("A reset lets go and brings the settings back, what comes after it counts") {
  Desk desk;
  PageClient browser(desk.page.port());
  browser.send(kGrab);
  browser.send(R"({"type":"settings","stiffness":9000})");
  REQUIRE(desk.soon([&] { return desk.held() && desk.settings.tuning.stiffness == 9000; }));
  CHECK(desk.page.control(desk.settings, {}).tuned);
  browser.send(R"({"type":"reset"})");
  browser.send(R"({"type":"settings","damping":50})");
  REQUIRE(desk.soon([&] { return desk.settings.tuning.damping == 50; }));
  CHECK(desk.reset);
  CHECK(desk.settings.tuning.stiffness == Tuning{}.stiffness);
  CHECK_FALSE(desk.held());
}

TEST_CASE("Any page may choose a scene, the last choice counts, and only its page is answered") {
  Desk desk;
  Scene scene = load_scene(std::string(HLM_WORLDS) + "/push.sdf");
  const std::vector<SceneSummary> scenes = scenes_beside(scene.file);
  const VirtualEnvironment environment(scene.world, scene.tools, {});
  desk.page.show_world(page_world({environment, scene, scenes, "", nullptr}));
  PageClient first(desk.page.port());
  PageClient second(desk.page.port());
  for (PageClient* page : {&first, &second}) {
    CHECK_THAT(page->text(), ContainsSubstring(R"("scene":"push")"));
  }
  const auto chooses = [&](PageClient& page, const std::string& name) {
    page.send(R"({"type":"scene","name":")" + name + R"("})");
    page.send(R"({"type":"settings","damping":)" + std::to_string(name.size()) + "}");
    REQUIRE(desk.soon(
        [&] { return desk.settings.tuning.damping == static_cast<double>(name.size()); }));
  };
  chooses(first, "lift");
  chooses(second, "stack");
  const std::optional<SceneRequest> chosen = desk.page.take_scene();
  REQUIRE(chosen);
  CHECK(chosen->name == "stack");
  CHECK_FALSE(desk.page.take_scene());

  desk.page.refuse(*chosen, "stack.sdf: broken");
  CHECK_THAT(second.text(), ContainsSubstring("refused") && ContainsSubstring("stack.sdf: broken"));
  chooses(first, "moon");
  CHECK_FALSE(desk.page.take_scene());
  CHECK_THAT(first.text(), ContainsSubstring("must be " + scenes.front().name + ", "));
}

}  // namespace
}  // namespace hlm::ve
