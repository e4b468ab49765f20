#include "experiments/body_tasks.h"

#include <string>
#include <utility>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "experiments/corners.h"
#include "tests/support/worlds.h"

namespace hlm::experiments {
namespace {

const std::string kDown = "0 0 -9.81";

std::string collision(const std::string& name, const Vector3& size, const Vector3& at,
                      double friction) {
  return fmt::format(
      "<collision name='{}'><pose>{} {} {} 0 0 0</pose><geometry><box><size>{} {} {}</size></box>"
      "</geometry><surface><friction><ode><mu>{}</mu></ode></friction></surface>"
      "</collision>",
      name, at.x(), at.y(), at.z(), size.x(), size.y(), size.z(), friction);
}

double moment(double mass, double a, double b) { return mass / 12 * (a * a + b * b); }

std::string body(const std::string& name, double mass, const Vector3& size, const Vector3& at,
                 double friction, const std::string& joint = "") {
  return fmt::format(
      "<model name='{}'><pose>{} {} {} 0 0 0</pose><link name='body'><inertial><mass>{}</mass>"
      "<inertia><ixx>{}</ixx><iyy>{}</iyy><izz>{}</izz></inertia></inertial>{}</link>{}</model>",
      name, at.x(), at.y(), at.z(), mass, moment(mass, size[1], size[2]),
      moment(mass, size[0], size[2]), moment(mass, size[0], size[1]),
      collision("box", size, Vector3::Zero(), friction), joint);
}

/// A block of 40 x 40 x 20 mm and 0.5 kg without weight.
std::string finger(const Vector3& at, double friction) {
  return fmt::format(
      "<model name='tool'><pose>{} {} {} 0 0 0</pose><link name='body'><gravity>false</gravity>"
      "<inertial><mass>0.5</mass><inertia><ixx>1e-3</ixx><iyy>1e-3</iyy><izz>1e-3</izz></inertia>"
      "</inertial>{}</link></model>",
      at.x(), at.y(), at.z(), collision("box", {0.04, 0.04, 0.02}, Vector3::Zero(), friction));
}

std::string fixed(const std::string& name, const std::string& collisions) {
  return "<model name='" + name + "'><static>true</static><link name='body'>" + collisions +
         "</link></model>";
}

std::string table(double friction, const std::string& more = "") {
  return fixed("table", collision("top", {2, 2, 0.1}, {0, 0, -0.05}, friction) + more);
}

server::Grip firm() {
  return {.stiffness = 1000,
          .damping = 40,
          .angular_stiffness = 20,
          .angular_damping = 0.5,
          .max_force = 100,
          .max_torque = 5};
}

server::HandSegment move(const Vector3& way, double duration) {
  server::Reach reach;
  reach.position = way;
  reach.relative = true;
  reach.grip = firm();
  return {duration, reach};
}

server::HandSegment force(const Vector3& F, double duration) {
  server::Push push;
  push.constant.head<3>() = F;
  return {duration, push};
}

server::HandScript script(std::vector<server::HandSegment> segments) {
  return {std::move(segments), server::AfterLastSegment::kHold};
}

BodyTask push(const Brick& brick, const server::HandSegment& hand, const std::string& more) {
  BodyTask task;
  task.world =
      test::world_of(table(brick.friction, more) +
                         body("body", brick.mass, {0.1, 0.1, 0.05}, {0, 0, 0.025}, brick.friction) +
                         finger({-0.073, brick.off_centre, 0.025}, brick.friction),
                     kDown);
  task.hand = script({force({0, 0, 0}, 0.5), hand});
  task.duration = 5;
  return task;
}

}  // namespace

BodyTask later(BodyTask task, double wait) {
  task.hand.segments.front().duration += wait;
  task.duration += wait;
  return task;
}

BodyTask lift(double mass) {
  const Vector3 rail(0.01, 0.1, 0.02);
  BodyTask task;
  task.world = test::world_of(fixed("rails", collision("left", rail, {-0.02, 0, -0.01}, 0.4) +
                                                 collision("right", rail, {0.02, 0, -0.01}, 0.4)) +
                                  body("body", mass, {0.05, 0.05, 0.05}, {0, 0, 0.025}, 0.4) +
                                  body("tool", 0.5, {0.026, 0.06, 0.01}, {0, 0, -0.01}, 0.4),
                              kDown);
  task.hand = script({move({0, 0, 0}, 0.4), move({0, 0, 0.1}, 1.0), move({0, 0, 0.1}, 5)});
  task.duration = 5;
  return task;
}

BodyTask slide(const Brick& brick) {
  BodyTask task = push(brick, move({brick.stroke, 0, 0}, brick.duration), "");
  task.duration = 1 + brick.duration;
  return task;
}

BodyTask jam(const Brick& brick) {
  return push(brick, force({3, 0, 0}, 4),
              collision("post", {0.02, 0.2, 0.1}, {0.062, 0, 0.05}, brick.friction));
}

BodyTask rest(double mass) {
  BodyTask task;
  task.world =
      test::world_of(table(0.4) + body("body", mass, {0.1, 0.1, 0.05}, {0, 0, 0.025}, 0.4) +
                         finger({0.01, 0.005, 0.064}, 0.4),
                     kDown);
  task.hand = script({force({0, 0, 0}, 0.5), force({0, 0, -2}, 4)});
  task.duration = 5;
  return task;
}

BodyTask rest_on_tower(double mass) {
  const Vector3 cube(0.05, 0.05, 0.05);
  BodyTask task;
  task.world = test::world_of(table(0.4) + body("low", mass, cube, {0, 0, 0.025}, 0.4) +
                                  body("middle", mass, cube, {0, 0, 0.075}, 0.4) +
                                  body("body", mass, cube, {0, 0, 0.125}, 0.4) +
                                  finger({0.005, 0.005, 0.164}, 0.4),
                              kDown);
  task.hand = script({force({0, 0, 0}, 0.5), force({0, 0, -2}, 4)});
  task.duration = 5;
  return task;
}

BodyTask carry_on_plate(double plate, double load) {
  const Vector3 rail(0.01, 0.1, 0.02);
  BodyTask task;
  task.world = test::world_of(fixed("rails", collision("left", rail, {-0.02, 0, -0.01}, 0.4) +
                                                 collision("right", rail, {0.02, 0, -0.01}, 0.4)) +
                                  body("plate", plate, {0.08, 0.08, 0.01}, {0, 0, 0.005}, 0.4) +
                                  body("body", load, {0.05, 0.05, 0.05}, {0, 0, 0.035}, 0.4) +
                                  body("tool", 0.5, {0.026, 0.06, 0.01}, {0, 0, -0.01}, 0.4),
                              kDown);
  task.hand = script({move({0, 0, 0}, 0.4), move({0, 0, 0.1}, 1.0), move({0, 0, 0.1}, 5)});
  task.duration = 5;
  return task;
}

BodyTask carry_tower(int count) {
  const Vector3 rail(0.01, 0.1, 0.02);
  std::string models = fixed("rails", collision("left", rail, {-0.02, 0, -0.01}, 0.4) +
                                          collision("right", rail, {0.02, 0, -0.01}, 0.4)) +
                       body("tool", 0.5, {0.026, 0.06, 0.01}, {0, 0, -0.01}, 0.4);
  for (int i = 0; i < count; ++i) {
    models += body(i == count - 1 ? "body" : fmt::format("cube{}", i), 0.3, {0.05, 0.05, 0.05},
                   {0, 0, 0.025 + 0.05 * i}, 0.4);
  }
  BodyTask task;
  task.world = test::world_of(models, kDown);
  task.hand = script({move({0, 0, 0}, 0.4), move({0, 0, 0.1}, 1), move({0, 0.05, 0.1}, 1),
                      move({0, 0, 0.1}, 1), move({0, 0, -0.01}, 1.5), move({0, 0, -0.01}, 1.5)});
  task.duration = 6;
  return task;
}

BodyTask throw_up(double mass) {
  BodyTask task = lift(mass);
  task.hand = script({move({0, 0, 0}, 0.4), move({0, 0, 0.05}, 1.0), move({0, 0, 0.12}, 0.15),
                      move({0, 0, 0.12}, 5)});
  return task;
}

BodyTask slide_two(double mass) {
  const Vector3 size(0.1, 0.1, 0.05);
  BodyTask task;
  task.world = test::world_of(table(0.4) + body("near", mass, size, {0, 0, 0.025}, 0.4) +
                                  body("body", mass, size, {0.11, 0, 0.025}, 0.4) +
                                  finger({-0.073, 0, 0.025}, 0.4),
                              kDown);
  task.hand = script({force({0, 0, 0}, 0.5), move({0.2, 0, 0}, 3), move({0.15, 0, 0}, 1.5)});
  task.duration = 5;
  return task;
}

BodyTask rest_on_cubes(int count, double lowest, double highest) {
  const Vector3 cube(0.05, 0.05, 0.05);
  std::string models = table(0.4);
  for (int i = 0; i < count; ++i) {
    const double mass = lowest * std::pow(highest / lowest, i / (count - 1.0));
    models += body(i == count - 1 ? "body" : fmt::format("cube{}", i), mass, cube,
                   {0, 0, 0.025 + 0.05 * i}, 0.4);
  }
  BodyTask task;
  task.world = test::world_of(models + finger({0.005, 0.005, 0.05 * count + 0.014}, 0.4), kDown);
  task.hand = script({force({0, 0, 0}, 0.5), force({0, 0, -2}, 4)});
  task.duration = 5;
  return task;
}

BodyTask press_swinging_wall() {
  const std::string spring =
      "<joint name='slide' type='prismatic'><parent>world</parent><child>body</child><axis>"
      "<xyz>1 0 0</xyz><dynamics><spring_stiffness>1500</spring_stiffness>"
      "<spring_reference>0.04</spring_reference></dynamics></axis></joint>";
  BodyTask task;
  task.world = test::world_of(body("body", 60, {0.05, 0.3, 0.3}, {0, 0, 0}, 0.3, spring) +
                              finger({-0.09, 0, 0}, 0.3));
  task.hand = script({force({0, 0, 0}, 0.5), force({2, 0, 0}, 8)});
  task.duration = 8;
  return task;
}

BodyTask hit(double off_centre) {
  BodyTask task;
  task.world = test::world_of(body("body", 0.3, {0.06, 0.06, 0.06}, {0, 0, 0}, 0.3) +
                              body("tool", 0.5, {0.03, 0.03, 0.03}, {-0.08, off_centre, 0}, 0.3));
  task.hand = {{force({0, 0, 0}, 0.5), force({5, 0, 0}, 0.08)}, server::AfterLastSegment::kRelease};
  task.duration = 1.5;
  return task;
}

BodyTask hit_with_ball(double off_centre) {
  BodyTask task = hit(off_centre);
  const std::string ball = fmt::format(
      "<model name='tool'><pose>-0.08 {} 0 0 0 0</pose><link name='body'><inertial><mass>0.5</mass>"
      "<inertia><ixx>1e-4</ixx><iyy>1e-4</iyy><izz>1e-4</izz></inertia></inertial>"
      "<collision name='ball'><geometry><sphere><radius>0.015</radius></sphere></geometry>"
      "<surface><friction><ode><mu>0.3</mu></ode></friction></surface></collision></link></model>",
      off_centre);
  task.world = test::world_of(body("body", 0.3, {0.06, 0.06, 0.06}, {0, 0, 0}, 0.3) + ball);
  return task;
}

BodyTask tip() {
  BodyTask task;
  task.world = test::world_of(
      fixed("table", collision("top", {1, 1, 0.1}, {kTableEdge - 0.5, 0, -0.05}, 0.4)) +
          body("body", 0.375, {0.1, 0.1, 0.05}, {0, 0, 0.025}, 0.4) +
          finger({-0.073, 0, 0.025}, 0.4),
      kDown);
  task.hand = script({force({0, 0, 0}, 0.5), move({0.16, 0, 0}, 4)});
  task.duration = 5;
  return task;
}

namespace {
constexpr double kDoorMass = 0.4;  // kg
const Vector3 kDoorSize(0.2, 0.012, 0.08);

ve::WorldDescription door_world(double from_hinge) {
  return test::world_of(
      body(
          "body", kDoorMass, kDoorSize, {0.1, 0, 0}, 0.3,
          "<joint name='hinge' type='revolute'><parent>world</parent><child>body</child><pose>-0.1 "
          "0 0 0 0 0</pose><axis><xyz>0 0 1</xyz></axis></joint>") +
      body("tool", 0.5, {0.03, 0.03, 0.03}, {from_hinge, -0.056, 0}, 0.3));
}
}  // namespace

BodyTask knock(double from_hinge) {
  BodyTask task;
  task.world = door_world(from_hinge);
  task.hand = {{force({0, 0, 0}, 0.5), force({0, 5, 0}, 0.08)}, server::AfterLastSegment::kRelease};
  task.duration = 1.2;
  return task;
}

BodyTask open_door(double from_hinge, double speed) {
  BodyTask task;
  task.world = door_world(from_hinge);
  const double duration = duration_of(kDoorStroke, speed);
  task.hand = script({move({0, 0, 0}, 0.5), move({0, kDoorStroke, 0}, duration)});
  task.duration = 0.5 + duration + 0.3;
  return task;
}

double door_inertia() {
  return moment(kDoorMass, kDoorSize[0], kDoorSize[1]) + kDoorMass * 0.1 * 0.1;
}

}  // namespace hlm::experiments
