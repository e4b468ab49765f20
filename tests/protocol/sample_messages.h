// Messages for the tests of the protocol: small ones, random ones, and those of PROTOCOL.md.
#pragma once

#include <cstdint>
#include <string_view>

#include "hlm/protocol/messages.h"
#include "tests/support/random_tool.h"

namespace hlm::test {

/// A planar tool of one link.
inline protocol::Hello planar_hello(std::uint64_t nonce = 1) {
  protocol::Hello hello;
  hello.nonce = nonce;
  hello.tool = rigid_tool(1, Matrix3::Identity() * 2e-3, JointType::kPlanar);
  hello.q = Vector3(0.01, -0.02, 0.5);
  hello.epsilon = 0.005;
  return hello;
}

/// An update of the planar tool; each contact differs from the others by its identity and p_WC.
inline protocol::ContactUpdate planar_update(std::size_t contacts, double ve_time = 1.5) {
  protocol::ContactUpdate update;
  update.ve_time = ve_time;
  update.ve_period = 0.02;
  update.compute_time = 0.003;
  update.q_VE = Vector3(0.01, 0.12, 0);
  update.v_VE = Vector3(0, -0.2, 0.1);
  for (std::size_t i = 0; i < contacts; ++i) {
    ReportedContact contact;
    contact.identity = i;
    contact.p_WC = {0.001 * static_cast<double>(i), ve_time, 0};
    update.contacts.push_back(contact);
  }
  return update;
}

inline protocol::ProxyState planar_state(std::uint64_t step = 1500) {
  protocol::ProxyState state;
  state.step = step;
  state.q = Vector3(0.0101, 0.1199, 0.01);
  state.v = Vector3(0.001, -0.002, 0.003);
  return state;
}

inline protocol::Hello random_hello(Random& random) {
  protocol::Hello hello;
  hello.nonce = random.engine()();
  hello.clears_fault = random.integer(0, 1) == 1;
  hello.tool = random_tool(random, random.integer(1, 11),
                           random.integer(0, 1) ? JointType::kFree : JointType::kPlanar);
  for (Link& link : hello.tool.links) {
    link.lower = random.uniform(-2, 0);
    link.upper = random.uniform(0, 2);
  }
  if (hello.tool.links.size() > 1 && random.integer(0, 1) == 1) {
    hello.tool = guided(random, hello.tool);
  }
  hello.q = random_configuration(random, ToolModel(hello.tool));
  hello.ve_rate = random.uniform(1, 100);
  hello.epsilon = random.uniform(0, 0.02);
  return hello;
}

inline Vector6 random_vector6(Random& random, double size) {
  Vector6 vector;
  vector << random.vector(size), random.vector(size);
  return vector;
}

inline protocol::ContactUpdate random_update(Random& random, const ToolDescription& tool) {
  const ToolModel model(tool);
  protocol::ContactUpdate update;
  update.ve_time = random.uniform(0, 1000);
  update.ve_period = random.uniform(0.01, 0.05);
  update.compute_time = random.uniform(0, 0.05);
  update.echo_step = random.engine()();
  update.echo_hold = random.uniform(0, 0.05);
  update.q_VE = random_configuration(random, model);
  update.v_VE = random_velocity(random, model.dof(), 1);
  const int count = random.integer(0, static_cast<int>(kMaxContacts));
  for (int i = 0; i < count; ++i) {
    ReportedContact contact;
    contact.identity = random.engine()();
    contact.pair = static_cast<std::uint32_t>(random.integer(0, 1 << 30));
    contact.axis = static_cast<std::uint16_t>(random.integer(0, 65535));
    contact.a.index = static_cast<std::uint32_t>(random.integer(0, model.links() - 1));
    contact.b = {static_cast<SideKind>(2 * random.integer(0, 1)),
                 static_cast<std::uint32_t>(random.integer(0, 1 << 30))};
    contact.p_WC = random.vector(1);
    contact.n_W = random.direction();
    contact.separation = random.uniform(-0.02, 0.02);
    contact.v_WC = random.vector(1).cast<float>().cast<double>();
    contact.friction = static_cast<float>(random.uniform(-1, 1));
    contact.load = static_cast<float>(random.uniform(0, 10));
    contact.plane = static_cast<PlaneOwner>(i % 2);
    update.contacts.push_back(contact);
  }
  update.impulse_step = random.uniform(0, 1e6);
  const int bodies = random.integer(0, static_cast<int>(kMaxBodies));
  for (int i = 0; i < bodies; ++i) {
    MovableBody body;
    body.id = static_cast<std::uint32_t>(i);
    body.p_WCom = random.vector(1);
    body.V_W = random_vector6(random, 1);
    body.A_W = random_vector6(random, 10);
    const Vector6 w = random_vector6(random, 1);
    body.W = Matrix6::Identity() + w * w.transpose();
    body.P_W = random_vector6(random, 1);
    body.roundness = static_cast<Roundness>(i % 3);
    body.axis_W = random.vector(1).cast<float>().cast<double>();
    update.bodies.push_back(body);
  }
  update.scene = static_cast<std::uint32_t>(random.integer(0, 1 << 30));
  const int poses = random.integer(0, static_cast<int>(kMaxPoses));
  for (int i = 0; i < poses; ++i) {
    update.poses.push_back(
        {static_cast<std::uint32_t>(i), random.pose(1), random_vector6(random, 1)});
  }
  for (int i = 0; i < poses; i += 3) {
    update.owners.push_back({.body = static_cast<std::uint32_t>(i),
                             .number = static_cast<std::uint32_t>(random.integer(0, 100)),
                             .kept = random.integer(0, 1) == 1,
                             .slowed = static_cast<std::uint8_t>(random.integer(0, 255))});
  }
  for (int i = 0; i < bodies; i += 2) {
    update.rates.push_back({static_cast<std::uint32_t>(i), random_vector6(random, 10)});
  }
  for (int link = 0; link < model.links(); link += 2) {
    update.external.push_back({static_cast<std::uint8_t>(link), random_vector6(random, 10)});
  }
  for (std::uint8_t link = 0; link < tool.links.size(); ++link) {
    if (!has_one_coordinate(tool.links[link].joint) || random.integer(0, 1) == 0) continue;
    update.drives.push_back({.link = link,
                             .follows_device = random.integer(0, 1) == 1,
                             .target = random.uniform(-1, 1),
                             .closed = random.uniform(-1, 1),
                             .open = random.uniform(-1, 1),
                             .stiffness = random.uniform(0, 1e4),
                             .damping = random.uniform(0, 1e2),
                             .most = random.uniform(0, 1e2)});
  }
  return update;
}

inline protocol::ProxyState random_state(Random& random, const ToolDescription& tool) {
  const ToolModel model(tool);
  protocol::ProxyState state;
  state.acknowledged = random.engine()();
  state.step = random.engine()();
  state.age = random.uniform(0, 0.1);
  state.update_send_time = random.uniform(-1e5, 1e5);
  state.hold = random.uniform(0, 0.1);
  state.server = static_cast<ServerState>(random.integer(0, 5));
  state.fault = static_cast<Fault>(random.integer(0, 8));
  state.contact_state = static_cast<ProxyContactState>(random.integer(0, 2));
  state.active_contacts = static_cast<std::uint16_t>(random.integer(0, 64));
  state.predicted_contacts = static_cast<std::uint16_t>(random.integer(0, 64));
  state.smallest_separation = random.uniform(-0.02, 0.02);
  state.q = random_configuration(random, model);
  state.v = random_velocity(random, model.dof(), 1);
  state.X_WD = random.pose(1);
  state.V_WD = random_vector6(random, 1);
  state.F_env = random_vector6(random, 10);
  state.F_command = random_vector6(random, 10);
  state.F_hand = random_vector6(random, 10);
  state.overruns = random.engine()();
  state.updates = random.engine()();
  state.dropped = random.engine()();
  state.control = random.engine()();
  state.limit = static_cast<ForceLimit>(random.integer(0, 6));
  state.hand_measured = random.integer(0, 1) == 1;
  state.buttons = static_cast<std::uint32_t>(random.integer(0, 1 << 30));
  state.gripper = random.uniform(0, 1);
  state.scale = random.uniform(0.1, 10);
  state.given = random.uniform(0, 10);
  state.taken = random.uniform(0, 10);
  state.explained = random.uniform(-1, 1);
  state.tank = random.uniform(-0.5, 0.5);
  state.brought = random.uniform(0, 1);
  state.hand_observed = random.integer(0, 1) == 1;
  state.lowered = random.uniform(0, 1);
  state.fade = static_cast<Fade>(random.integer(0, 4));
  state.scene = static_cast<std::uint32_t>(random.integer(0, 1 << 30));
  state.grip = random.uniform(-10, 10);
  return state;
}

inline Tuning random_tuning(Random& random) {
  Tuning tuning;
  tuning.update_rule = static_cast<UpdateRule>(random.integer(0, 3));
  tuning.controller = static_cast<ControllerKind>(random.integer(0, 6));
  for (const auto& range : kTuningRanges) {
    tuning.*range.number = random.uniform(range.least, range.most);
  }
  return tuning;
}

inline protocol::Text text(std::string_view words) {
  protocol::Text text;
  text.assign(words.begin(), words.end());
  return text;
}

inline protocol::Welcome random_welcome(Random& random) {
  protocol::Welcome welcome;
  welcome.nonce = random.engine()();
  welcome.servo_rate = random.uniform(1, 8000);
  welcome.fingerprint = random.engine()();
  welcome.tuning = random_tuning(random);
  welcome.silence_time = random.uniform(0.01, 1);
  welcome.fade_time = random.uniform(0.01, 1);
  welcome.least_update_rate = random.uniform(1, 100);
  const auto flip = [&] { return random.integer(0, 1) == 1; };
  welcome.capabilities = {flip(), flip(), flip(), flip(), flip(), flip()};
  protocol::DeviceReport& device = welcome.device;
  device.name = text("a device");
  device.max_force = random.uniform(0, 20);
  device.max_torque = random.uniform(0, 1);
  device.max_stiffness = random.uniform(0, 1e4);
  device.max_angular_stiffness = random.uniform(0, 10);
  device.scale = random.uniform(0.1, 10);
  device.buttons = static_cast<std::uint8_t>(random.integer(0, 4));
  device.gripper = flip();
  device.renders_torque = flip();
  device.measures_hand = flip();
  device.guidable = flip();
  device.freedoms = static_cast<Freedoms>(random.integer(0, 63));
  device.observes_hand = flip();
  return welcome;
}

inline protocol::Refusal random_refusal(Random& random) {
  return {.refused = random.engine()(),
          .error = static_cast<UpdateError>(random.integer(0, 9)),
          .whole = random.integer(0, 1) == 1,
          .item = static_cast<std::uint16_t>(random.integer(0, 65535)),
          .count = random.engine()()};
}

inline protocol::Impulses random_impulses(Random& random) {
  protocol::Impulses impulses;
  impulses.step = random.engine()();
  const int bodies = random.integer(0, static_cast<int>(kMaxBodies));
  for (int i = 0; i < bodies; ++i) {
    impulses.bodies.push_back({static_cast<std::uint32_t>(i), random_vector6(random, 1)});
  }
  return impulses;
}

inline protocol::HeldBodies random_held(Random& random) {
  protocol::HeldBodies held;
  held.step = random.engine()();
  const int bodies = random.integer(0, static_cast<int>(protocol::kMaxHeldInMessage));
  for (int i = 0; i < bodies; ++i) {
    protocol::HeldBody& body = held.bodies.emplace_back();
    body.body = static_cast<std::uint32_t>(i);
    body.number = static_cast<std::uint32_t>(random.integer(0, 100));
    body.X_WB = random.pose(1);
    body.V_W = random_vector6(random, 1);
  }
  return held;
}

inline protocol::Control random_control(Random& random) {
  return {.telemetry = random.integer(0, 1) == 1,
          .holds = random.integer(0, 1) == 1,
          .X_WTarget = random.pose(1),
          .tuned = random.integer(0, 1) == 1,
          .tuning = random_tuning(random)};
}

inline protocol::Ticks random_ticks(Random& random) {
  protocol::Ticks ticks;
  ticks.first_step = 1 + random.engine()() / 2;
  const int count = random.integer(1, static_cast<int>(protocol::kTicksPerMessage));
  for (int i = 0; i < count; ++i) {
    ticks.ticks.push_back({.F_env = random.vector(10),
                           .F_command = random.vector(10),
                           .F_hand = random.vector(10),
                           .torque = random.uniform(0, 1),
                           .smallest_separation = random.uniform(-0.01, 0.01),
                           .device_proxy = random.uniform(0, 0.01),
                           .proxy_tool = random.uniform(0, 0.01),
                           .lateness = random.uniform(0, 1e-3),
                           .execution = random.uniform(0, 1e-3),
                           .age = random.uniform(0, 0.1),
                           .active_contacts = static_cast<std::uint16_t>(random.integer(0, 64)),
                           .predicted_contacts = static_cast<std::uint16_t>(random.integer(0, 64)),
                           .adopted = random.integer(0, 1) == 1,
                           .limit = static_cast<ForceLimit>(random.integer(0, 6))});
  }
  return ticks;
}

inline protocol::LocalState random_local_state(Random& random) {
  protocol::LocalState state;
  state.step = random.engine()();
  const int count = random.integer(0, static_cast<int>(protocol::kMaxReportedContacts));
  for (int i = 0; i < count; ++i) {
    state.contacts.push_back(
        {.identity = random.engine()(),
         .a = {SideKind::kToolLink, static_cast<std::uint32_t>(random.integer(0, 15))},
         .b = {SideKind::kWorld, 3},
         .state = static_cast<ContactState>(random.integer(0, 3)),
         .retained = random.integer(0, 1) == 1,
         .c_W = random.vector(1),
         .n_W = random.direction(),
         .p_W = random.vector(1),
         .s = random.uniform(-0.01, 0.01),
         .f_W = random.vector(10)});
  }
  return state;
}

inline protocol::SceneChunk random_chunk(Random& random) {
  protocol::SceneChunk chunk;
  chunk.number = random.engine()();
  const int size = random.integer(1, static_cast<int>(protocol::kChunkSize));
  for (int i = 0; i < size; ++i) {
    chunk.data.push_back(static_cast<std::byte>(random.integer(0, 255)));
  }
  return chunk;
}

inline protocol::SceneState random_scene_state(Random& random) {
  protocol::SceneState state;
  state.next = random.engine()();
  for (std::uint64_t& word : state.bitmap) word = random.engine()();
  state.scene = static_cast<std::uint32_t>(random.integer(0, 1 << 30));
  state.received_scene = static_cast<std::uint32_t>(random.integer(0, 1 << 30));
  state.shapes = static_cast<std::uint32_t>(random.integer(0, 1000));
  state.placements = static_cast<std::uint32_t>(random.integer(0, 10000));
  state.bytes = random.engine()();
  state.error = static_cast<protocol::SceneError>(random.integer(0, 9));
  state.item = static_cast<std::uint32_t>(random.integer(0, 1 << 30));
  state.text = text("placement 7 is there already");
  return state;
}

inline protocol::Reject reject_message(std::string_view text) {
  protocol::Reject reject;
  reject.nonce = 1;
  reject.text = test::text(text);
  return reject;
}

/// The tool with the longest q, q̇ and list of links: 16 links, d = 16, a free root.
inline ToolDescription largest_tool(Random& random) {
  ToolDescription tool = random_tool(random, 11, JointType::kFree);
  while (tool.links.size() < kMaxLinks) {
    Link link = tool.links.back();
    link.parent = 0;
    link.joint = JointType::kFixed;
    tool.links.push_back(link);
  }
  return tool;
}

}  // namespace hlm::test
