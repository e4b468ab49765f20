// Writes the inputs from which the fuzz targets set out, with the product's own writers:
// make_corpus FOLDER. Hand scripts and worlds are those of the repository.
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "hlm/haptic_server/device/simulated_device.h"
#include "hlm/haptic_server/loop/servo.h"
#include "hlm/haptic_server/options.h"
#include "hlm/protocol/transport/capture.h"
#include "hlm/protocol/transport/ip_packet.h"
#include "hlm/ve_client/run/settings.h"
#include "tests/fuzz/deliveries.h"
#include "tests/fuzz/wire_actions.h"
#include "tests/protocol/queue_link.h"
#include "tests/protocol/sample_messages.h"
#include "tests/protocol/sample_records.h"
#include "tests/protocol/transport/capture_files.h"

namespace hlm::fuzz {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;
using protocol::DatagramBytes;
using test::operator+;

constexpr protocol::Endpoint kClient{.address = 0x0A000002, .port = 50000};
constexpr protocol::Endpoint kServer{.address = 0x0A000001, .port = 47800};
constexpr std::uint8_t kFrame = 16;  // ms

void write(const fs::path& path, const Bytes& bytes) {
  fs::create_directories(path.parent_path());
  std::ofstream file(path, std::ios::binary);
  for (const std::uint8_t byte : bytes) file.put(static_cast<char>(byte));
  if (!file.flush()) throw std::runtime_error("cannot write " + path.string());
}

template <class Message>
std::vector<DatagramBytes> parts_of(const Message& message, std::uint64_t sequence = 1) {
  const bool outside =
      std::is_same_v<Message, protocol::Hello> || std::is_same_v<Message, protocol::Reject>;
  std::vector<DatagramBytes> parts;
  for (std::uint8_t part = 0; part < part_count(message); ++part) {
    parts.push_back(encode({.session = outside ? 0u : 1u, .sequence = sequence, .send_time = 1},
                           message, part));
  }
  return parts;
}

// The decoder: every message.

template <class Message>
void write_message(const fs::path& path, const Message& message) {
  Bytes bytes;
  for (const DatagramBytes& part : parts_of(message)) {
    bytes.push_back(static_cast<std::uint8_t>(part.size() & 0xFFu));
    bytes.push_back(static_cast<std::uint8_t>(part.size() >> 8));
    for (const std::byte byte : part) bytes.push_back(std::to_integer<std::uint8_t>(byte));
  }
  write(path, bytes);
}

void write_messages(const fs::path& folder) {
  test::Random random;
  protocol::Hello hello = test::random_hello(random);
  write_message(folder / "hello", test::planar_hello());
  write_message(folder / "hello_linkage", hello);
  write_message(folder / "welcome", test::random_welcome(random));
  write_message(folder / "reject", test::reject_message("busy"));
  write_message(folder / "contact_update", test::planar_update(2));
  write_message(folder / "contact_update_bodies", test::random_update(random, hello.tool));
  write_message(folder / "proxy_state", test::planar_state());
  write_message(folder / "goodbye", protocol::Goodbye{});
  write_message(folder / "control", test::random_control(random));
  write_message(folder / "ticks", test::random_ticks(random));
  write_message(folder / "local_state", test::random_local_state(random));
  write_message(folder / "refusal", test::random_refusal(random));
  write_message(folder / "impulses", test::random_impulses(random));
  write_message(folder / "held_bodies", test::random_held(random));
  write_message(folder / "scene_chunk", test::random_chunk(random));
  write_message(folder / "scene_state", test::random_scene_state(random));
  protocol::ContactUpdate poses = test::planar_update(1);
  poses.scene = 2;
  poses.poses.resize(2);
  poses.poses[1].body = 1;
  write_message(folder / "contact_update_poses", poses);
}

// The scene stream: records, and what a server says of them.

/// `first`: what the target reads before the records.
void write_records(const fs::path& path, Bytes first,
                   const std::vector<protocol::SceneRecord>& records) {
  for (const protocol::SceneRecord& record : records) append(record, first);
  write(path, first);
}

void write_scenes(const fs::path& folder) {
  test::Random random;
  const protocol::SceneShape mesh = test::tetrahedron();
  const auto placed = [&](std::uint32_t id) {
    protocol::ScenePlacement placement = test::random_placement(random, id, mesh.hash);
    placement.side = {SideKind::kMovableBody, id};
    return placement;
  };
  write_records(folder / "scene", {0, 63, 1},
                {mesh, placed(1), placed(2), placed(3), protocol::SceneApart{1, 2},
                 protocol::SceneCommit{1}, protocol::SceneRemoval{2}, protocol::SceneCommit{2}});
  Bytes heard{3};
  for (int i = 0; i < 400; ++i) heard.push_back(static_cast<std::uint8_t>(random.integer(0, 255)));
  write(folder / "heard", heard);
}

// Sessions.

class Deliveries {
 public:
  /// `first`: what the target reads before deliveries.
  explicit Deliveries(Bytes first = {}) : bytes_(std::move(first)) {}

  template <class Message>
  Deliveries& add(std::uint8_t wait, const Message& message,
                  std::uint8_t traits = Delivery::kFitted) {
    for (const DatagramBytes& part : parts_of(message)) {
      write_delivery({wait, traits, part}, bytes_);
      wait = 0;
    }
    return *this;
  }
  void write_to(const fs::path& path) const { write(path, bytes_); }

 private:
  Bytes bytes_;
};

/// A wall ahead of the planar tool, and a body on the way if asked for.
protocol::ContactUpdate wall(std::size_t contacts, bool with_body) {
  protocol::ContactUpdate update = test::planar_update(contacts);
  double y = -0.02;
  for (ReportedContact& contact : update.contacts) {
    contact.n_W = {-1, 0, 0};
    contact.p_WC = {0.02, y, 0};
    contact.separation = 0.005;
    contact.friction = 0.3f;
    y += 0.04;
  }
  if (!with_body) return update;
  MovableBody body;
  body.id = 3;
  body.p_WCom = {0.06, 0, 0};
  body.A_W[2] = -9.81;
  body.W = Matrix6::Identity() * 2;
  update.bodies.push_back(body);
  ReportedContact support = update.contacts[0];
  support.identity = 99;
  support.a = {SideKind::kMovableBody, 3};
  support.n_W = {0, 0, 1};
  support.separation = 0;
  support.load = 5;
  update.contacts[0].b = {SideKind::kMovableBody, 3};
  update.contacts.push_back(support);
  return update;
}

void write_server_sessions(const fs::path& folder) {
  const protocol::Hello hello = test::planar_hello();
  const auto begin = [&](std::uint8_t rule, std::uint8_t controller, std::uint8_t spatial) {
    Deliveries session({rule, controller, spatial});
    session.add(1, hello);
    return session;
  };
  for (std::uint8_t controller = 0; controller < kWords<ControllerKind>.size(); ++controller) {
    Deliveries session = begin(static_cast<std::uint8_t>(controller % 4), controller, 0);
    for (int i = 0; i < 6; ++i) session.add(kFrame, wall(2, i % 2 == 1));
    session.add(kFrame, protocol::Goodbye{});
    session.write_to(folder / ("controller_" + std::to_string(controller)));
  }
  test::Random random;
  const protocol::Control control = test::random_control(random);
  Deliveries controlled = begin(0, 0, 1);
  for (int i = 0; i < 3; ++i) controlled.add(kFrame, control).add(0, wall(4, true));
  controlled.write_to(folder / "controls");
  begin(0, 0, 0)
      .add(kFrame, wall(2, false))
      .add(250, wall(2, false))
      .add(5, hello, 0)
      .add(5, hello, Delivery::kForeign)
      .add(5, wall(2, false), Delivery::kFitted | Delivery::kAfterGap)
      .add(5, hello)
      .write_to(folder / "silence_and_fault");
  Bytes records;
  append(test::tetrahedron(), records);
  append(protocol::SceneCommit{1}, records);
  protocol::SceneChunk chunk;
  for (const std::uint8_t byte : records) chunk.data.push_back(std::byte{byte});
  protocol::ContactUpdate moving = wall(2, false);
  moving.scene = 1;
  moving.poses.resize(2);
  moving.poses[1].body = 1;
  begin(0, 0, 0).add(kFrame, chunk).add(kFrame, moving).write_to(folder / "scene");
  protocol::Hello linkage = test::random_hello(random);
  Deliveries of_linkage({0, 0, 1});
  of_linkage.add(1, linkage).add(kFrame, test::random_update(random, linkage.tool));
  of_linkage.write_to(folder / "linkage");
}

void write_client_sessions(const fs::path& folder) {
  test::Random random;
  protocol::Welcome welcome = test::random_welcome(random);
  protocol::ProxyState state = test::planar_state();
  state.acknowledged = 1;
  protocol::Impulses impulses = test::random_impulses(random);
  Deliveries session;
  session.add(1, welcome);
  for (int i = 0; i < 4; ++i) {
    ++state.acknowledged;
    ++state.step;
    impulses.step = state.step;
    session.add(kFrame, state).add(0, impulses);
  }
  session.add(5, protocol::Goodbye{}).add(5, welcome).add(5, state);
  session.write_to(folder / "session");
  Deliveries()
      .add(1, test::reject_message("busy"))
      .add(5, welcome)
      .add(5, test::random_ticks(random))
      .add(0, test::random_local_state(random))
      .add(0, test::random_refusal(random))
      .add(0, protocol::SceneState{})
      .add(5, state, Delivery::kFitted | Delivery::kAfterGap)
      .write_to(folder / "telemetry");
}

// Sealed links: handshakes, and an enemy on the wire.

class WireSteps {
 public:
  WireSteps& add(const WireStep& step, int times = 1) {
    for (int i = 0; i < times; ++i) step.write_to(bytes_);
    return *this;
  }
  /// The newest packet arrives, after a while.
  WireSteps& pass() { return add({WireAction::kWait, 0, 0, 0, 30}).add({WireAction::kPass}); }
  /// A client asks, is answered and proves itself; the server answers.
  WireSteps& connect(std::uint8_t whom) {
    add({WireAction::kSay, whom, 0, 3}).pass().pass();
    add({WireAction::kSay, whom, 0, 3}).pass();
    return add({WireAction::kKeep}).add({WireAction::kAnswer, whom, 0, 9}).pass();
  }
  void write_to(const fs::path& path) const { write(path, bytes_); }

 private:
  Bytes bytes_;
};

void write_sealed_sessions(const fs::path& folder) {
  WireSteps session;
  session.connect(0);
  for (int i = 0; i < 4; ++i) session.add({WireAction::kSay, 0, 0, 50}).pass();
  session.write_to(folder / "session");
  WireSteps replayed = session;
  for (std::uint8_t back = 0; back < 8; ++back) {
    replayed.add({WireAction::kPass, 0, back}).add({WireAction::kRedirect, 1, back});
    replayed.add({WireAction::kReflect, 1, back}).add({WireAction::kAlter, 0, back, 0, 20});
    replayed.add({WireAction::kAlter, 0, back, 0xFB, 5});
  }
  replayed.write_to(folder / "replayed");
  WireSteps two;
  two.connect(0).connect(1).add({WireAction::kSay, 2}, 3).pass();
  two.add({WireAction::kForget, 0, 0, 0, 1}).add({WireAction::kForget, 1}).connect(1);
  two.add({WireAction::kInvent, 0, 0, 5}).add({WireAction::kWait}).write_to(folder / "two_clients");
}

// A capture of a server's session.

void write_capture(const fs::path& path) {
  fs::create_directories(path.parent_path());
  protocol::CaptureWriter capture(path);
  test::QueueLink link;
  protocol::ServerSession session(link, {.first_session_id = 5});
  server::SimulatedDevice device({}, {}, 1e-3);
  const auto servo = std::make_unique<server::Servo>(server::ServoOptions{}, 0, session, device);
  std::int64_t time_ns = 0;
  const auto deliver = [&](const auto& message, std::uint64_t id, std::uint64_t sequence) {
    for (std::uint8_t part = 0; part < part_count(message); ++part) {
      const DatagramBytes bytes = encode({.session = id, .sequence = sequence}, message, part);
      link.deliver(kClient, bytes);
      capture.write(time_ns, kClient, kServer, protocol::view(bytes));
    }
  };
  deliver(test::planar_hello(), 0, 1);
  server::Timing timing;
  for (int tick = 0; tick < 50; ++tick) {
    time_ns = 1'000'000 * tick;
    timing.begin = 1e-3 * tick;
    if (tick % kFrame == kFrame - 1) {
      deliver(wall(2, false), 5, static_cast<std::uint64_t>(1 + tick / kFrame));
    }
    servo->tick(timing);
    for (const protocol::Datagram& sent : link.sent()) {
      capture.write(time_ns, kServer, kClient, protocol::view(sent.bytes));
    }
    link.forget_sent();
  }
  capture.flush();
}

/// As other programs write captures.
void write_foreign_captures(const fs::path& folder) {
  const std::string text = "HLMI!";
  const auto payload = std::as_bytes(std::span(text));
  const auto header = protocol::ip_udp_header(kClient, kServer, payload);
  test::ByteVector packet(header.begin(), header.end());
  packet.insert(packet.end(), payload.begin(), payload.end());
  const test::ByteVector ethernet = test::from_hex("020000000001 020000000002 8100 0064 0800");
  test::write_frames(folder / "ethernet.pcap", DLT_EN10MB, {{ethernet + packet}});
  test::write_frames(folder / "cooked.pcap", DLT_LINUX_SLL,
                     {{test::from_hex("0000 0001 0006 0200000000010000 0800") + packet}});
  test::write_frames(folder / "loopback.pcap", DLT_NULL, {{test::from_hex("02000000") + packet}});
  test::write_file(folder / "packet.pcapng", test::pcapng_of(packet));
}

// Configurations, as --print-config prints them: without the comments, in which nothing is found.

void write_configurations(const fs::path& folder) {
  fs::create_directories(folder);
  server::ServerOptions options;
  settings::CommandLine server({.name = "haptic_server", .purpose = "", .footer = ""});
  add_options(server, options);
  std::ofstream(folder / "server.toml")
      << server.table().to_toml(false) << "[device]\ndriver = \"simulated\"\nmass = 0.5\n";
  std::ofstream(folder / "client.toml")
      << "world = \"worlds/testbed.sdf\"\nepsilon = 0.005\nrate = 60\nrate-range = [30, 60]\n"
         "follow = \"implicit\"\nnetwork-loss = 0.1\n";
}

}  // namespace
}  // namespace hlm::fuzz

/// One corpus, always the same.
unsigned hlm::test::random_seed() { return 1; }

int main(int argc, char** argv) {
  using namespace hlm::fuzz;
  if (argc != 2) {
    std::cerr << "usage: make_corpus FOLDER\n";
    return 2;
  }
  const fs::path folder = argv[1];
  write_messages(folder / "decoder");
  write_scenes(folder / "scene");
  write_server_sessions(folder / "server");
  write_client_sessions(folder / "client");
  write_sealed_sessions(folder / "sealing");
  write_capture(folder / "capture" / "session.pcap");
  write_foreign_captures(folder / "capture");
  write_configurations(folder / "configuration");
}
