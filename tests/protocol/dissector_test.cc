// The Wireshark dissector shows every field of every message, and marks what is malformed.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "protocol/codec.h"
#include "protocol/transport/capture.h"
#include "tests/protocol/expected_fields.h"
#include "tests/protocol/sample_messages.h"
#include "tests/protocol/transport/capture_files.h"
#include "tests/protocol/tshark.h"
#include "tests/support/catch.h"

namespace hlm::protocol {
namespace {

constexpr Endpoint kClient{.address = 0x0A000002, .port = 50000};
constexpr Endpoint kServer{.address = 0x0A000001, .port = 47800};

const Envelope kInSession{.session = 0xFEDCBA9876543210,
                          .sequence = 0x8000000000000001,
                          .send_time = -1'234'567'890'123'456'789};
const Envelope kOutside{.session = 0, .sequence = 3, .send_time = 9'000'000'000'000'000'001};

/// True, after saying so, where there is no tshark to test with.
bool is_skipped() {
  if (test::tshark_is_installed()) return false;
  WARN("skipped: tshark is not installed");
  return true;
}

/// Envelope of a message of this type.
template <class Message>
Envelope envelope_of() {
  return std::is_same_v<Message, Hello> || std::is_same_v<Message, Reject> ? kOutside : kInSession;
}

template <class Message>
std::vector<DatagramBytes> all_parts(const Message& message) {
  std::vector<DatagramBytes> parts;
  for (std::uint8_t part = 0; part < part_count(message); ++part) {
    parts.push_back(encode(envelope_of<Message>(), message, part));
  }
  return parts;
}

template <class Message>
DatagramBytes only_part(const Message& message) {
  REQUIRE(part_count(message) == 1);
  return all_parts(message)[0];
}

/// A capture of messages, and what must be shown of each of its datagrams.
class Recording {
 public:
  explicit Recording(const std::filesystem::path& path) : writer_(path) {}

  void add(const DatagramBytes& bytes) {
    writer_.write(++time_, kClient, kServer, view(bytes));
    writer_.flush();
  }
  template <class Message>
  void add(const Message& message) {
    for (const DatagramBytes& part : all_parts(message)) {
      add(part);
      expected_.emplace_back(test::expected_part(message, view(part)), part.size());
    }
  }

  void check(const std::vector<std::vector<test::ShownField>>& packets) const {
    REQUIRE(packets.size() == expected_.size());
    for (std::size_t i = 0; i < packets.size(); ++i) {
      INFO("packet " << i + 1);
      expected_[i].first.check(packets[i], expected_[i].second);
    }
  }

 private:
  CaptureWriter writer_;
  std::int64_t time_ = 0;
  std::vector<std::pair<test::Expected, std::size_t>> expected_;
};

/// Messages of all types.
void add_every_message(Recording& recording) {
  test::Random random;
  for (int i = 0; i < 4; ++i) {
    const Hello hello = test::random_hello(random);
    recording.add(hello);
    recording.add(test::random_welcome(random));
    recording.add(test::random_update(random, hello.tool));
    recording.add(test::random_state(random, hello.tool));
    recording.add(test::random_control(random));
    recording.add(test::random_ticks(random));
    recording.add(test::random_local_state(random));
    recording.add(test::random_refusal(random));
    recording.add(test::random_impulses(random));
  }
  Hello largest = test::random_hello(random);
  largest.tool = test::largest_tool(random);
  largest.q = test::random_configuration(random, ToolModel(largest.tool));
  recording.add(largest);
  recording.add(test::planar_update(0));
  recording.add(test::planar_update(kMaxContacts));

  Welcome welcome;
  welcome.configuration = std::numeric_limits<std::uint64_t>::max();
  recording.add(welcome);
  const std::pair<RejectReason, const char*> refusals[] = {
      {RejectReason::kVersion, ""},
      {RejectReason::kBusy, "another client is here"},
      {RejectReason::kTool, "ε must be 0 m or more"},
  };
  for (const auto& [reason, text] : refusals) {
    Reject reject = test::reject_message(text);
    reject.reason = reason;
    reject.version = 513;
    recording.add(reject);
  }
  recording.add(Goodbye{GoodbyeReason::kFinished});
  recording.add(Goodbye{GoodbyeReason::kShutdown});
}

TEST_CASE("the dissector shows every field of every message, and no byte is left out") {
  if (is_skipped()) return;
  const test::TemporaryDirectory directory;
  const auto path = directory / "messages.pcap";
  Recording recording(path);
  add_every_message(recording);
  recording.check(test::dissect(path));
}

TEST_CASE("tshark finds all checksums right and no message of ours malformed") {
  if (is_skipped()) return;
  const test::TemporaryDirectory directory;
  const auto path = directory / "messages.pcap";
  Recording recording(path);
  add_every_message(recording);
  const auto packets =
      test::lines(test::tshark(path,
                               "-o ip.check_checksum:TRUE -o udp.check_checksum:TRUE -T fields "
                               "-e ip.checksum.status -e udp.checksum.status -e _ws.col.Protocol "
                               "-e _ws.expert.message"));
  CHECK(packets.size() > 20);
  // Status 1 is "good"; the last column, expert information, is empty.
  for (const std::string& packet : packets) CHECK(packet == "1\t1\tHLM\t");
}

/// An enumeration's names by their values.
template <class Enum>
std::map<int, std::string> names() {
  std::map<int, std::string> table;
  for (const Word<Enum>& word : kWords<Enum>)
    table.emplace(static_cast<int>(word.value), word.name);
  return table;
}

TEST_CASE("the dissector's names are those of the vocabulary") {
  if (is_skipped()) return;
  const std::map<std::string, std::map<int, std::string>> vocabulary = {
      {"hlm.type", names<MessageType>()},
      {"hlm.link.joint", names<JointType>()},
      {"hlm.welcome.update_rule", names<UpdateRule>()},
      {"hlm.welcome.controller", names<ControllerKind>()},
      {"hlm.control.update_rule", names<UpdateRule>()},
      {"hlm.control.controller", names<ControllerKind>()},
      {"hlm.reject.reason", names<RejectReason>()},
      {"hlm.contact.a.kind", names<SideKind>()},
      {"hlm.contact.b.kind", names<SideKind>()},
      {"hlm.proxy_state.server", names<ServerState>()},
      {"hlm.proxy_state.fault", names<Fault>()},
      {"hlm.proxy_state.contact_state", names<ProxyContactState>()},
      {"hlm.proxy_state.limit", names<ForceLimit>()},
      {"hlm.goodbye.reason", names<GoodbyeReason>()},
      {"hlm.local_contact.a.kind", names<SideKind>()},
      {"hlm.local_contact.b.kind", names<SideKind>()},
      {"hlm.local_contact.state", names<ContactState>()},
      {"hlm.refusal.error", names<UpdateError>()},
  };
  const std::map<int, std::string> flag = {{0, "no"}, {1, "yes"}};
  const test::TemporaryDirectory directory;
  std::size_t found = 0;
  for (const auto& [field, table] : test::dissector_names(directory / "configuration")) {
    INFO(field);
    const auto words = vocabulary.find(field);
    found += words != vocabulary.end();
    CHECK(table == (words == vocabulary.end() ? flag : words->second));
  }
  CHECK(found == vocabulary.size());
}

TEST_CASE("the information column says which message it is, and how long its lists are") {
  if (is_skipped()) return;
  const test::TemporaryDirectory directory;
  const auto path = directory / "messages.pcap";
  Recording recording(path);
  recording.add(test::planar_hello());
  recording.add(test::planar_update(15));
  ProxyState state = test::planar_state();
  state.acknowledged = 12;
  recording.add(state);
  recording.add(Goodbye{});
  const std::string sequence = std::to_string(kInSession.sequence);
  CHECK(test::lines(test::tshark(path, "-T fields -e _ws.col.Info")) ==
        std::vector<std::string>{
            "hello 3, links 1",
            "contact_update " + sequence + ", part 1 of 2, bodies 0, contacts 15",
            "contact_update " + sequence + ", part 2 of 2, bodies 0, contacts 15",
            "proxy_state " + sequence + ", acknowledges 12",
            "goodbye " + sequence,
        });
}

/// The bytes with a little-endian number of `size` bytes written at `at`.
DatagramBytes with(DatagramBytes bytes, std::size_t at, std::size_t size, std::uint64_t value) {
  for (std::size_t i = 0; i < size; ++i) bytes[at + i] = static_cast<std::byte>(value >> (8 * i));
  return bytes;
}

DatagramBytes resized(DatagramBytes bytes, std::size_t size) {
  bytes.resize(size, std::byte{0});
  return bytes;
}

constexpr std::size_t kTypeAt = 6;
constexpr std::size_t kPartAt = 32;
constexpr std::size_t kPartsAt = 33;
constexpr std::size_t kLengthAt = 36;
constexpr std::size_t kBlockAt = 38;

/// The same with the length field of the header to match: only the contents do not fit.
DatagramBytes relabelled(const DatagramBytes& bytes, std::size_t size) {
  return with(resized(bytes, size), kLengthAt, 2, size);
}

std::uint16_t block_size(const DatagramBytes& bytes) {
  Header header;
  REQUIRE_FALSE(decode_header(view(bytes), header));
  return header.block;
}

/// Where the header of the first list stands.
std::size_t first_list(const DatagramBytes& bytes) {
  return layout::kHeaderSize + block_size(bytes);
}

/// Datagrams, and whether the codec refuses each; the dissector must agree.
class Verdicts {
 public:
  /// One datagram that is its whole message.
  template <class Message>
  void add(const std::string& name, const DatagramBytes& bytes) {
    Message decoded;
    cases_.push_back({name, bytes, decode(view(bytes), decoded).has_value()});
  }
  /// The message after `change`.
  template <class Message, class Change>
  void add_changed(const std::string& name, Message message, Change change) {
    change(message);
    add<Message>(name, only_part(message));
  }
  /// One part of a message, of which it alone has been changed.
  template <class Message>
  void add_part(const std::string& name, std::vector<DatagramBytes> parts, std::size_t part,
                const DatagramBytes& bytes) {
    parts[part] = bytes;
    Message decoded;
    const auto reason = decode(std::span<const DatagramBytes>(parts), decoded);
    cases_.push_back({name, bytes, reason.has_value()});
  }

  /// Fails unless tshark marks as malformed what the codec refuses, and nothing else.
  void check(const std::filesystem::path& path) const {
    Recording recording(path);
    for (const Case& one : cases_) recording.add(one.bytes);
    const auto marks = test::lines(test::tshark(path, "-T fields -e hlm.malformed"));
    REQUIRE(marks.size() == cases_.size());
    for (std::size_t i = 0; i < marks.size(); ++i) {
      INFO("packet " << i + 1 << ": " << cases_[i].name);
      CHECK(!marks[i].empty() == cases_[i].refused);
    }
  }
  std::size_t refused() const {
    return static_cast<std::size_t>(
        std::ranges::count_if(cases_, [](const Case& one) { return one.refused; }));
  }
  std::size_t size() const { return cases_.size(); }

 private:
  struct Case {
    std::string name;
    DatagramBytes bytes;
    bool refused = false;
  };
  std::vector<Case> cases_;
};

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

void add_wrong_headers(Verdicts& verdicts) {
  const DatagramBytes update = only_part(test::planar_update(5));
  const DatagramBytes goodbye = only_part(Goodbye{});
  const DatagramBytes reject = only_part(test::reject_message(""));
  using U = ContactUpdate;
  verdicts.add<U>("cut off in the header", resized(update, 39));
  verdicts.add<U>("cut off after the header", relabelled(update, 40));
  verdicts.add<U>("a byte short", resized(update, update.size() - 1));
  verdicts.add<U>("a byte too long", resized(update, update.size() + 1));
  verdicts.add<U>("length field too large", with(update, kLengthAt, 2, 1201));
  verdicts.add<U>("flags", with(update, 7, 1, 1));
  verdicts.add<U>("session 0", with(update, 8, 8, 0));
  verdicts.add<Reject>("a reject in a session", with(reject, 8, 8, 1));
  verdicts.add<U>("sequence 0", with(update, 16, 8, 0));
  verdicts.add<U>("part beyond the last", with(update, kPartAt, 1, 1));
  verdicts.add<U>("too many parts", with(update, kPartsAt, 1, 65));
  verdicts.add<Goodbye>("a goodbye in parts", with(goodbye, kPartsAt, 1, 2));
  verdicts.add<U>("another tool", with(update, 34, 1, 1));
  verdicts.add<Goodbye>("no block", with(goodbye, kBlockAt, 2, 0));
  verdicts.add<Goodbye>("a block beyond the datagram", with(goodbye, kBlockAt, 2, 2));
  verdicts.add<U>("a block too short", with(update, kBlockAt, 2, block_size(update) - 1u));
}

void add_wrong_lists(Verdicts& verdicts) {
  const DatagramBytes update = only_part(test::planar_update(5));
  const std::size_t contacts = first_list(update) + layout::kListHeaderSize;
  constexpr std::size_t kContactSize = layout::kItemSize<ReportedContact>;
  using U = ContactUpdate;
  verdicts.add<U>("an item cut off", relabelled(update, update.size() - 1));
  verdicts.add<U>("a list header cut off", relabelled(update, contacts + 7));
  verdicts.add<U>("items beyond the total", with(update, contacts + 4, 2, 4));
  verdicts.add<U>("items missing", with(update, contacts + 4, 2, 6));
  verdicts.add<U>("items missing in front", with(with(update, contacts, 2, 1), contacts + 4, 2, 6));
  verdicts.add<U>("items too short", with(update, contacts + 6, 2, kContactSize - 1));
  verdicts.add<U>("an item longer than the datagram",
                  with(only_part(test::planar_update(1)), contacts + 6, 2, kContactSize + 1));

  const auto parts = all_parts(test::planar_update(20));
  REQUIRE(parts.size() == 2);
  verdicts.add_part<U>("the first part lacks the first item", parts, 0,
                       with(parts[0], contacts, 2, 1));
  verdicts.add_part<U>("the last part lacks the last item", parts, 1,
                       with(parts[1], contacts + 4, 2, 21));

  const auto too_many = [&]<class Message>(const Message& message, std::size_t most) {
    const DatagramBytes bytes = only_part(message);
    const std::size_t total = first_list(bytes) + 4;
    verdicts.add<Message>("too many items", with(bytes, total, 2, most + 1));
  };
  too_many(test::planar_hello(), kMaxLinks);
  too_many(ContactUpdate(test::planar_update(0)), kMaxBodies);
  too_many(Ticks{}, kTicksPerMessage);
  too_many(LocalState{}, kMaxReportedContacts);
  too_many(Impulses{}, kMaxBodies);
  verdicts.add<U>("too many contacts", with(update, contacts + 4, 2, kMaxContacts + 1));
}

void add_wrong_numbers(Verdicts& verdicts) {
  const ContactUpdate update = test::planar_update(1);
  using U = ContactUpdate;
  const auto wrong = [&](const char* name, auto change) {
    verdicts.add_changed(name, update, change);
  };
  wrong("not finite", [](U& u) { u.ve_time = kNan; });
  wrong("not finite in q", [](U& u) { u.q_VE[2] = kNan; });
  wrong("not finite in a contact", [](U& u) { u.contacts[0].friction = kNan; });
  wrong("negative time", [](U& u) { u.ve_period = -1e-9; });
  wrong("negative load", [](U& u) { u.contacts[0].load = -1; });
  wrong("a place too far", [](U& u) { u.q_VE[0] = 10001; });
  wrong("a speed too high", [](U& u) { u.v_VE[0] = -1001; });
  wrong("a contact too far", [](U& u) { u.contacts[0].p_WC.y() = -10001; });
  wrong("a contact too fast", [](U& u) { u.contacts[0].v_WC.z() = 1001; });
  wrong("too deep", [](U& u) { u.contacts[0].separation = -10001; });
  wrong("a normal too long", [](U& u) { u.contacts[0].n_W.z() = 1.0011; });
  wrong("a normal too short", [](U& u) { u.contacts[0].n_W.z() = 0.9989; });
  wrong("a body too far", [](U& u) { u.bodies.resize(1), u.bodies[0].p_WCom.x() = 10001; });
  wrong("a body too fast", [](U& u) { u.bodies.resize(1), u.bodies[0].V_W[5] = 1001; });
  wrong("too much acceleration", [](U& u) { u.bodies.resize(1), u.bodies[0].A_W[0] = 1.1e6; });
  const DatagramBytes bytes = only_part(update);
  constexpr std::size_t kSizes = layout::kHeaderSize + 48;
  verdicts.add<U>("no coordinates", with(bytes, kSizes, 1, 0));
  verdicts.add<U>("too many coordinates", with(bytes, kSizes, 1, kMaxConfiguration + 1));
  verdicts.add<U>("too many velocities", with(bytes, kSizes + 1, 1, kMaxDof + 1));

  const auto hello = test::planar_hello();
  verdicts.add_changed("no rate", hello, [](Hello& h) { h.ve_rate = 0; });
  verdicts.add_changed("negative radius", hello, [](Hello& h) { h.epsilon = -1e-9; });
  verdicts.add_changed("no scale", Welcome{}, [](Welcome& w) { w.device.scale = 0; });
  verdicts.add_changed("no fade", Welcome{}, [](Welcome& w) { w.fade_time = 0; });
  verdicts.add_changed("negative force", Welcome{}, [](Welcome& w) { w.device.max_force = -1; });
  const auto state = test::planar_state();
  verdicts.add_changed("a wrong quaternion", state, [](ProxyState& s) { s.X_WD.R.w() = 0.998; });
  verdicts.add_changed("a target's quaternion", Control{},
                       [](Control& c) { c.X_WTarget.R.w() = 2; });
  verdicts.add_changed("step 0", Ticks{}, [](Ticks& t) { t.first_step = 0; });
  verdicts.add_changed("a control character", test::reject_message(""),
                       [](Reject& r) { r.text = test::text("a\nb"); });
  verdicts.add_changed("a byte of 0 in a name", Welcome{},
                       [](Welcome& w) { w.device.name.resize(3, char{0}); });
  const DatagramBytes reject = only_part(test::reject_message(""));
  verdicts.add<Reject>("text longer than the datagram", with(reject, 49, 1, 1));
  verdicts.add<Refusal>("neither yes nor no", with(only_part(Refusal{}), 49, 1, 2));
  for (const TuningRange& range : kTuningRanges) {
    for (const double number : {range.least - 1e-3, range.most * 1.001}) {
      verdicts.add_changed(range.name, Control{},
                           [&](Control& c) { c.tuning.*range.number = number; });
    }
  }
}

TEST_CASE("the dissector marks what a receiver must refuse as malformed") {
  if (is_skipped()) return;
  Verdicts verdicts;
  add_wrong_headers(verdicts);
  add_wrong_lists(verdicts);
  add_wrong_numbers(verdicts);
  CHECK(verdicts.refused() == verdicts.size());
  const test::TemporaryDirectory directory;
  verdicts.check(directory / "refused.pcap");
}

TEST_CASE("the dissector does not mark numbers at the ends of their ranges") {
  if (is_skipped()) return;
  Verdicts verdicts;
  verdicts.add_changed("update", test::planar_update(1), [](ContactUpdate& u) {
    u.ve_period = 0;
    u.q_VE[0] = 1e4;
    u.v_VE[0] = -1e3;
    u.contacts[0].v_WC.z() = -1e3;
    u.contacts[0].separation = 1e4;
    u.contacts[0].n_W.z() = 1.0009;
    u.bodies.resize(1);
    u.bodies[0].A_W[0] = -1e6;
  });
  for (const TuningRange& range : kTuningRanges) {
    for (const double number : {range.least, range.most}) {
      verdicts.add_changed(range.name, Control{},
                           [&](Control& c) { c.tuning.*range.number = number; });
    }
  }
  // Of a welcome the receiver does not check them.
  verdicts.add_changed("welcome", Welcome{}, [](Welcome& w) { w.tuning.restitution = 2; });
  CHECK(verdicts.refused() == 0);
  const test::TemporaryDirectory directory;
  verdicts.check(directory / "accepted.pcap");
}

TEST_CASE("the dissector and the codec agree on messages with a few random bytes") {
  if (is_skipped()) return;
  test::Random random;
  Verdicts verdicts;
  const auto mutate = [&]<class Message>(const Message& message) {
    DatagramBytes bytes = encode(envelope_of<Message>(), message);
    const int mutations = random.integer(1, 3);
    for (int i = 0; i < mutations; ++i) {
      // Behind the type. In place of another part the codec looks at all parts, tshark at one.
      const auto at =
          static_cast<std::size_t>(random.integer(7, static_cast<int>(bytes.size()) - 1));
      if (at == kPartAt || at == kPartsAt) continue;
      bytes[at] = static_cast<std::byte>(random.integer(0, 255));
    }
    verdicts.add<Message>(std::string(name_of(kTypeOf<Message>)), bytes);
  };
  for (int i = 0; i < 100; ++i) {
    mutate(test::planar_hello());
    mutate(test::random_welcome(random));
    mutate(test::reject_message("busy"));
    mutate(test::planar_update(5));
    mutate(test::planar_state());
    mutate(Goodbye{});
    mutate(test::random_control(random));
    mutate(test::random_ticks(random));
    LocalState local = test::random_local_state(random);
    local.contacts.resize(std::min<std::size_t>(local.contacts.size(), 5));
    mutate(local);
    mutate(test::random_refusal(random));
    mutate(test::random_impulses(random));
  }
  CHECK(verdicts.refused() > 100);
  CHECK(verdicts.size() - verdicts.refused() > 100);
  const test::TemporaryDirectory directory;
  verdicts.check(directory / "mutated.pcap");
}

/// The text of the field of that name; empty if it is not shown.
std::string shown_text(const std::vector<test::ShownField>& fields, const std::string& name) {
  const auto field = std::ranges::find(fields, name, &test::ShownField::name);
  return field == fields.end() ? "" : field->text;
}

TEST_CASE("a value without a name is shown as unknown, and not marked") {
  if (is_skipped()) return;
  const test::TemporaryDirectory directory;
  const auto path = directory / "unknown.pcap";
  Recording recording(path);
  ProxyState state = test::planar_state();
  state.server = static_cast<ServerState>(9);
  recording.add(state);
  ContactUpdate update = test::planar_update(1);
  update.contacts[0].b.kind = static_cast<SideKind>(3);
  recording.add(update);
  Welcome welcome;
  welcome.tuning.update_rule = static_cast<UpdateRule>(200);
  recording.add(welcome);
  const auto packets = test::dissect(path);
  recording.check(packets);
  CHECK(shown_text(packets.at(0), "hlm.proxy_state.server") == "Server: unknown (9)");
  CHECK(test::tshark(path, "-T fields -e _ws.expert.message") == "\n\n\n");
}

TEST_CASE("what a newer version appends is shown as such, and not marked") {
  if (is_skipped()) return;
  const test::TemporaryDirectory directory;
  const auto path = directory / "newer.pcap";
  const auto appended = [](const DatagramBytes& bytes, std::size_t count) {
    DatagramBytes longer = bytes;
    longer.insert(longer.end(), count, std::byte{0xEE});
    return relabelled(longer, longer.size());
  };
  const DatagramBytes refusal = appended(only_part(Refusal{}), 5);
  const DatagramBytes update = only_part(test::planar_update(1));
  const DatagramBytes longer = appended(update, 8);
  const std::size_t item_size = first_list(update) + layout::kListHeaderSize + 6;
  Recording recording(path);
  recording.add(with(refusal, kBlockAt, 2, block_size(refusal) + 5u));
  recording.add(refusal);
  recording.add(with(longer, item_size, 2, layout::kItemSize<ReportedContact> + 8));
  recording.add(with(only_part(Goodbye{}), kTypeAt, 1, 12));
  const auto shown =
      test::lines(test::tshark(path,
                               "-T fields -E separator=, -e hlm.newer_fields -e hlm.newer_lists "
                               "-e hlm.contact.load -e hlm.newer_message -e _ws.expert.message"));
  CHECK(shown == std::vector<std::string>{
                     "eeeeeeeeee,,,,",
                     ",eeeeeeeeee,,,",
                     "eeeeeeeeeeeeeeee,,0,,",
                     ",,,00,A type of message of a newer version",
                 });
}

TEST_CASE(
    "the dissector knows its messages on any port, and leaves other things on its own port alone") {
  if (is_skipped()) return;
  const test::TemporaryDirectory directory;
  const auto path = directory / "ports.pcap";
  CaptureWriter writer(path);
  const DatagramBytes goodbye = encode(kInSession, Goodbye{});
  writer.write(1, kClient, Endpoint{.address = 1, .port = 12345}, view(goodbye));
  writer.write(2, kClient, kServer, std::as_bytes(std::span("HLM")));
  writer.write(3, kClient, kServer, std::as_bytes(std::span("Hello, who are you?")));
  writer.write(4, kClient, kServer, {});
  writer.flush();
  const auto protocols = test::lines(test::tshark(path, "-T fields -e frame.protocols"));
  CHECK(protocols == std::vector<std::string>{"raw:ip:udp:hlm", "raw:ip:udp:data",
                                              "raw:ip:udp:data", "raw:ip:udp"});
}

TEST_CASE("of another version the dissector shows what never changes, and of a reject everything") {
  if (is_skipped()) return;
  const test::TemporaryDirectory directory;
  const auto path = directory / "versions.pcap";
  Recording recording(path);
  constexpr std::uint16_t kOther = kProtocolVersion + 1;
  DatagramBytes reject = only_part(test::reject_message("busy"));
  for (std::size_t i = kTypeAt + 1; i < layout::kHeaderSize; ++i) reject[i] = std::byte{0xEE};
  recording.add(with(only_part(test::planar_hello()), 4, 2, kOther));
  recording.add(with(reject, 4, 2, kOther));
  const auto shown = test::lines(
      test::tshark(path,
                   "-T fields -E separator=, -e _ws.col.Info -e hlm.sequence -e hlm.hello.nonce "
                   "-e hlm.reject.nonce -e hlm.reject.text -e hlm.malformed "
                   "-e _ws.expert.message"));
  CHECK(shown ==
        std::vector<std::string>{
            "hello of version 3,,,,,,Another version of the protocol",
            "reject of version 3,,,0x0000000000000001,busy,,Another version of the protocol",
        });
}

}  // namespace
}  // namespace hlm::protocol
