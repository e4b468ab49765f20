// The Wireshark dissector shows every field of every message, of other versions what it can.
#include <algorithm>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "tests/protocol/dissector_recording.h"
#include "tests/protocol/sample_messages.h"
#include "tests/protocol/transport/capture_files.h"

namespace hlm::protocol {
namespace {

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
    recording.add(test::random_held(random));
    recording.add(test::random_chunk(random));
    recording.add(test::random_scene_state(random));
  }
  Hello largest = test::random_hello(random);
  largest.tool = test::largest_tool(random);
  largest.q = test::random_configuration(random, ToolModel(largest.tool));
  recording.add(largest);
  recording.add(test::planar_update(0));
  recording.add(test::planar_update(kMaxContacts));

  Welcome welcome;
  welcome.fingerprint = std::numeric_limits<std::uint64_t>::max();
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

TEST_CASE("The dissector shows every field of every message, and no byte is left out") {
  if (is_skipped()) return;
  const test::TemporaryDirectory directory;
  const auto path = directory / "messages.pcap";
  Recording recording(path);
  add_every_message(recording);
  recording.check(test::dissect(path));
}

TEST_CASE("Tshark finds all checksums right and no message of ours malformed") {
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

TEST_CASE("The dissector's names are those of the vocabulary") {
  if (is_skipped()) return;
  const std::map<std::string, std::map<int, std::string>> vocabulary = {
      {"hlm.type", names<MessageType>()},
      {"hlm.packet.type", names<PacketType>()},
      {"hlm.link.joint", names<JointType>()},
      {"hlm.welcome.update_rule", names<UpdateRule>()},
      {"hlm.welcome.controller", names<ControllerKind>()},
      {"hlm.control.update_rule", names<UpdateRule>()},
      {"hlm.control.controller", names<ControllerKind>()},
      {"hlm.reject.reason", names<RejectReason>()},
      {"hlm.contact.a_kind", names<SideKind>()},
      {"hlm.contact.b_kind", names<SideKind>()},
      {"hlm.contact.plane", names<PlaneOwner>()},
      {"hlm.body.round", names<Roundness>()},
      {"hlm.proxy_state.server", names<ServerState>()},
      {"hlm.proxy_state.fault", names<Fault>()},
      {"hlm.proxy_state.fade", names<Fade>()},
      {"hlm.proxy_state.contact_state", names<ProxyContactState>()},
      {"hlm.proxy_state.limit", names<ForceLimit>()},
      {"hlm.tick.limit", names<ForceLimit>()},
      {"hlm.goodbye.reason", names<GoodbyeReason>()},
      {"hlm.local_contact.a_kind", names<SideKind>()},
      {"hlm.local_contact.b_kind", names<SideKind>()},
      {"hlm.local_contact.state", names<ContactState>()},
      {"hlm.refusal.error", names<UpdateError>()},
      {"hlm.scene_state.error", names<SceneError>()},
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

TEST_CASE("The information column says which message it is, and how long its lists are") {
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

TEST_CASE(
    "Of sealed datagrams the dissector shows all that can be read, and marks a wrong length") {
  if (is_skipped()) return;
  const test::TemporaryDirectory directory;
  const auto path = directory / "sealed.pcap";
  Recording recording(path);
  const DatagramBytes packets[] = {
      resized(initiation_header(), kInitiationSize),
      resized(response_header(0x01020304), kResponseSize),
      resized(sealed_header(0x05060708, 1ull << 40u), kSealRoom + 41),
      resized(initiation_header(), kInitiationSize + 1),
      resized(response_header(0x01020304), kResponseSize - 1),
      resized(sealed_header(0x05060708, 0), kSealRoom - 1),
  };
  for (const DatagramBytes& packet : packets) recording.add(packet);
  CHECK(test::lines(test::tshark(path, "-T fields -e _ws.col.Protocol -e _ws.col.Info")) ==
        std::vector<std::string>{
            "HLM\tinitiation",
            "HLM\tresponse to 01020304",
            "HLM\tsealed 1099511627776 to 05060708, 41 bytes",
            "HLM\tinitiation",
            "HLM\tresponse to 01020304",
            "HLM\tsealed 0 to 05060708",
        });
  const auto marks = test::lines(test::tshark(path, "-T fields -e hlm.malformed"));
  REQUIRE(marks.size() == std::size(packets));
  for (std::size_t i = 0; i < marks.size(); ++i) CHECK(marks[i].empty() == (i < 3));
  const auto shown = test::dissect(path);
  for (std::size_t i = 0; i < 3; ++i) {
    std::size_t bytes = 0;
    for (const test::ShownField& field : shown[i]) bytes += field.size;
    CHECK(bytes == packets[i].size());
  }
}

/// The text of the field of that name; empty if it is not shown.
std::string shown_text(const std::vector<test::ShownField>& fields, const std::string& name) {
  const auto field = std::ranges::find(fields, name, &test::ShownField::name);
  return field == fields.end() ? "" : field->text;
}

TEST_CASE("A value without a name is shown as unknown, and not marked") {
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
  CHECK(shown_text(packets.at(0), "hlm.proxy_state.server") == "server: unknown (9)");
  CHECK(test::tshark(path, "-T fields -e _ws.expert.message") == "\n\n\n");
}

TEST_CASE("What a newer version appends is shown as such, and not marked") {
  if (is_skipped()) return;
  const test::TemporaryDirectory directory;
  const auto path = directory / "newer.pcap";
  const auto appended = [](const DatagramBytes& bytes, std::size_t count) {
    DatagramBytes longer = bytes;
    longer.insert(longer.end(), count, std::byte{0xEE});
    return relabelled(longer, longer.size());
  };
  const DatagramBytes refusal = appended(only_part(Refusal{}), 5);
  LocalState state;
  state.contacts.resize(1);
  const DatagramBytes local = only_part(state);
  const DatagramBytes longer = appended(local, 8);
  const std::size_t item_size = first_list(local) + 6;
  Recording recording(path);
  recording.add(with(refusal, kBlockAt, 2, block_size(refusal) + 5u));
  recording.add(refusal);
  recording.add(with(longer, item_size, 2, layout::kItemSize<LocalContactReport> + 8));
  recording.add(with(only_part(Goodbye{}), kTypeAt, 1, 15));
  const auto shown = test::lines(
      test::tshark(path,
                   "-T fields -E separator=, -e hlm.newer_fields -e hlm.newer_lists "
                   "-e hlm.local_contact.s -e hlm.newer_message -e _ws.expert.message"));
  CHECK(shown == std::vector<std::string>{
                     "eeeeeeeeee,,,,",
                     ",eeeeeeeeee,,,",
                     "eeeeeeeeeeeeeeee,,0,,",
                     ",,,00,A type of message of a newer version",
                 });
}

TEST_CASE(
    "The dissector knows its messages on any port, and leaves other things on its own port alone") {
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

TEST_CASE("Of another version the dissector shows what never changes, and of a reject everything") {
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
