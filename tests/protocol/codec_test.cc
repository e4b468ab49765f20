// Messages to bytes and back; what is refused.
#include "hlm/protocol/codec.h"

#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Eigenvalues>

#include "hlm/protocol/layout.h"
#include "hlm/protocol/semidefinite.h"
#include "hlm/protocol/tool_fit.h"
#include "tests/protocol/sample_messages.h"
#include "tests/support/catch.h"

namespace hlm::protocol {
namespace {

using test::Random;

/// Example bytes of PROTOCOL.md.
std::string documented_hex(const std::string& message) {
  std::ifstream file(HLM_PROTOCOL_DOCUMENT);
  std::stringstream buffer;
  buffer << file.rdbuf();
  const std::string document = buffer.str();
  const std::string opening = "```hex\n";
  const std::size_t example = document.find("### Example: " + message + "\n");
  REQUIRE(example != std::string::npos);
  const std::size_t begin = document.find(opening, example) + opening.size();
  std::string digits;
  for (const char c : document.substr(begin, document.find("```", begin) - begin)) {
    if (c != '\n') digits += c;
  }
  return digits;
}

std::string hex(const DatagramBytes& bytes) {
  constexpr const char* kDigits = "0123456789abcdef";
  std::string digits;
  for (const std::byte byte : bytes) {
    digits += kDigits[std::to_integer<int>(byte) >> 4];
    digits += kDigits[std::to_integer<int>(byte) & 15];
  }
  return digits;
}

constexpr std::uint64_t kNonce = 0x0123456789ABCDEF;

Hello documented_hello() {
  Hello hello;
  hello.nonce = kNonce;
  hello.ve_rate = 60;
  hello.epsilon = 0.005;
  hello.tool.gravity_W = {0, -9.81, 0};
  hello.tool.length = 0.04;
  hello.tool.X_LH.p = {0, 0.01, 0};
  hello.q = Eigen::Vector4d(0.01, -0.02, 0.5, 0.02);
  hello.clears_fault = true;
  Link link;
  link.joint = JointType::kPlanar;
  link.p_LCom = {0, 0.002, 0};
  link.I_LCom << 0.001, 0.0001, 0, 0.0001, 0.0015, -0.0002, 0, -0.0002, 0.002;
  hello.tool.links.push_back(link);
  Link& jaw = hello.tool.links.emplace_back();
  jaw.parent = 0;
  jaw.joint = JointType::kGuided;
  jaw.X_PJ.p = {0, 0.02, 0};
  jaw.mass = 0.05;
  jaw.I_LCom = 1e-5 * Matrix3::Identity();
  jaw.lower = 0;
  jaw.upper = 0.04;
  JointCurve& curve = hello.tool.curves.emplace_back();
  curve.link = curve.leader = 1;
  curve.armature = 0.1;
  curve.terms.col(0) << 0.02F, 0, 0, 1, 0, 0, 0;
  curve.terms.col(1) << 0.02F, 0, 0, 0, 0, 0, 0.25;
  return hello;
}

ContactUpdate documented_update() {
  ContactUpdate update = test::planar_update(1);
  update.echo_step = 1480;
  update.echo_hold = 0.004;
  ReportedContact& last = update.contacts.back();
  last.identity = 0x0807060504030201;
  last.pair = 0x0D0C0B0A;
  last.axis = 2;
  last.b = {SideKind::kMovableBody, 5};
  last.p_WC = {0.03, 0.1, 0};
  last.n_W = Vector3::UnitY();
  last.separation = -0.0005;
  last.v_WC = {0.5, 0, 0};
  last.friction = 0.25;
  last.plane = PlaneOwner::kA;
  update.impulse_step = 1470.25;
  MovableBody body;
  body.id = 5;
  body.p_WCom = {0.03, 0.05, 0};
  body.V_W << 0.5, 0, 0, 0, 0, 0.1;
  body.A_W << 0, -9.81, 0, 0, 0, 0;
  body.W.diagonal() << 2, 2, 2, 500, 500, 400;
  body.P_W << 0.24, 0, 0, 0, 0, 0.001;
  body.roundness = Roundness::kAxis;
  body.axis_W = {0, 0, 1};
  update.bodies.push_back(body);
  update.scene = 3;
  BodyPose pose;
  pose.body = 5;
  pose.X_WB = {{0.03, 0.05, 0}, {0.6, 0, 0, 0.8}};
  pose.V_W << 0.5, 0, 0, 0, 0, 0.1;
  update.poses.push_back(pose);
  AccelerationRate rate;
  rate.body = 5;
  rate.A_rate_W << -25, 0, 0, 0, 0, 2;
  update.rates.push_back(rate);
  ExternalWrench wrench;
  wrench.F_W << 0, 0, -2.5, 0.01, 0, 0;
  update.external.push_back(wrench);
  update.owners.push_back({.body = 5, .number = 3, .slowed = 51});
  update.drives.push_back({.link = 0,
                           .follows_device = true,
                           .target = 0.01,
                           .closed = 0,
                           .open = 0.04,
                           .stiffness = 1000,
                           .damping = 5,
                           .most = 20});
  return update;
}

ProxyState documented_state() {
  ProxyState state = test::planar_state();
  state.acknowledged = 12;
  state.age = 0.0125;
  state.update_send_time = 3.000000001;
  state.hold = 0.001;
  state.server = ServerState::kActive;
  state.contact_state = ProxyContactState::kResting;
  state.active_contacts = 2;
  state.predicted_contacts = 3;
  state.smallest_separation = -0.00025;
  state.X_WD.p = {0.01, 0.12, 0};
  state.V_WD << 0, -0.1, 0, 0, 0, 0.2;
  state.F_env << 0, 5, 0, 0, 0, 0.01;
  state.F_command << 0, 4.5, 0, 0, 0, 0.02;
  state.F_hand << 0, -5, 0, 0, 0, 0;
  state.overruns = 1;
  state.updates = 9;
  state.dropped = 4;
  state.control = 11;
  state.limit = ForceLimit::kForce;
  state.hand_measured = true;
  state.buttons = 2;
  state.gripper = 0.5;
  state.given = 0.5;
  state.taken = 0.75;
  state.explained = 0.125;
  state.tank = 0.5;
  state.hand_observed = true;
  state.lowered = 0.25;
  state.scene = 2;
  state.grip = 2.5;
  return state;
}

Control documented_control() {
  Control control{.telemetry = true, .holds = true, .X_WTarget = {}, .tuned = true, .tuning = {}};
  control.X_WTarget.p = {0.02, 0.1, 0};
  control.tuning = {UpdateRule::kIntermediateRepresentation,
                    ControllerKind::kDirect,
                    8000,
                    50,
                    0.2,
                    0.5,
                    1000,
                    20,
                    2,
                    0.05};
  return control;
}

Ticks documented_ticks() {
  Ticks ticks;
  ticks.first_step = 1501;
  ticks.ticks.push_back({{0, 5, 0},
                         {0, 4.5, 0},
                         {0, -5, 0},
                         0.01,
                         -0.00025,
                         0.0001,
                         0.0002,
                         2e-5,
                         1e-5,
                         0.0125,
                         2,
                         3,
                         true,
                         ForceLimit::kForce});
  return ticks;
}

LocalState documented_local_state() {
  LocalState state;
  state.step = 1502;
  state.contacts.push_back({0x0807060504030201,
                            {SideKind::kToolLink, 0},
                            {SideKind::kWorld, 5},
                            ContactState::kPenetrating,
                            true,
                            {0.03, 0.1, 0},
                            {0, -1, 0},
                            {0.03, 0.1002, 0},
                            -0.0002,
                            {0, -0.8, 0}});
  return state;
}

Welcome documented_welcome() {
  Welcome welcome;
  welcome.nonce = kNonce;
  welcome.fingerprint = 0xFEDCBA9876543210;
  welcome.device.name = test::text("simulated");
  welcome.device.max_force = 12;
  welcome.device.max_torque = 0.6;
  welcome.device.max_stiffness = 10000;
  welcome.device.measures_hand = true;
  welcome.device.guidable = true;
  welcome.device.freedoms = kPlanarFreedoms;
  welcome.capabilities.scenes = true;
  welcome.capabilities.guides = true;
  return welcome;
}

Impulses documented_impulses() {
  Impulses impulses;
  impulses.step = 1500;
  BodyImpulse impulse;
  impulse.body = 5;
  impulse.P_W << 0.25, 0, 0, 0, 0, 0.001;
  impulses.bodies.push_back(impulse);
  return impulses;
}

HeldBodies documented_held() {
  HeldBodies held;
  held.step = 1500;
  HeldBody& body = held.bodies.emplace_back();
  body.body = 5;
  body.number = 3;
  body.X_WB = {{0.03, 0.05, 0}, {0.6, 0, 0, 0.8}};
  body.V_W << 0.5, 0, 0, 0, 0, 0.1;
  return held;
}

SceneChunk documented_chunk() {
  SceneChunk chunk;
  chunk.number = 4;
  for (const int byte : {5, 4, 0, 0, 0, 3, 0, 0, 0}) {
    chunk.data.push_back(static_cast<std::byte>(byte));
  }
  return chunk;
}

SceneState documented_scene_state() {
  SceneState state;
  state.next = 5;
  state.bitmap = {6, 0, 0, std::uint64_t{1} << 63u};
  state.scene = 2;
  state.received_scene = 3;
  state.shapes = 4;
  state.placements = 6;
  state.bytes = 4096;
  state.error = SceneError::kDuplicate;
  state.item = 6;
  state.text = test::text("duplicate");
  return state;
}

TEST_CASE("Each message has the bytes of its example in PROTOCOL.md") {
  CHECK(hex(encode({0, 3, 2500000000}, documented_hello())) == documented_hex("hello"));
  CHECK(hex(encode({7, 1, -5}, documented_welcome())) == documented_hex("welcome"));
  Reject reject = test::reject_message("busy");
  reject.nonce = kNonce;
  CHECK(hex(encode({0, 2, 0}, reject)) == documented_hex("reject"));
  CHECK(hex(encode({7, 12, 3000000001}, documented_update())) == documented_hex("contact_update"));
  CHECK(hex(encode({7, 13, 4000000000}, documented_state())) == documented_hex("proxy_state"));
  CHECK(hex(encode({7, 14, 5000000000}, Goodbye{GoodbyeReason::kShutdown})) ==
        documented_hex("goodbye"));
  CHECK(hex(encode({7, 11, 6000000000}, documented_control())) == documented_hex("control"));
  CHECK(hex(encode({7, 15, 7000000000}, documented_ticks())) == documented_hex("ticks"));
  CHECK(hex(encode({7, 16, 8000000000}, documented_local_state())) ==
        documented_hex("local_state"));
  CHECK(hex(encode({7, 17, 9000000000}, Refusal{13, UpdateError::kNormal, true, 2, 1})) ==
        documented_hex("refusal"));
  CHECK(hex(encode({7, 18, 10000000000}, documented_impulses())) == documented_hex("impulses"));
  CHECK(hex(encode({7, 19, 11000000000}, documented_chunk())) == documented_hex("scene_chunk"));
  CHECK(hex(encode({7, 20, 12000000000}, documented_scene_state())) ==
        documented_hex("scene_state"));
  CHECK(hex(encode({7, 21, 13000000000}, documented_held())) == documented_hex("held_bodies"));
}

template <class Message>
std::vector<DatagramBytes> all_parts(const Envelope& envelope, const Message& message) {
  std::vector<DatagramBytes> parts;
  for (std::uint8_t part = 0; part < part_count(message); ++part) {
    parts.push_back(encode(envelope, message, part));
  }
  return parts;
}

template <class Message>
std::optional<DropReason> decode_any(const std::vector<DatagramBytes>& parts, Message& message) {
  if (parts.size() == 1) return decode(view(parts[0]), message);
  return decode(std::span<const DatagramBytes>(parts), message);
}

/// Envelope of a message of this type.
template <class Message>
Envelope envelope_for(std::uint64_t sequence = 1) {
  const bool outside = std::is_same_v<Message, Hello> || std::is_same_v<Message, Reject>;
  return {.session = outside ? 0u : 7u, .sequence = sequence, .send_time = 1};
}

template <class Message>
void check_round_trip(const Message& message) {
  const auto parts = all_parts(envelope_for<Message>(), message);
  Message decoded;
  REQUIRE(decode_any(parts, decoded) == std::nullopt);
  CHECK(all_parts(envelope_for<Message>(), decoded) == parts);
}

TEST_CASE("A decoded message is the encoded one, bit for bit") {
  Random random;
  for (int i = 0; i < 200; ++i) {
    const Hello hello = test::random_hello(random);
    check_round_trip(hello);
    check_round_trip(test::random_welcome(random));
    check_round_trip(test::random_control(random));
    check_round_trip(test::random_ticks(random));
    check_round_trip(test::random_local_state(random));
    check_round_trip(test::reject_message(std::string(static_cast<std::size_t>(i), 'x')));
    check_round_trip(test::random_update(random, hello.tool));
    check_round_trip(test::random_state(random, hello.tool));
    check_round_trip(Goodbye{GoodbyeReason::kShutdown});
    check_round_trip(test::random_refusal(random));
    check_round_trip(test::random_impulses(random));
    check_round_trip(test::random_held(random));
    check_round_trip(test::random_chunk(random));
    check_round_trip(test::random_scene_state(random));
  }
}

TEST_CASE("The largest messages fit their datagrams and leave room for sealing") {
  Random random;
  Hello hello;
  hello.tool = test::largest_tool(random);
  hello.q = test::random_configuration(random, ToolModel(hello.tool));
  REQUIRE(find_error(hello) == std::nullopt);
  ContactUpdate update = test::random_update(random, hello.tool);
  update.contacts.resize(kMaxContacts, ReportedContact{});
  update.bodies.resize(kMaxBodies, MovableBody{});
  update.poses.resize(kMaxPoses, BodyPose{});
  update.rates.resize(kMaxBodies, AccelerationRate{});
  update.external.resize(kMaxLinks, ExternalWrench{});
  update.owners.resize(kMaxPoses, Ownership{});
  SceneChunk chunk;
  chunk.data.resize(kChunkSize);
  SceneState scene = test::random_scene_state(random);
  scene.text = test::text(std::string(kMaxText, 'x'));
  LocalState local = test::random_local_state(random);
  local.contacts.resize(kMaxReportedContacts, LocalContactReport{});
  Ticks ticks = test::random_ticks(random);
  ticks.ticks.resize(kTicksPerMessage);
  Impulses impulses = test::random_impulses(random);
  impulses.bodies.resize(kMaxBodies);
  HeldBodies held = test::random_held(random);
  held.bodies.resize(kMaxHeldInMessage);
  Welcome welcome = test::random_welcome(random);
  welcome.device.name = test::text(std::string(kMaxText, 'x'));
  const auto check = [](const auto& message, std::size_t most_parts) {
    const auto parts = all_parts(envelope_for<std::decay_t<decltype(message)>>(), message);
    CHECK(parts.size() <= most_parts);
    for (const DatagramBytes& part : parts) CHECK(part.size() <= kMaxDatagram - kSealRoom);
    check_round_trip(message);
  };
  check(hello, 4);
  check(update, kMaxParts);
  check(local, 8);
  check(ticks, 1);
  check(impulses, 1);
  check(held, 1);
  check(welcome, 1);
  check(chunk, 1);
  check(scene, 1);
  check(test::random_state(random, hello.tool), 1);
  check(test::reject_message(std::string(kMaxText, 'x')), 1);
}

TEST_CASE("Every item has the bytes that its table says") {
  const auto size = [](const auto& item) {
    DatagramBytes bytes;
    Writer writer(bytes);
    layout::fields(writer, item);
    return bytes.size();
  };
  CHECK(size(Link{}) == layout::kItemSize<Link>);
  CHECK(size(MovableBody{}) == layout::kItemSize<MovableBody>);
  CHECK(size(ReportedContact{}) == layout::kItemSize<ReportedContact>);
  CHECK(size(TickSignals{}) == layout::kItemSize<TickSignals>);
  CHECK(size(LocalContactReport{}) == layout::kItemSize<LocalContactReport>);
  CHECK(size(BodyImpulse{}) == layout::kItemSize<BodyImpulse>);
  CHECK(size(BodyPose{}) == layout::kItemSize<BodyPose>);
  CHECK(size(AccelerationRate{}) == layout::kItemSize<AccelerationRate>);
  CHECK(size(ExternalWrench{}) == layout::kItemSize<ExternalWrench>);
  CHECK(size(Ownership{}) == layout::kItemSize<Ownership>);
  CHECK(size(HeldBody{}) == layout::kItemSize<HeldBody>);
}

/// Calls `check` with one datagram of each type (of lists, one part of several).
template <class Check>
void for_each_type(Check check) {
  check(encode({}, documented_hello()));
  check(encode(envelope_for<Welcome>(), Welcome{}));
  check(encode({}, test::reject_message("busy")));
  check(encode(envelope_for<ContactUpdate>(), documented_update()));
  check(encode(envelope_for<ProxyState>(), documented_state()));
  check(encode(envelope_for<Goodbye>(), Goodbye{}));
  check(encode(envelope_for<Control>(), documented_control()));
  check(encode(envelope_for<Ticks>(), documented_ticks()));
  check(encode(envelope_for<LocalState>(), documented_local_state()));
  check(encode(envelope_for<Refusal>(), Refusal{}));
  check(encode(envelope_for<Impulses>(), documented_impulses()));
  check(encode(envelope_for<SceneChunk>(), documented_chunk()));
  check(encode(envelope_for<SceneState>(), documented_scene_state()));
  check(encode(envelope_for<HeldBodies>(), documented_held()));
}

template <class Message>
std::optional<DropReason> decode_as(const DatagramBytes& bytes) {
  Message message;
  return decode(view(bytes), message);
}

/// Decodes bytes as whatever their header says; a list's part counts as its whole message.
std::optional<DropReason> decode_whatever(const DatagramBytes& bytes) {
  Header header;
  if (const auto reason = decode_header(view(bytes), header)) return reason;
  switch (header.type) {
    case MessageType::kHello:
      return decode_as<Hello>(bytes);
    case MessageType::kWelcome:
      return decode_as<Welcome>(bytes);
    case MessageType::kReject:
      return decode_as<Reject>(bytes);
    case MessageType::kContactUpdate:
      return decode_as<ContactUpdate>(bytes);
    case MessageType::kProxyState:
      return decode_as<ProxyState>(bytes);
    case MessageType::kGoodbye:
      return decode_as<Goodbye>(bytes);
    case MessageType::kControl:
      return decode_as<Control>(bytes);
    case MessageType::kTicks:
      return decode_as<Ticks>(bytes);
    case MessageType::kLocalState:
      return decode_as<LocalState>(bytes);
    case MessageType::kRefusal:
      return decode_as<Refusal>(bytes);
    case MessageType::kImpulses:
      return decode_as<Impulses>(bytes);
    case MessageType::kSceneChunk:
      return decode_as<SceneChunk>(bytes);
    case MessageType::kSceneState:
      return decode_as<SceneState>(bytes);
    case MessageType::kHeldBodies:
      return decode_as<HeldBodies>(bytes);
  }
  return DropReason::kMalformed;
}

void set_length(DatagramBytes& bytes) {
  bytes[36] = static_cast<std::byte>(bytes.size() & 0xFF);
  bytes[37] = static_cast<std::byte>(bytes.size() >> 8);
}

/// Where the lists of documented_update() that older clients do not send begin, each with one item
/// behind its header.
std::size_t end_without_drives(const DatagramBytes& update) {
  return update.size() - layout::kItemSize<JointDrive> - layout::kListHeaderSize;
}
std::size_t end_without_owners(const DatagramBytes& update) {
  return end_without_drives(update) - layout::kItemSize<Ownership> - layout::kListHeaderSize;
}
std::size_t end_without_external(const DatagramBytes& update) {
  return end_without_owners(update) - layout::kItemSize<ExternalWrench> - layout::kListHeaderSize;
}
std::size_t end_without_rates(const DatagramBytes& update) {
  return end_without_external(update) - layout::kItemSize<AccelerationRate> -
         layout::kListHeaderSize;
}
std::size_t end_without_poses(const DatagramBytes& update) {
  return end_without_rates(update) - layout::kItemSize<BodyPose> - layout::kListHeaderSize;
}

TEST_CASE("Every truncation of every message is refused, but those that older clients send") {
  for_each_type([](DatagramBytes bytes) {
    Header header;
    REQUIRE_FALSE(decode_header(view(bytes), header));
    const bool is_update = header.type == MessageType::kContactUpdate;
    const bool is_hello = header.type == MessageType::kHello;
    const std::array<std::size_t, 6> older{
        is_hello ? bytes.size() - layout::kItemSize<JointCurve> - layout::kListHeaderSize : 0,
        is_update ? end_without_drives(bytes) : 0,
        is_update ? end_without_owners(bytes) : 0,
        is_update ? end_without_external(bytes) : 0,
        is_update ? end_without_rates(bytes) : 0,
        is_update ? end_without_poses(bytes) : 0};
    while (!bytes.empty()) {
      bytes.pop_back();
      CHECK(decode_whatever(bytes) == DropReason::kTruncated);
      if (bytes.size() < layout::kHeaderSize) continue;
      DatagramBytes consistent = bytes;
      set_length(consistent);
      const bool is_whole = decode_whatever(consistent) != DropReason::kMalformed;
      CHECK(is_whole == (std::ranges::find(older, bytes.size()) != older.end()));
    }
  });
}

TEST_CASE("What a newer version appends to fixed fields, items and lists is skipped") {
  const Refusal refusal{13, UpdateError::kNormal, true, 2, 1};
  DatagramBytes bytes = encode(envelope_for<Refusal>(), refusal);
  bytes.insert(bytes.end(), 5, std::byte{0xEE});
  CHECK(decode_whatever(bytes) == DropReason::kMalformed);  // but not without saying so
  set_length(bytes);
  CHECK(decode_whatever(bytes) == std::nullopt);
  bytes[38] = static_cast<std::byte>(std::to_integer<int>(bytes[38]) + 5);  // block
  Refusal decoded;
  REQUIRE(decode(view(bytes), decoded) == std::nullopt);
  CHECK(decoded.refused == 13);
  CHECK(decoded.count == 1);

  // Items of 60 instead of 52 bytes.
  bytes = encode(envelope_for<Impulses>(), documented_impulses());
  bytes.insert(bytes.end(), 8, std::byte{0xEE});
  bytes[48 + 6] = std::byte{60};
  set_length(bytes);
  Impulses impulses;
  REQUIRE(decode(view(bytes), impulses) == std::nullopt);
  REQUIRE(impulses.bodies.size() == 1);
  CHECK(impulses.bodies[0].P_W[5] == 0.001);
}

TEST_CASE("What an older server of this version does not send has its default") {
  DatagramBytes bytes = encode(envelope_for<Welcome>(), documented_welcome());
  // Freedoms, whether the hand is observed, scenes, holds, guides.
  bytes.resize(bytes.size() - 5);
  bytes[38] = static_cast<std::byte>(std::to_integer<int>(bytes[38]) - 5);  // block
  set_length(bytes);
  Welcome decoded;
  REQUIRE(decode(view(bytes), decoded) == std::nullopt);
  CHECK(decoded.device.freedoms == kAllFreedoms);
  CHECK(decoded.device.guidable);
  CHECK_FALSE(decoded.capabilities.scenes);
  CHECK_FALSE(decoded.capabilities.holds);

  ProxyState state = documented_state();
  state.fade = Fade::kClientSilent;
  state.given = 1;
  bytes = encode(envelope_for<ProxyState>(), state);
  // Fade, what passed the port, the hand, lowered, the scene, the spare bytes, the grip.
  constexpr int kAppended = 1 + 5 * 8 + 1 + 8 + 4 + 5 + 8;
  bytes.resize(bytes.size() - kAppended);
  const int block =
      std::to_integer<int>(bytes[38]) + 256 * std::to_integer<int>(bytes[39]) - kAppended;
  bytes[38] = static_cast<std::byte>(block % 256);
  bytes[39] = static_cast<std::byte>(block / 256);
  set_length(bytes);
  ProxyState older;
  REQUIRE(decode(view(bytes), older) == std::nullopt);
  CHECK(older.fade == Fade::kNone);
  CHECK(older.given == 0);
  CHECK_FALSE(older.hand_observed);
  CHECK(older.lowered == 0);
  CHECK(older.scene == 0);
  CHECK(older.v == state.v);
}

TEST_CASE("An update of an older client has no lists of newer ones, whatever was there before") {
  const ContactUpdate update = documented_update();
  DatagramBytes bytes = encode(envelope_for<ContactUpdate>(), update);
  Header header;
  REQUIRE_FALSE(decode_header(view(bytes), header));
  bytes.resize(end_without_poses(bytes));
  const auto scene =
      bytes.begin() + static_cast<std::ptrdiff_t>(layout::kHeaderSize + header.block) - 4;
  bytes.erase(scene, scene + 4);
  bytes[38] = static_cast<std::byte>(std::to_integer<int>(bytes[38]) - 4);  // block
  set_length(bytes);
  ContactUpdate decoded = update;
  REQUIRE_FALSE(decode_part(view(bytes), decoded));
  CHECK(decoded.scene == 0);
  CHECK(decoded.poses.empty());
  CHECK(decoded.rates.empty());
  CHECK(decoded.external.empty());
  CHECK(decoded.owners.empty());
  CHECK(decoded.contacts.size() == update.contacts.size());
  CHECK(decoded.v_VE == update.v_VE);
  CHECK(decode(view(bytes), decoded) == std::nullopt);
}

TEST_CASE(
    "Rates of bodies come whole where there are no poses, and cost nothing where there are none") {
  ContactUpdate update = documented_update();
  update.drives.clear();
  update.owners.clear();
  update.external.clear();
  update.poses.clear();
  ContactUpdate decoded;
  REQUIRE_FALSE(decode(view(encode(envelope_for<ContactUpdate>(), update)), decoded));
  CHECK(decoded.poses.empty());
  REQUIRE(decoded.rates.size() == 1);
  CHECK(decoded.rates[0].body == 5);
  CHECK(decoded.rates[0].A_rate_W == update.rates[0].A_rate_W);
  const std::size_t with_rates = encode(envelope_for<ContactUpdate>(), update).size();
  update.rates.clear();
  CHECK(with_rates - encode(envelope_for<ContactUpdate>(), update).size() ==
        layout::kItemSize<AccelerationRate> + 2 * layout::kListHeaderSize);
}

TEST_CASE("A pose that is wrong refuses its update, and the refusal says which") {
  ContactUpdate update = test::planar_update(2);
  update.poses.resize(3);
  const auto error = [&](auto change) {
    ContactUpdate changed = update;
    change(changed.poses[1]);
    ContactUpdate decoded;
    return decode_part(view(encode(envelope_for<ContactUpdate>(), changed)), decoded);
  };
  CHECK_FALSE(error([](BodyPose&) {}));
  CHECK_FALSE(error([](BodyPose& pose) { pose.X_WB.R.w() = 1.0009; }));
  const auto check = [&](UpdateError expected, auto change) {
    const auto found = error(change);
    REQUIRE(found);
    CHECK(found->error == expected);
    CHECK((found->in_item && found->item == 1));
  };
  check(UpdateError::kQuaternion, [](BodyPose& pose) { pose.X_WB.R.w() = 1.0011; });
  check(UpdateError::kRange, [](BodyPose& pose) { pose.X_WB.p.y() = -10001; });
  check(UpdateError::kRange, [](BodyPose& pose) { pose.V_W[5] = 1001; });
  check(UpdateError::kNonFinite, [](BodyPose& pose) { pose.X_WB.p.z() = std::nan(""); });
  check(UpdateError::kNonFinite, [](BodyPose& pose) { pose.X_WB.R.y() = std::nan(""); });
}

TEST_CASE("A rate or an external wrench that is out of range refuses its update, and is named") {
  ContactUpdate update = test::planar_update(2);
  const auto refusal = [&](double& number, double value) {
    number = value;
    ContactUpdate decoded;
    return decode_part(view(encode(envelope_for<ContactUpdate>(), update)), decoded);
  };
  const auto check = [&](double& number, double bound) {
    CHECK_FALSE(refusal(number, -bound));
    for (const auto& [value, error] : {std::pair(1.1 * bound, UpdateError::kRange),
                                       std::pair(std::nan(""), UpdateError::kNonFinite)}) {
      const auto found = refusal(number, value);
      REQUIRE(found);
      CHECK(found->error == error);
      CHECK((found->in_item && found->item == 1));
    }
    number = 0;
  };
  update.rates.resize(3);
  check(update.rates[1].A_rate_W[4], 1e8);
  update.external.resize(3);
  check(update.external[1].F_W[2], 1e6);
}

TEST_CASE("Of two poses of one body the first counts") {
  BodyPoses poses(5);
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i].body = static_cast<std::uint32_t>(i);
  CHECK_FALSE(leave_out_copies(poses));
  CHECK(poses.size() == 5);
  poses[3].body = poses[4].body = 1;
  poses[1].X_WB.p.x() = 7;
  CHECK(leave_out_copies(poses) == 3);
  REQUIRE(poses.size() == 3);
  CHECK((poses[1].body == 1 && poses[1].X_WB.p.x() == 7 && poses[2].body == 2));
}

TEST_CASE("A chunk without data, or with more than there is room for, is refused") {
  const DatagramBytes good = encode(envelope_for<SceneChunk>(), documented_chunk());
  CHECK(decode_whatever(good) == std::nullopt);
  for (const int size : {0, 10}) {
    DatagramBytes bytes = good;
    bytes[48] = static_cast<std::byte>(size);
    CHECK(decode_whatever(bytes) == DropReason::kMalformed);
  }
  SceneChunk chunk;
  chunk.data.resize(kChunkSize);
  DatagramBytes longer = encode(envelope_for<SceneChunk>(), chunk);
  longer.push_back(std::byte{0});
  set_length(longer);
  longer[38] = static_cast<std::byte>(std::to_integer<int>(longer[38]) + 1);  // block
  CHECK(decode_whatever(longer) == std::nullopt);
  longer[48] = std::byte{1};  // 1025 bytes of data
  CHECK(decode_whatever(longer) == DropReason::kMalformed);
}

TEST_CASE("A value that this version has no name for is kept, not refused") {
  ProxyState state = documented_state();
  state.server = static_cast<ServerState>(9);
  Welcome welcome = documented_welcome();
  welcome.tuning.update_rule = static_cast<UpdateRule>(200);
  const DatagramBytes bytes = encode(envelope_for<Welcome>(), welcome);
  CHECK(decode_whatever(encode(envelope_for<ProxyState>(), state)) == std::nullopt);
  Welcome decoded;
  REQUIRE(decode(view(bytes), decoded) == std::nullopt);
  CHECK(name_of(decoded.tuning.update_rule) == "unknown");
}

TEST_CASE("A part of an update is checked by itself, and says what is wrong with which contact") {
  ContactUpdate update = test::planar_update(20);
  update.contacts[13].n_W = {0, 0, 1.01};
  const auto parts = all_parts(envelope_for<ContactUpdate>(), update);
  REQUIRE(parts.size() == 2);
  ContactUpdate scratch;
  CHECK_FALSE(decode_part(view(parts[0]), scratch));
  const auto error = decode_part(view(parts[1]), scratch);
  REQUIRE(error);
  CHECK(error->error == UpdateError::kNormal);
  CHECK((error->in_item && error->item == 13));
}

void check_in_range(const ProxyState& state) {
  CHECK(state.age >= 0);
  CHECK(state.hold >= 0);
  CHECK(std::abs(state.X_WD.R.norm() - 1) <= 1e-12);
  CHECK((state.q.allFinite() && state.v.allFinite() && state.F_command.allFinite()));
}

void check_in_range(const ContactUpdate& update) {
  CHECK(update.contacts.size() <= kMaxContacts);
  CHECK(update.compute_time >= 0);
  CHECK(update.q_VE.allFinite());
  for (const ReportedContact& contact : update.contacts) {
    CHECK(std::abs(contact.n_W.norm() - 1) <= 1e-12);
    CHECK(std::abs(contact.separation) <= kLargestLength);
    CHECK(contact.p_WC.cwiseAbs().maxCoeff() <= kLargestLength);
    CHECK(contact.v_WC.cwiseAbs().maxCoeff() <= kLargestSpeed);
    CHECK((std::isfinite(contact.friction) && contact.load >= 0));
  }
}

template <class Message>
void check_corruptions(const Message& message) {
  const auto original = all_parts(envelope_for<Message>(), message);
  for (std::size_t position = 0; position < original[0].size(); ++position) {
    for (const int flip : {0x01, 0x10, 0x80, 0xFF}) {
      auto parts = original;
      parts[0][position] ^= static_cast<std::byte>(flip);
      Message decoded;
      if (!decode_any(parts, decoded)) check_in_range(decoded);
    }
  }
}

TEST_CASE("Every single-byte corruption is refused or leaves every value in its range") {
  check_corruptions(documented_state());
  check_corruptions(test::planar_update(2));
}

DatagramBytes with(DatagramBytes bytes, std::size_t position, int value) {
  bytes[position] = static_cast<std::byte>(value);
  return bytes;
}

TEST_CASE("A header with any field out of its range is refused") {
  const DatagramBytes good = encode({.session = 7, .sequence = 1}, Goodbye{});
  REQUIRE(decode_whatever(good) == std::nullopt);
  CHECK(decode_whatever(with(good, 0, 'h')) == DropReason::kNotOurs);
  CHECK(decode_whatever(with(good, 2, 'S')) == DropReason::kSealed);
  CHECK(decode_whatever(with(good, 4, 3)) == DropReason::kVersion);
  CHECK(decode_whatever(with(good, 36, 42)) == DropReason::kTruncated);
  CHECK(decode_whatever(with(good, 36, 40)) == DropReason::kMalformed);
  CHECK(decode_whatever(with(good, 6, 0)) == DropReason::kUnexpected);
  CHECK(decode_whatever(with(good, 6, 15)) == DropReason::kUnexpected);
  CHECK(decode_whatever(with(good, 38, 0)) == DropReason::kMalformed);  // block
  CHECK(decode_whatever(with(good, 38, 2)) == DropReason::kMalformed);
  for (const std::size_t zero : {7u, 32u, 34u}) {
    CHECK(decode_whatever(with(good, zero, 1)) == DropReason::kMalformed);
  }
  CHECK(decode_whatever(with(good, 8, 0)) == DropReason::kMalformed);   // session
  CHECK(decode_whatever(with(good, 16, 0)) == DropReason::kMalformed);  // sequence
  CHECK(decode_whatever(with(good, 33, 2)) == DropReason::kMalformed);  // parts
  CHECK(decode_whatever(with(encode({}, documented_hello()), 8, 1)) == DropReason::kMalformed);
}

TEST_CASE("Parts that do not make one list are refused") {
  const auto parts = all_parts(envelope_for<ContactUpdate>(), test::planar_update(20));
  REQUIRE(parts.size() == 2);
  ContactUpdate update;
  CHECK(decode_any(parts, update) == std::nullopt);
  const auto refused = [&](std::size_t part, std::size_t position, int value) {
    auto changed = parts;
    changed[part][position] = static_cast<std::byte>(value);
    ContactUpdate decoded;
    return decode_any(changed, decoded);
  };
  // Where the lists of a planar update begin: bodies, then contacts.
  Header header;
  REQUIRE_FALSE(decode_header(view(parts[0]), header));
  const std::size_t contacts = layout::kHeaderSize + header.block + layout::kListHeaderSize;
  CHECK(refused(1, contacts, 9) == DropReason::kMalformed);       // first: a gap
  CHECK(refused(1, contacts + 2, 7) == DropReason::kMalformed);   // count: one is missing
  CHECK(refused(1, contacts + 4, 21) == DropReason::kMalformed);  // total differs
  CHECK(refused(1, contacts + 4, 193) == DropReason::kMalformed);
  CHECK(refused(1, contacts + 6, 99) == DropReason::kMalformed);  // items too short
  CHECK(refused(1, 32, 2) == DropReason::kMalformed);             // part
  CHECK(refused(1, 33, 3) == DropReason::kMalformed);             // parts
  CHECK(refused(0, 33, 65) == DropReason::kMalformed);
}

/// What decoding says of an update or state after `change`.
template <class Message, class Change>
std::optional<DropReason> refusal(Message message, Change change) {
  change(message);
  Message decoded;
  return decode_any(all_parts(envelope_for<Message>(), message), decoded);
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST_CASE("Numbers that are not finite are refused as such") {
  const auto update = test::planar_update(1);
  using U = ContactUpdate;
  CHECK(refusal(update, [](U& u) { u.ve_time = kNan; }) == DropReason::kNonFinite);
  CHECK(refusal(update, [](U& u) { u.q_VE[2] = kInfinity; }) == DropReason::kNonFinite);
  CHECK(refusal(update, [](U& u) { u.v_VE[0] = -kInfinity; }) == DropReason::kNonFinite);
  CHECK(refusal(update, [](U& u) { u.contacts[0].separation = kNan; }) == DropReason::kNonFinite);
  CHECK(refusal(update, [](U& u) { u.contacts[0].n_W.x() = kNan; }) == DropReason::kNonFinite);
  CHECK(refusal(documented_state(), [](ProxyState& s) { s.F_command[5] = kNan; }) ==
        DropReason::kNonFinite);
  CHECK(refusal(documented_hello(), [](Hello& h) { h.tool.links[0].mass = kInfinity; }) ==
        DropReason::kNonFinite);
}

TEST_CASE("Values out of their range are refused") {
  const auto update = test::planar_update(1);
  using U = ContactUpdate;
  CHECK(refusal(update, [](U& u) { u.ve_period = -1e-9; }) == DropReason::kMalformed);
  CHECK(refusal(update, [](U& u) { u.compute_time = -1e-9; }) == DropReason::kMalformed);
  CHECK(refusal(update, [](U& u) { u.echo_hold = -1e-9; }) == DropReason::kMalformed);
  CHECK(refusal(update, [](U& u) { u.contacts[0].n_W.z() = 1 + 2e-3; }) == DropReason::kMalformed);
  CHECK(refusal(update, [](U& u) { u.contacts[0].n_W.z() = 1 + 5e-4; }) == std::nullopt);
  CHECK(refusal(update, [](U& u) { u.contacts[0].v_WC.x() = 1e200; }) != std::nullopt);
  CHECK(refusal(update, [](U& u) { u.contacts[0].v_WC.x() = 1001; }) == DropReason::kMalformed);
  CHECK(refusal(update, [](U& u) { u.contacts[0].p_WC.x() = 1.1e4; }) == DropReason::kMalformed);
  CHECK(refusal(update, [](U& u) { u.contacts[0].load = -1; }) == DropReason::kMalformed);
  CHECK(refusal(documented_state(), [](ProxyState& s) { s.X_WD.R.w() = 0.998; }) ==
        DropReason::kMalformed);
  CHECK(refusal(test::reject_message("a\nb"), [](Reject&) {}) == DropReason::kMalformed);
  CHECK(refusal(Welcome{}, [](Welcome& w) { w.servo_rate = 0; }) == DropReason::kMalformed);
  CHECK(refusal(Control{}, [](Control& c) { c.tuning.stiffness = 0.5; }) == DropReason::kMalformed);
  CHECK(refusal(Control{}, [](Control& c) { c.tuning.restitution = 1.1; }) ==
        DropReason::kMalformed);
  Control signed_zero;
  signed_zero.tuned = true;
  signed_zero.tuning.damping = -0.0;
  Control received;
  REQUIRE_FALSE(decode(view(encode(envelope_for<Control>(), signed_zero)), received));
  CHECK_FALSE(std::signbit(received.tuning.damping));
  CHECK(refusal(Control{}, [](Control& c) { c.X_WTarget.R.w() = 2; }) == DropReason::kMalformed);
  CHECK(refusal(Control{}, [](Control& c) { c.X_WTarget.p.x() = std::nan(""); }) ==
        DropReason::kNonFinite);
}

TEST_CASE("A hello that a user could have meant otherwise is read, and said to be wrong") {
  const auto error = [](auto change) -> std::string {
    Hello hello = documented_hello();
    change(hello);
    Hello decoded;
    REQUIRE_FALSE(decode(view(encode({}, hello)), decoded));
    return find_error(decoded).value_or("");
  };
  CHECK(error([](Hello&) {}).empty());
  CHECK(error([](Hello& h) { h.ve_rate = 0; }) == "VE rate 0 Hz must be above 0 to 100000 Hz");
  CHECK_FALSE(error([](Hello& h) { h.epsilon = -1; }).empty());
  CHECK_FALSE(error([](Hello& h) { h.q[0] = 1e5; }).empty());
  CHECK_FALSE(error([](Hello& h) { h.tool.X_LH.p.x() = 1e200; }).empty());
  CHECK_FALSE(error([](Hello& h) { h.tool.gravity_W.y() = -1e6; }).empty());
  CHECK_FALSE(error([](Hello& h) { h.tool.links[0].mass = 1e300; }).empty());
  CHECK_FALSE(error([](Hello& h) { h.tool.length = 1e300; }).empty());
}

TEST_CASE("Parts of different messages do not make one") {
  const auto whole = [](double first_time, double second_time, std::uint64_t second_sequence) {
    const Envelope first{.session = 7, .sequence = 1};
    const Envelope second{.session = 7, .sequence = second_sequence};
    const std::vector parts{encode(first, test::planar_update(20, first_time), 0),
                            encode(second, test::planar_update(20, second_time), 1)};
    ContactUpdate update;
    return decode_any(parts, update);
  };
  CHECK(whole(1, 1, 1) == std::nullopt);
  CHECK(whole(1, 2, 1) == DropReason::kMalformed);
  CHECK(whole(1, 1, 2) == DropReason::kMalformed);
}

TEST_CASE("A message that does not belong to the session's tool is recognised") {
  const ToolDescription planar = test::planar_hello().tool;
  const ToolDescription free = test::rigid_tool(1, Matrix3::Identity());
  ContactUpdate update = test::planar_update(3);
  CHECK_FALSE(find_misfit(planar, update));
  REQUIRE(find_misfit(free, update));
  CHECK(find_misfit(free, update)->error == UpdateError::kTool);
  CHECK(find_misfit(free, update)->whole);
  update.contacts[1].a.index = 1;
  const auto side = find_misfit(planar, update);
  REQUIRE(side);
  CHECK((side->error == UpdateError::kSide && !side->whole && side->contact == 1));
  update = test::planar_update(3);
  update.contacts[2].identity = 0;
  const auto duplicate = find_misfit(planar, update);
  REQUIRE(duplicate);
  CHECK((duplicate->error == UpdateError::kDuplicate && duplicate->contact == 2));
  update = test::planar_update(3);
  update.external.resize(2);
  CHECK_FALSE(find_misfit(planar, update));
  update.external[1].link = 1;
  const auto link = find_misfit(planar, update);
  REQUIRE(link);
  CHECK((link->error == UpdateError::kSide && link->whole));

  ProxyState state = test::planar_state();
  CHECK(fits(planar, state));
  state.v.resize(2);
  CHECK_FALSE(fits(planar, state));

  Configuration q = ToolModel(free).neutral();
  CHECK(fits(free, q));
  q[3] = 0.99;
  CHECK_FALSE(fits(free, q));
  q[3] = 1 + 3e-6;  // what single precision leaves
  CHECK(fits(free, q));
  normalize(free, q);
  CHECK(q.segment<4>(3).norm() == Approx(1).epsilon(1e-15));
}

TEST_CASE("A reject of another version is understood") {
  Reject reject = test::reject_message("busy");
  reject.version = 3;
  DatagramBytes bytes = with(encode({}, reject), 4, 3);
  // What another version may have put elsewhere in its header.
  for (std::size_t i = 7; i < layout::kHeaderSize; ++i) bytes[i] = std::byte{0xEE};
  Reject decoded;
  REQUIRE(decode(view(bytes), decoded) == std::nullopt);
  CHECK(decoded.version == 3);
  CHECK(decoded.nonce == reject.nonce);
}

TEST_CASE("A body whose inverse inertia has a negative eigenvalue refuses its update") {
  ContactUpdate update;
  update.q_VE = Configuration::Zero(3);
  update.v_VE = Velocity::Zero(3);
  update.bodies.resize(2);
  for (MovableBody& body : update.bodies) body.W = Matrix6::Identity();
  update.bodies[1].id = 1;
  Matrix6& W = update.bodies[1].W;
  const auto error = [&] {
    ContactUpdate decoded;
    return decode_part(view(encode({.session = 1}, update, 0)), decoded);
  };
  W.diagonal() << 1, 1, 1, 1e4, 1e4, 1e4;
  CHECK_FALSE(error());
  W.setZero();  // does not move
  CHECK_FALSE(error());
  const Vector6 hinge = (Vector6() << 0.3, 0, -0.1, 0, 2, 0).finished();
  W = hinge * hinge.transpose();
  W +=
      1e-7 * W.cwiseAbs().maxCoeff() * Matrix6::Identity().colwise().reverse();  // single precision
  W = (0.5 * (W + W.transpose())).eval();
  CHECK_FALSE(error());

  const int wrong = GENERATE(0, 1, 2, 3);
  CAPTURE(wrong);
  W.setIdentity();
  if (wrong == 0) W(4, 4) = -1;
  if (wrong == 1) W(0, 1) = W(1, 0) = 1.1;
  if (wrong == 2) W(2, 5) = W(5, 2) = -1.01;
  if (wrong == 3) W = -1e-3 * hinge * hinge.transpose();
  REQUIRE(error());
  CHECK(error()->reason == DropReason::kMalformed);
  CHECK(error()->error == UpdateError::kRange);
  CHECK(error()->in_item);
  CHECK(error()->item == 1);
}

TEST_CASE("Whether a matrix is an inverse inertia agrees with its eigenvalues") {
  test::Random random;
  int refused = 0;
  constexpr int kTrials = 20000;
  for (int trial = 0; trial < kTrials; ++trial) {
    Matrix6 A;
    for (double& a : A.reshaped()) a = random.uniform(-1, 1);
    const int rank = static_cast<int>(random.uniform(0, 7));
    for (int i = rank; i < 6; ++i) A.col(i).setZero();
    Matrix6 W = A * A.transpose();
    // The same eigenvalues but one, well on either side of the tolerance.
    const double shift = random.uniform(-1, 1) < 0 ? -1e-3 : 1e-7;
    Vector6 n;
    for (double& a : n) a = random.uniform(-1, 1);
    W += shift * n * n.transpose();
    const double least = Eigen::SelfAdjointEigenSolver<Matrix6>(W).eigenvalues().minCoeff();
    if (least > -1e-7) CHECK(is_mobility(W));
    if (least < -3e-4) CHECK_FALSE(is_mobility(W));
    refused += least < -3e-4 ? 1 : 0;
  }
  CHECK(refused > kTrials / 20);
}

}  // namespace
}  // namespace hlm::protocol
