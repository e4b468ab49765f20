// The Wireshark dissector marks what the codec refuses as malformed, and nothing else.
#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "tests/protocol/dissector_recording.h"
#include "tests/protocol/sample_messages.h"
#include "tests/protocol/transport/capture_files.h"

namespace hlm::protocol {
namespace {

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

  /// One part, looked at alone.
  template <class Message>
  void add_lone_part(const std::string& name, const DatagramBytes& bytes) {
    Message decoded;
    cases_.push_back({name, bytes, decode_part(view(bytes), decoded).has_value()});
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
}

/// First parts of messages whose lists are as long as is allowed, and `more` items longer.
void add_list_lengths(Verdicts& verdicts, std::size_t more) {
  const auto add = [&]<class Message>(const Message& message, std::size_t list, std::size_t most) {
    const DatagramBytes bytes = with(only_part(message), kPartsAt, 1, 2);
    const std::size_t total = first_list(bytes) + list * layout::kListHeaderSize + 4;
    verdicts.add_lone_part<Message>(std::string(name_of(kTypeOf<Message>)),
                                    with(bytes, total, 2, most + more));
  };
  add(test::planar_hello(), 0, kMaxLinks);
  add(test::planar_update(0), 0, kMaxBodies);
  add(test::planar_update(0), 1, kMaxContacts);
  ContactUpdate with_pose = test::planar_update(0);
  with_pose.poses.resize(1);
  add(with_pose, 2, kMaxPoses);
  add(Ticks{}, 0, kTicksPerMessage);
  add(LocalState{}, 0, kMaxReportedContacts);
  add(Impulses{}, 0, kMaxBodies);
  add(HeldBodies{}, 0, kMaxHeldInMessage);
}

/// The same with 300 spaces behind its fixed fields: more coordinates and text than are allowed
/// have room there.
DatagramBytes with_longer_block(const DatagramBytes& bytes) {
  constexpr std::size_t kMore = 300;
  const std::size_t block = block_size(bytes);
  DatagramBytes longer;
  const auto end_of_block = bytes.begin() + static_cast<std::ptrdiff_t>(first_list(bytes));
  longer.insert(longer.end(), bytes.begin(), end_of_block);
  longer.insert(longer.end(), kMore, std::byte{' '});
  longer.insert(longer.end(), end_of_block, bytes.end());
  return with(relabelled(longer, longer.size()), kBlockAt, 2, block + kMore);
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
  wrong("a pose too far", [](U& u) { u.poses.resize(1), u.poses[0].X_WB.p.x() = 10001; });
  wrong("a pose too fast", [](U& u) { u.poses.resize(1), u.poses[0].V_W[5] = -1001; });
  wrong("a pose's quaternion", [](U& u) { u.poses.resize(1), u.poses[0].X_WB.R.w() = 0.998; });
  wrong("too much acceleration", [](U& u) { u.bodies.resize(1), u.bodies[0].A_W[0] = 1.1e6; });
  const DatagramBytes bytes = with_longer_block(only_part(update));
  constexpr std::size_t kSizes = layout::kHeaderSize + 48;
  verdicts.add<U>("no coordinates", with(bytes, kSizes, 1, 0));
  verdicts.add<U>("too many coordinates", with(bytes, kSizes, 1, kMaxConfiguration + 1));
  verdicts.add<U>("too many velocities", with(bytes, kSizes + 1, 1, kMaxDof + 1));

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
  verdicts.add<Reject>("text too long", with(with_longer_block(reject), 49, 1, kMaxText + 1));
  verdicts.add<Refusal>("neither yes nor no", with(only_part(Refusal{}), 49, 1, 2));
  for (const TuningRange& range : kTuningRanges) {
    for (const double number : {range.least - 1e-3, range.most * 1.001}) {
      verdicts.add_changed(range.name, Control{},
                           [&](Control& c) { c.tuning.*range.number = number; });
    }
  }
}

TEST_CASE("The dissector marks what a receiver must refuse as malformed") {
  if (is_skipped()) return;
  Verdicts verdicts;
  add_wrong_headers(verdicts);
  add_wrong_lists(verdicts);
  add_list_lengths(verdicts, 1);
  add_wrong_numbers(verdicts);
  CHECK(verdicts.refused() == verdicts.size());
  const test::TemporaryDirectory directory;
  verdicts.check(directory / "refused.pcap");
}

TEST_CASE("The dissector does not mark what is just within its range") {
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
  add_list_lengths(verdicts, 0);
  const DatagramBytes reject = with_longer_block(only_part(test::reject_message("")));
  verdicts.add<Reject>("longest text", with(reject, 49, 1, kMaxText));
  // Of a welcome the receiver does not check them.
  verdicts.add_changed("welcome", Welcome{}, [](Welcome& w) { w.tuning.restitution = 2; });
  CHECK(verdicts.refused() == 0);
  const test::TemporaryDirectory directory;
  verdicts.check(directory / "accepted.pcap");
}

TEST_CASE("The dissector and the codec agree on messages with a few random bytes") {
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
    mutate(test::random_held(random));
    mutate(test::random_chunk(random));
    mutate(test::random_scene_state(random));
  }
  CHECK(verdicts.refused() > 100);
  CHECK(verdicts.size() - verdicts.refused() > 100);
  const test::TemporaryDirectory directory;
  verdicts.check(directory / "mutated.pcap");
}

}  // namespace
}  // namespace hlm::protocol
