#include "hlm/common/tool_description.h"

#include <limits>

#include "hlm/common/joint_drive.h"
#include "tests/support/catch.h"
#include "tests/support/random_tool.h"

namespace hlm {
namespace {

using Catch::Matchers::ContainsSubstring;

/// The message for a valid two-link tool after `change`.
template <class Change>
std::string error_after(Change change) {
  test::Random random;
  ToolDescription tool = test::random_tool(random, 2, JointType::kFree);
  REQUIRE(find_error(tool) == std::nullopt);
  change(tool);
  return find_error(tool).value_or("valid");
}

TEST_CASE("A bad tool is refused with the link and what is allowed") {
  using T = ToolDescription;
  CHECK_THAT(error_after([](T& t) { t.links.clear(); }), ContainsSubstring("at least one link"));
  CHECK_THAT(error_after([](T& t) { t.links[1].parent = 1; }),
             ContainsSubstring("link 1: parent 1 must be 0 to 0"));
  CHECK_THAT(error_after([](T& t) { t.links[0].parent = 0; }), ContainsSubstring("root's parent"));
  CHECK_THAT(error_after([](T& t) { t.links[1].joint = JointType::kFree; }),
             ContainsSubstring("only the root"));
  CHECK_THAT(error_after([](T& t) { t.links[1].joint = static_cast<JointType>(9); }),
             ContainsSubstring("joint type 9 must be 0 to 6"));
  CHECK_THAT(error_after([](T& t) { t.links[1].axis *= 2; }), ContainsSubstring("axis"));
  CHECK_THAT(error_after([](T& t) { t.links[1].lower = std::nan(""); }),
             ContainsSubstring("link 1: lower limit"));
  CHECK_THAT(error_after([](T& t) {
               t.links[1].lower = 1;
               t.links[1].upper = 0.5;
             }),
             ContainsSubstring("upper limit") && ContainsSubstring("1 to"));
  CHECK_THAT(error_after([](T& t) { t.links[0].mass = -1; }), ContainsSubstring("mass"));
  CHECK_THAT(error_after([](T& t) { t.links[0].I_LCom *= -1; }), ContainsSubstring("negative"));
  CHECK_THAT(error_after([](T& t) { t.links[0].I_LCom(0, 1) += 1; }),
             ContainsSubstring("symmetric"));
  CHECK_THAT(error_after([](T& t) { t.links[0].X_PJ.R.w() += 1; }), ContainsSubstring("length 1"));
  CHECK_THAT(error_after([](T& t) { t.hand_link = 2; }), ContainsSubstring("hand link 2"));
  CHECK_THAT(error_after([](T& t) { t.length = 0; }), ContainsSubstring("length"));
  CHECK_THAT(error_after([](T& t) { t.gravity_W.x() = std::numeric_limits<double>::infinity(); }),
             ContainsSubstring("gravity"));
  CHECK_THAT(error_after([](T& t) {
               t.links[1].mass = 0;
               t.links[1].I_LCom.setZero();
             }),
             ContainsSubstring("moves too little: mass 0 kg"));
}

TEST_CASE("A bad curve is refused with its link, its value and what is allowed") {
  const auto error_with = [](auto change) {
    return error_after([&](ToolDescription& tool) {
      test::Random random;
      tool = test::guided(random, test::random_tool(random, 3, JointType::kFree));
      REQUIRE(find_error(tool) == std::nullopt);
      change(tool);
    });
  };
  using T = ToolDescription;
  CHECK_THAT(error_with([](T& t) { t.curves[0].link = 0; }),
             ContainsSubstring("link 0 of a curve"));
  CHECK_THAT(error_with([](T& t) { t.curves[0].link = 9; }),
             ContainsSubstring("link 9 of a curve"));
  CHECK_THAT(error_with([](T& t) { t.curves[0].leader = 2; }),
             ContainsSubstring("must be its own leader"));
  CHECK_THAT(error_with([](T& t) { t.curves.clear(); }),
             ContainsSubstring("link 1 must have a curve"));
  CHECK_THAT(error_with([](T& t) { t.curves.push_back(t.curves[0]); }),
             ContainsSubstring("link 1 must have one curve, not two"));
  CHECK_THAT(error_with([](T& t) { t.curves[0].terms(0, 3) = std::nan(""); }),
             ContainsSubstring("curve of link 1: terms must be finite"));
  CHECK_THAT(error_with([](T& t) { t.curves[0].armature = -1; }), ContainsSubstring("armature -1"));
  CHECK_THAT(error_with([](T& t) { t.curves[0].terms.bottomRows<4>().setZero(); }),
             ContainsSubstring("quaternion"));
  CHECK_THAT(error_with([](T& t) {
               t.curves[0].terms.bottomRows<4>().setZero();
               t.curves[0].terms(3, 0) = -0.3125;
               t.curves[0].terms(3, 1) = 9.6;
             }),
             ContainsSubstring("quaternion"));
  CHECK_THAT(error_with([](T& t) { t.links[1].upper = t.links[1].lower; }),
             ContainsSubstring("upper limit"));
  CHECK_THAT(error_with([](T& t) {
               for (JointCurve& curve : t.curves) {
                 curve.armature = 0;
                 t.links[curve.link].mass = 0;
               }
             }),
             ContainsSubstring("what it leads must have a mass"));
}

TEST_CASE("A bad drive is refused with its link, its value and what is allowed") {
  test::Random random;
  const ToolDescription tool = test::guided(random, test::random_tool(random, 3, JointType::kFree));
  const JointDrive good{.link = 1, .open = 0.04, .stiffness = 1000, .damping = 1, .most = 20};
  const auto error_with = [&](auto change) -> std::string {
    JointDrives drives{good};
    change(drives);
    return find_error(drives, tool).value_or("valid");
  };
  using D = JointDrives;
  CHECK(error_with([](D&) {}) == "valid");
  CHECK_THAT(error_with([](D& d) { d[0].link = 0; }),
             ContainsSubstring("link 0: its joint must be"));
  CHECK_THAT(error_with([](D& d) { d[0].link = 3; }),
             ContainsSubstring("link 3: its joint must be"));
  CHECK_THAT(error_with([](D& d) { d.push_back(d[0]); }), ContainsSubstring("one, not two"));
  CHECK_THAT(error_with([](D& d) { d[0].target = 1e5; }), ContainsSubstring("target 100000"));
  CHECK_THAT(error_with([](D& d) { d[0].stiffness = -1; }), ContainsSubstring("stiffness -1"));
  CHECK_THAT(error_with([](D& d) { d[0].most = std::nan(""); }),
             ContainsSubstring("largest force"));
}

/// The message for a tool of one link of 1 kg, 0.1 m from its joint, with these moments of inertia.
std::string error_of(JointType joint, const Vector3& moments) {
  ToolDescription tool;
  Link link;
  link.joint = joint;
  link.p_LCom = {0.1, 0, 0};
  link.I_LCom = moments.asDiagonal();
  tool.links.push_back(link);
  return find_error(tool).value_or("valid");
}

TEST_CASE("A tool must have inertia about each axis about which it turns") {
  for (const double little : {0.0, 1e-13, -1e-18}) {  // kg·m²
    CAPTURE(little);
    CHECK_THAT(error_of(JointType::kPlanar, {1, 1, little}),
               ContainsSubstring("link 0: its joint turns too little: inertia ") &&
                   ContainsSubstring("kg·m² must be at least 1e-12 kg·m²"));
    for (const Vector3& moments : {Vector3(1, 1, little), Vector3(little, 1, 1)}) {
      CHECK_THAT(error_of(JointType::kFree, moments), ContainsSubstring("turns too little"));
    }
  }
  CHECK(error_of(JointType::kPlanar, {0, 0, 1e-3}) == "valid");
  CHECK(error_of(JointType::kRevolute, {0, 0, 0}) == "valid");  // 1 kg goes round at 0.1 m
  CHECK(error_of(JointType::kPrismatic, {0, 0, 0}) == "valid");
}

TEST_CASE("What is fixed to a link turns with it") {
  ToolDescription tool;
  for (const int parent : {-1, 0}) {
    Link link;
    link.parent = parent;
    link.joint = parent < 0 ? JointType::kPlanar : JointType::kFixed;
    link.I_LCom.setZero();
    tool.links.push_back(link);
  }
  CHECK_THAT(find_error(tool).value_or("valid"), ContainsSubstring("turns too little"));
  tool.links[1].X_PJ.p = {0.1, 0, 0};
  CHECK(find_error(tool).value_or("valid") == "valid");
}

TEST_CASE("Degrees of freedom are limited") {
  test::Random random;
  CHECK(find_error(test::random_tool(random, 11, JointType::kFree)) == std::nullopt);
  CHECK_THAT(find_error(test::random_tool(random, 12, JointType::kFree)).value(),
             ContainsSubstring("degrees of freedom 17 must be 1 to 16"));
  CHECK_THAT(find_error(test::random_tool(random, 1, JointType::kFixed)).value(),
             ContainsSubstring("degrees of freedom 0"));
}

}  // namespace
}  // namespace hlm
