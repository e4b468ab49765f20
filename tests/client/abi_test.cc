// The C interface is what its number promises: a program that was compiled with HAPTIC_ABI n finds
// its structures as they were. Who changes one raises the number and writes the new layout here.
#include <cstddef>
#include <cstring>
#include <map>
#include <sstream>
#include <string>

#include <haptic.h>

#include "tests/support/catch.h"

namespace {

std::string layout() {
  std::ostringstream text;
#define STRUCT(name) text << "\n" #name << ' ' << sizeof(haptic_##name) << ':'
#define FIELD(name, field) text << ' ' << #field << ' ' << offsetof(haptic_##name, field)
  STRUCT(link);
  FIELD(link, parent), FIELD(link, joint), FIELD(link, position), FIELD(link, rotation);
  FIELD(link, axis), FIELD(link, mass), FIELD(link, centre), FIELD(link, inertia);
  FIELD(link, lower), FIELD(link, upper);
  STRUCT(options);
  FIELD(options, server), FIELD(options, key_file), FIELD(options, links);
  FIELD(options, link_count), FIELD(options, hand_link), FIELD(options, hand_position);
  FIELD(options, hand_rotation), FIELD(options, gravity), FIELD(options, length);
  FIELD(options, q), FIELD(options, rate), FIELD(options, epsilon), FIELD(options, clears_fault),
      FIELD(options, made_of_defaults);
  FIELD(options, curves), FIELD(options, curve_count);
  STRUCT(curve);
  FIELD(curve, link), FIELD(curve, leader), FIELD(curve, armature), FIELD(curve, terms);
  STRUCT(drive);
  FIELD(drive, link), FIELD(drive, follows_device), FIELD(drive, target), FIELD(drive, closed);
  FIELD(drive, open), FIELD(drive, stiffness), FIELD(drive, damping), FIELD(drive, most);
  STRUCT(contact);
  FIELD(contact, identity), FIELD(contact, pair), FIELD(contact, axis), FIELD(contact, a_kind);
  FIELD(contact, b_kind), FIELD(contact, a_index), FIELD(contact, b_index), FIELD(contact, point);
  FIELD(contact, normal), FIELD(contact, separation), FIELD(contact, velocity);
  FIELD(contact, friction), FIELD(contact, load), FIELD(contact, plane);
  STRUCT(body);
  FIELD(body, id), FIELD(body, round), FIELD(body, centre), FIELD(body, velocity);
  FIELD(body, inverse_inertia), FIELD(body, acceleration), FIELD(body, axis);
  STRUCT(impulse);
  FIELD(impulse, body), FIELD(impulse, reserved), FIELD(impulse, impulse);
  STRUCT(state);
  FIELD(state, connected), FIELD(state, began), FIELD(state, lost), FIELD(state, fresh);
  FIELD(state, step), FIELD(state, acknowledged), FIELD(state, q_count), FIELD(state, v_count);
  FIELD(state, q), FIELD(state, v), FIELD(state, contact_wrench), FIELD(state, command);
  FIELD(state, device_position), FIELD(state, device_rotation), FIELD(state, server);
  FIELD(state, active), FIELD(state, predicted), FIELD(state, buttons), FIELD(state, scene);
  FIELD(state, holds), FIELD(state, gripper), FIELD(state, grip);
  FIELD(state, round_trip), FIELD(state, servo_rate), FIELD(state, message);
  STRUCT(shape);
  FIELD(shape, kind), FIELD(shape, side), FIELD(shape, index), FIELD(shape, group);
  FIELD(shape, mask), FIELD(shape, vertex_count), FIELD(shape, size), FIELD(shape, vertices);
  FIELD(shape, triangles), FIELD(shape, triangle_count);
  STRUCT(pose);
  FIELD(pose, position), FIELD(pose, rotation);
  STRUCT(material);
  FIELD(material, friction), FIELD(material, rule), FIELD(material, priority);
  STRUCT(body_pose);
  FIELD(body_pose, body), FIELD(body_pose, kept), FIELD(body_pose, pose);
  FIELD(body_pose, velocity);
  STRUCT(dynamics);
  FIELD(dynamics, body), FIELD(dynamics, joint), FIELD(dynamics, mass), FIELD(dynamics, centre);
  FIELD(dynamics, inertia), FIELD(dynamics, gravity), FIELD(dynamics, damping);
  FIELD(dynamics, angular_damping), FIELD(dynamics, parent), FIELD(dynamics, reserved);
  FIELD(dynamics, in_parent), FIELD(dynamics, in_body), FIELD(dynamics, axis);
  FIELD(dynamics, lower), FIELD(dynamics, upper), FIELD(dynamics, stiffness);
  FIELD(dynamics, reference), FIELD(dynamics, joint_damping), FIELD(dynamics, friction);
  FIELD(dynamics, armature);
  STRUCT(held_body);
  FIELD(held_body, body), FIELD(held_body, let_go), FIELD(held_body, pose);
  FIELD(held_body, velocity), FIELD(held_body, q), FIELD(held_body, v);
#undef STRUCT
#undef FIELD
  return text.str();
}

/// Sizes and offsets in bytes, by HAPTIC_ABI, on a machine of 64 bits.
const std::map<int, std::string> kLayouts{{5, R"(
link 208: parent 0 joint 4 position 8 rotation 32 axis 64 mass 88 centre 96 inertia 120 lower 192 upper 200
options 304: server 0 key_file 8 links 16 link_count 24 hand_link 32 hand_position 40 hand_rotation 64 gravity 96 length 120 q 128 rate 264 epsilon 272 clears_fault 280 made_of_defaults 284 curves 288 curve_count 296
curve 576: link 0 leader 4 armature 8 terms 16
drive 56: link 0 follows_device 4 target 8 closed 16 open 24 stiffness 32 damping 40 most 48
contact 128: identity 0 pair 8 axis 12 a_kind 14 b_kind 15 a_index 16 b_index 20 point 24 normal 48 separation 72 velocity 80 friction 104 load 112 plane 120
body 440: id 0 round 4 centre 8 velocity 32 inverse_inertia 80 acceleration 368 axis 416
impulse 56: body 0 reserved 4 impulse 8
state 752: connected 0 began 4 lost 8 fresh 12 step 16 acknowledged 24 q_count 32 v_count 36 q 40 v 176 contact_wrench 304 command 352 device_position 400 device_rotation 424 server 456 active 460 predicted 464 buttons 468 scene 472 holds 476 gripper 480 grip 488 round_trip 496 servo_rate 504 message 512
shape 72: kind 0 side 4 index 8 group 12 mask 16 vertex_count 20 size 24 vertices 48 triangles 56 triangle_count 64
pose 56: position 0 rotation 24
material 16: friction 0 rule 8 priority 12
body_pose 112: body 0 kept 4 pose 8 velocity 64
dynamics 352: body 0 joint 4 mass 8 centre 16 inertia 40 gravity 112 damping 136 angular_damping 144 parent 152 reserved 156 in_parent 160 in_body 216 axis 272 lower 296 upper 304 stiffness 312 reference 320 joint_damping 328 friction 336 armature 344
held_body 128: body 0 let_go 4 pose 8 velocity 64 q 112 v 120)"}};

TEST_CASE("Structures of the C interface are those of its number, HAPTIC_ABI") {
  REQUIRE(kLayouts.count(HAPTIC_ABI) == 1);
  INFO("a changed structure needs another HAPTIC_ABI, and its layout here");
  CHECK(layout() == kLayouts.at(HAPTIC_ABI));
  CHECK(haptic_abi() == HAPTIC_ABI);
}

TEST_CASE("Options that were not begun with the defaults are refused, whatever is in them") {
  haptic_options options;
  std::memset(&options, 0xa5, sizeof options);  // As a stack may be: no pointer is one.
  char error[HAPTIC_MAX_TEXT] = "";
  CHECK(haptic_open(&options, error, sizeof error) == nullptr);
  CHECK_THAT(error, Catch::Contains("must be begun with haptic_default_options()"));

  options = {};
  CHECK(haptic_open(&options, error, sizeof error) == nullptr);
  CHECK_THAT(error, Catch::Contains("must be begun with haptic_default_options()"));
}

}  // namespace
