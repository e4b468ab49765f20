// What a control changes of the servo's options, and which options are refused.
#include "hlm/haptic_server/loop/servo_options.h"

#include <limits>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

ServoOptions unusual() {
  ServoOptions options;
  options.controller = ControllerKind::kVirtualCoupler;
  options.local_model.update_rule = UpdateRule::kPaper;
  options.local_model.stiffness = 2500;
  options.local_model.damping = 12;
  options.local_model.static_friction = 0.6;
  options.local_model.kinetic_friction = 0.4;
  options.local_model.restitution = 0.25;
  options.gains = {.stiffness = 900, .damping = 9, .angular_stiffness = 2, .angular_damping = 0.2};
  return options;
}

TEST_CASE("A control with the tuning that the welcome reported changes nothing") {
  const Tuning reported = tuning_of(unusual());
  CHECK(tuning_of(tuned(unusual(), reported)) == reported);
  CHECK(tuned(unusual(), reported).local_model.static_friction == 0.6);
}

TEST_CASE("A rule or controller that this version does not know leaves the one in effect") {
  Tuning newer = tuning_of(unusual());
  newer.update_rule = static_cast<UpdateRule>(200);
  newer.controller = static_cast<ControllerKind>(200);
  newer.stiffness = 3000;
  const ServoOptions options = tuned(unusual(), newer);
  CHECK(options.local_model.update_rule == UpdateRule::kPaper);
  CHECK(options.controller == ControllerKind::kVirtualCoupler);
  CHECK(options.local_model.stiffness == 3000);
}

TEST_CASE("Every value of a tuning reaches the options") {
  const Tuning wanted{.update_rule = UpdateRule::kPlaneRecovery,
                      .controller = ControllerKind::kDirect,
                      .stiffness = 1,
                      .damping = 2,
                      .friction = 3,
                      .restitution = 0.4,
                      .coupling_stiffness = 5,
                      .coupling_damping = 6,
                      .coupling_angular_stiffness = 7,
                      .coupling_angular_damping = 8};
  CHECK(tuning_of(tuned(unusual(), wanted)) == wanted);
}

TEST_CASE("Changed friction is both static and kinetic") {
  Tuning tuning = tuning_of(unusual());
  tuning.friction = 0.1;
  const LocalModelParameters local = tuned(unusual(), tuning).local_model;
  CHECK(local.kinetic_friction == 0.1);
  CHECK(local.static_friction == 0.1);
}

TEST_CASE("Options that a control could not set are refused with the range") {
  ServoOptions options;
  options.gains.stiffness = 2e5;
  CHECK(find_error(options) == "coupling stiffness 200000 N/m must be 0 to 100000 N/m");
  options.gains.stiffness = 1500;
  options.local_model.kinetic_friction = 20;
  CHECK(find_error(options) == "kinetic friction 20 must be 0 to 10");
}

TEST_CASE("Limits and times that are not finite and positive are refused by name") {
  CHECK_FALSE(find_error(ServoOptions{}));
  const auto error = [](auto change) {
    ServoOptions options;
    change(options);
    return find_error(options);
  };
  CHECK(error([](auto& o) { o.limits.max_force = 0; }) == "force limit 0 N must be 0.01 to 1000 N");
  CHECK(error([](auto& o) { o.limits.max_torque = -1; }) ==
        "torque limit -1 N·m must be 0.0001 to 100 N·m");
  CHECK(error([](auto& o) { o.limits.fade_time = 0; }) == "fade time 0 s must be 0.001 to 10 s");
  CHECK(error([](auto& o) { o.silence_time = std::numeric_limits<double>::infinity(); }) ==
        "silence time inf s must be 0.01 to 10 s");
  CHECK(error([](auto& o) { o.max_gap = 0; }) == "max gap 0 s must be 0.001 to 60 s");
}

}  // namespace
}  // namespace hlm::server
