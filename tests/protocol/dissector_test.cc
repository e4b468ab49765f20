// The Wireshark dissector shows every field of every message, and marks what is malformed.
#include <algorithm>
#include <bit>
#include <limits>

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

/// A capture of messages, and what must be shown of each of its datagrams.
class Recording {
 public:
  explicit Recording(const std::filesystem::path& path) : writer_(path) {}

  void add(const DatagramBytes& bytes) {
    writer_.write(++time_, kClient, kServer, view(bytes));
    writer_.flush();
  }
  template <class Message>
  void add(MessageType type, const Envelope& envelope, const Message& message) {
    add_part(type, envelope, message, {}, {});
  }
  void add(const Hello& hello) {
    constexpr std::size_t kLinksPerPart = 5;
    add_parts(MessageType::kHello, kOutside, hello, hello.tool.links, kLinksPerPart);
  }
  void add(const ContactUpdate& update) {
    constexpr std::size_t kContactsPerPart = 9;
    add_parts(MessageType::kContactUpdate, kInSession, update, update.contacts, kContactsPerPart);
  }

  void add(const Ticks& ticks) {
    add_parts(MessageType::kTicks, kInSession, ticks, ticks.ticks, kTicksPerMessage);
  }
  void add(const LocalState& state) {
    constexpr std::size_t kContactsPerPart = 10;
    add_parts(MessageType::kLocalState, kInSession, state, state.contacts, kContactsPerPart);
  }

  void check(const std::vector<std::vector<test::ShownField>>& packets) const {
    REQUIRE(packets.size() == expected_.size());
    for (std::size_t i = 0; i < packets.size(); ++i) {
      INFO("packet " << i + 1);
      expected_[i].first.check(packets[i], expected_[i].second);
    }
  }

 private:
  template <class Message, class Items>
  void add_parts(MessageType type, const Envelope& envelope, const Message& message,
                 const Items& items, std::size_t per_part) {
    const std::size_t parts = std::max<std::size_t>(1, (items.size() + per_part - 1) / per_part);
    for (std::size_t part = 0; part < parts; ++part) {
      const std::size_t first = part * per_part;
      const std::size_t end = std::min(first + per_part, items.size());
      std::vector<test::Expected> shown_items;
      for (std::size_t i = first; i < end; ++i)
        shown_items.push_back(test::expected_item(items[i]));
      add_part(type, envelope, message,
               {.part = static_cast<std::uint8_t>(part),
                .parts = static_cast<std::uint8_t>(parts),
                .items = static_cast<std::uint8_t>(end - first),
                .items_total = static_cast<std::uint8_t>(items.size())},
               shown_items);
    }
  }
  template <class Message>
  void add_part(MessageType type, const Envelope& envelope, const Message& message,
                const Slice& slice, const std::vector<test::Expected>& items) {
    const DatagramBytes bytes = encode(envelope, message, slice.part);
    add(bytes);
    test::Expected fields = test::expected_header(type, envelope, slice, bytes.size());
    fields.append(test::expected_body(message));
    for (const test::Expected& item : items) fields.append(item);
    expected_.emplace_back(std::move(fields), bytes.size());
  }

  CaptureWriter writer_;
  std::int64_t time_ = 0;
  std::vector<std::pair<test::Expected, std::size_t>> expected_;
};

/// Messages of all types, whose enumerations take all their values.
void add_every_message(Recording& recording) {
  test::Random random;
  for (std::uint8_t i = 0; i < 4; ++i) {
    const Hello hello = test::random_hello(random);
    recording.add(hello);
    recording.add(test::random_update(random, hello.tool));
    ProxyState state = test::random_state(random, hello.tool);
    state.server = static_cast<ServerState>(i);
    state.fault = static_cast<Fault>(i);
    state.contact_state = static_cast<ProxyContactState>(i % 3);
    recording.add(MessageType::kProxyState, kInSession, state);
    recording.add(MessageType::kControl, kInSession, test::random_control(random));
    recording.add(test::random_ticks(random));
    LocalState local = test::random_local_state(random);
    local.limit = static_cast<ForceLimit>(i + 1);
    recording.add(local);
  }
  Hello largest = test::random_hello(random);
  largest.tool = test::largest_tool(random);
  largest.q = test::random_configuration(random, ToolModel(largest.tool));
  recording.add(largest);
  recording.add(test::planar_update(0));
  recording.add(test::planar_update(kMaxContacts));

  const std::uint64_t all_ones = std::numeric_limits<std::uint64_t>::max();
  recording.add(MessageType::kWelcome, kInSession,
                Welcome{.nonce = 5, .servo_rate = 1234.5, .configuration = all_ones, .tuning = {}});
  const std::pair<RejectReason, const char*> refusals[] = {
      {RejectReason::kVersion, ""},
      {RejectReason::kBusy, "another client is here"},
      {RejectReason::kTool, "ε must be 0 m or more"},
  };
  for (const auto& [reason, text] : refusals) {
    Reject reject = test::reject_message(text);
    reject.reason = reason;
    reject.version = 513;
    recording.add(MessageType::kReject, kOutside, reject);
  }
  recording.add(MessageType::kGoodbye, kInSession, Goodbye{GoodbyeReason::kFinished});
  recording.add(MessageType::kGoodbye, kInSession, Goodbye{GoodbyeReason::kShutdown});
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

/// The bytes with a little-endian number of `size` bytes written at `at`.
DatagramBytes with(DatagramBytes bytes, std::size_t at, std::size_t size, std::uint64_t value) {
  for (std::size_t i = 0; i < size; ++i) bytes[at + i] = static_cast<std::byte>(value >> (8 * i));
  return bytes;
}

DatagramBytes resized(DatagramBytes bytes, std::size_t size) {
  bytes.resize(size, std::byte{0});
  return bytes;
}

/// The same with the length field of the header to match: only the contents do not fit.
DatagramBytes relabelled(const DatagramBytes& bytes, std::size_t size) {
  return with(resized(bytes, size), 36, 2, size);
}

TEST_CASE("the dissector marks what a receiver must refuse as malformed") {
  if (is_skipped()) return;
  const DatagramBytes update = encode(kInSession, test::planar_update(10), 0);
  const DatagramBytes full = encode(kInSession, test::planar_update(9), 0);
  const DatagramBytes hello = encode(kOutside, test::planar_hello(), 0);
  const DatagramBytes goodbye = encode(kInSession, Goodbye{});
  const DatagramBytes reject = encode(kOutside, test::reject_message(""));
  const std::uint64_t not_a_number =
      std::bit_cast<std::uint64_t>(std::numeric_limits<double>::quiet_NaN());
  const std::size_t size = update.size();
  constexpr std::size_t kContactSize = 94;
  constexpr std::size_t kLinkSize = 162;
  const std::vector<std::pair<const char*, DatagramBytes>> refused = {
      {"cut off in the header", resized(update, 39)},
      {"cut off after the header", relabelled(update, 40)},
      {"a byte short", resized(update, size - 1)},
      {"a byte too long", resized(update, size + 1)},
      {"an item cut off", relabelled(update, size - 1)},
      {"a byte left over", relabelled(update, size + 1)},
      {"length field too large", with(update, 36, 2, 1201)},
      {"unknown type", with(goodbye, 6, 1, 10)},
      {"flags", with(update, 7, 1, 1)},
      {"session 0", with(update, 8, 8, 0)},
      {"a reject in a session", with(reject, 8, 8, 1)},
      {"sequence 0", with(update, 16, 8, 0)},
      {"no item", relabelled(with(with(hello, 34, 1, 0), 35, 1, 0), hello.size() - kLinkSize)},
      {"part beyond the last",
       relabelled(with(with(full, 32, 1, 1), 34, 1, 0), full.size() - 9 * kContactSize)},
      {"too many parts", with(update, 33, 1, 3)},
      {"too few items in this part", relabelled(with(update, 34, 1, 8), size - kContactSize)},
      {"too many items in all", with(update, 35, 1, 65)},
      {"items in a goodbye", with(goodbye, 35, 1, 1)},
      {"reserved bytes", with(update, 38, 2, 256)},
      {"a number that is not finite", with(update, 40, 8, not_a_number)},
      {"more coordinates than bytes", with(update, 80, 1, 255)},
      {"unknown kind of feature", with(update, size - kContactSize + 2, 1, 3)},
      {"unknown reason", with(goodbye, 40, 1, 2)},
      {"text longer than the datagram", with(reject, 49, 1, 1)},
  };
  const test::TemporaryDirectory directory;
  const auto path = directory / "refused.pcap";
  Recording recording(path);
  for (const auto& [name, bytes] : refused) recording.add(bytes);
  const auto marks = test::lines(test::tshark(path, "-T fields -e hlm.malformed"));
  REQUIRE(marks.size() == refused.size());
  for (std::size_t i = 0; i < refused.size(); ++i) {
    INFO(refused[i].first);
    CHECK_FALSE(marks[i].empty());
  }
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

TEST_CASE("of another version the dissector shows the header, and of a reject everything") {
  if (is_skipped()) return;
  const test::TemporaryDirectory directory;
  const auto path = directory / "versions.pcap";
  Recording recording(path);
  constexpr std::uint16_t kOther = kProtocolVersion + 1;
  recording.add(with(encode(kOutside, test::planar_hello()), 4, 2, kOther));
  recording.add(with(encode(kOutside, test::reject_message("")), 4, 2, kOther));
  const auto shown = test::lines(
      test::tshark(path,
                   "-T fields -E separator=, -e hlm.version -e hlm.sequence -e hlm.hello.nonce "
                   "-e hlm.reject.nonce -e hlm.malformed -e _ws.expert.message"));
  const std::string other = std::to_string(kOther);
  CHECK(shown == std::vector<std::string>{other + ",3,,,,Another version of the protocol",
                                          other + ",3,,0x0000000000000001,,"});
}

}  // namespace
}  // namespace hlm::protocol
