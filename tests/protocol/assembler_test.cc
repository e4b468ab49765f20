// Messages in parts: whole or not at all, only the newest.
#include "hlm/protocol/assembler.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "tests/protocol/sample_messages.h"
#include "tests/support/catch.h"

namespace hlm::protocol {
namespace {

std::vector<DatagramBytes> parts_of(std::uint64_t sequence, std::size_t contacts = kMaxContacts) {
  const ContactUpdate update = test::planar_update(contacts, static_cast<double>(sequence));
  std::vector<DatagramBytes> parts;
  for (std::uint8_t part = 0; part < part_count(update); ++part) {
    parts.push_back(encode({.session = 7, .sequence = sequence}, update, part));
  }
  return parts;
}

struct Receiver {
  std::optional<DropReason> add(const DatagramBytes& bytes) {
    Header header;
    REQUIRE_FALSE(decode_header(view(bytes), header));
    return assembler.add(header, view(bytes), statistics);
  }

  Assembler assembler;
  ReceiveStatistics statistics;
};

/// Contacts of planar_update() differ in identity: 0, 1, 2, …
void check_whole(const Assembler& assembler, std::uint64_t sequence) {
  REQUIRE(assembler.complete());
  ContactUpdate update;
  REQUIRE_FALSE(decode(assembler.parts(), update));
  CHECK(update.ve_time == static_cast<double>(sequence));
  REQUIRE(update.contacts.size() == kMaxContacts);
  for (std::size_t i = 0; i < kMaxContacts; ++i) CHECK(update.contacts[i].identity == i);
}

TEST_CASE("192 contacts come whole, whatever the order of their parts and with duplicates") {
  test::Random random;
  const std::vector<DatagramBytes> parts = parts_of(3);
  REQUIRE(parts.size() == 20);
  for (int run = 0; run < 50; ++run) {
    std::vector<std::size_t> order(parts.size());
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), random.engine());
    Receiver receiver;
    for (std::size_t i = 0; i < order.size(); ++i) {
      CHECK_FALSE(receiver.assembler.complete());
      CHECK_FALSE(receiver.add(parts[order[i]]));
      CHECK(receiver.add(parts[order[i / 2]]) == DropReason::kStale);
    }
    check_whole(receiver.assembler, 3);
    CHECK(receiver.statistics.total_dropped() == 0);
  }
}

TEST_CASE("A message with a lost part is never complete and gives way to a newer one") {
  for (std::size_t lost = 0; lost < parts_of(3).size(); ++lost) {
    Receiver receiver;
    const std::vector<DatagramBytes> older = parts_of(3);
    for (std::size_t i = 0; i < older.size(); ++i) {
      if (i != lost) CHECK_FALSE(receiver.add(older[i]));
    }
    CHECK_FALSE(receiver.assembler.complete());
    for (const DatagramBytes& part : parts_of(4)) CHECK_FALSE(receiver.add(part));
    check_whole(receiver.assembler, 4);
    CHECK(receiver.statistics.count(DropReason::kIncomplete) == older.size() - 1);
    CHECK(receiver.add(older[lost]) == DropReason::kStale);
    check_whole(receiver.assembler, 4);
  }
}

TEST_CASE("Parts of two messages that come mixed give the newer one") {
  Receiver receiver;
  const std::vector<DatagramBytes> older = parts_of(3);
  const std::vector<DatagramBytes> newer = parts_of(4);
  for (std::size_t i = 0; i < older.size(); ++i) {
    CHECK(receiver.add(older[i]) == (i == 0 ? std::nullopt : std::optional(DropReason::kStale)));
    CHECK_FALSE(receiver.add(newer[i]));
  }
  check_whole(receiver.assembler, 4);
}

TEST_CASE("A part that names another number of parts is malformed") {
  Receiver receiver;
  CHECK_FALSE(receiver.add(parts_of(3)[0]));
  CHECK(receiver.add(parts_of(3, 20)[1]) == DropReason::kMalformed);
}

TEST_CASE("A refused message leaves no trace, its sequence neither") {
  Receiver receiver;
  for (const DatagramBytes& part : parts_of(3)) CHECK_FALSE(receiver.add(part));
  receiver.assembler.accept();
  for (const DatagramBytes& part : parts_of(~std::uint64_t{0})) CHECK_FALSE(receiver.add(part));
  receiver.assembler.refuse(~std::uint64_t{0}, receiver.statistics);
  CHECK_FALSE(receiver.assembler.complete());
  CHECK(receiver.add(parts_of(3)[0]) == DropReason::kStale);
  for (const DatagramBytes& part : parts_of(4)) CHECK_FALSE(receiver.add(part));
  check_whole(receiver.assembler, 4);
}

TEST_CASE("After a restart any sequence may come") {
  Receiver receiver;
  CHECK_FALSE(receiver.add(parts_of(3)[0]));
  receiver.assembler.restart(receiver.statistics);
  CHECK(receiver.statistics.count(DropReason::kIncomplete) == 1);
  CHECK_FALSE(receiver.assembler.complete());
  for (const DatagramBytes& part : parts_of(1)) CHECK_FALSE(receiver.add(part));
  check_whole(receiver.assembler, 1);
}

}  // namespace
}  // namespace hlm::protocol
