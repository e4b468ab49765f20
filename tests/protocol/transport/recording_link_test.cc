// RecordingLink: what passes is recorded, and recording changes nothing of what passes.
#include "hlm/protocol/transport/recording_link.h"

#include <cstring>
#include <deque>
#include <thread>

#include "tests/protocol/transport/capture_files.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"

namespace hlm::protocol {
namespace {

constexpr Endpoint kLocal{.address = 0x7F000001, .port = 47800};
constexpr Endpoint kPeer{.address = 0x7F000001, .port = 50000};

Datagram numbered(std::uint32_t number) {
  Datagram datagram{.peer = kPeer, .bytes = {}};
  datagram.bytes.resize(sizeof number);
  std::memcpy(datagram.bytes.data(), &number, sizeof number);
  return datagram;
}

template <class Bytes>
std::uint32_t number_of(const Bytes& bytes) {
  std::uint32_t number = 0;
  REQUIRE(bytes.size() == sizeof number);
  std::memcpy(&number, bytes.data(), sizeof number);
  return number;
}

/// Delivers what is waiting and keeps what is sent.
struct PlainLink final : DatagramLink {
  bool receive(Datagram& datagram) noexcept override {
    if (waiting.empty()) return false;
    datagram = waiting.front();
    waiting.pop_front();
    return true;
  }
  void send(const Endpoint& to, std::span<const std::byte> bytes) noexcept override {
    sent.push_back({.peer = to, .bytes = {bytes.begin(), bytes.end()}});
  }
  std::deque<Datagram> waiting;
  std::vector<Datagram> sent;
};

/// Delivers an empty datagram at any time and swallows everything.
struct NullLink final : DatagramLink {
  bool receive(Datagram& datagram) noexcept override {
    datagram.bytes.clear();
    return true;
  }
  void send(const Endpoint&, std::span<const std::byte>) noexcept override {}
};

/// Counts: 1, 2, 3, … s.
std::function<std::int64_t()> counting_clock() {
  return [time = std::int64_t{0}]() mutable { return time += 1'000'000'000; };
}

TEST_CASE("Both directions are recorded, in order, with their stamps") {
  const test::TemporaryDirectory directory;
  PlainLink plain;
  plain.waiting = {numbered(1), numbered(2)};
  RecordingLink link(plain, kLocal, counting_clock());
  Datagram received;
  REQUIRE(link.receive(received));
  link.send(kPeer, view(numbered(77).bytes));
  REQUIRE(link.receive(received));
  {
    CaptureWriter capture(directory / "recorded.pcap");
    CHECK(link.drain(capture) == 3);
    CHECK(link.drain(capture) == 0);
  }
  CaptureReader reader(directory / "recorded.pcap");
  const auto datagrams = test::read_all(reader);
  REQUIRE(datagrams.size() == 3);
  const Endpoint senders[] = {kPeer, kLocal, kPeer};
  const Endpoint receivers[] = {kLocal, kPeer, kLocal};
  const std::uint32_t numbers[] = {1, 77, 2};
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(datagrams[i].from == senders[i]);
    CHECK(datagrams[i].to == receivers[i]);
    CHECK(number_of(datagrams[i].bytes) == numbers[i]);
    CHECK(datagrams[i].time_ns == static_cast<std::int64_t>(i + 1) * 1'000'000'000);
  }
  CHECK(link.lost() == 0);
}

TEST_CASE("What a sealing link has refused is passed on and not recorded") {
  const test::TemporaryDirectory directory;
  PlainLink plain;
  plain.waiting = {numbered(1), {.peer = kPeer, .bytes = {}, .dropped = DropReason::kAltered}};
  RecordingLink link(plain, kLocal);
  Datagram received;
  REQUIRE(link.receive(received));
  REQUIRE(link.receive(received));
  CHECK(received.dropped == DropReason::kAltered);
  CaptureWriter capture(directory / "recorded.pcap");
  CHECK(link.drain(capture) == 1);
}

TEST_CASE("Datagrams pass a recording link unchanged") {
  PlainLink plain;
  plain.waiting = {numbered(5)};
  RecordingLink link(plain, kLocal);
  Datagram received;
  REQUIRE(link.receive(received));
  CHECK(received.peer == kPeer);
  CHECK(number_of(received.bytes) == 5);
  CHECK_FALSE(link.receive(received));
  link.send(kPeer, view(numbered(6).bytes));
  REQUIRE(plain.sent.size() == 1);
  CHECK(plain.sent[0].peer == kPeer);
  CHECK(number_of(plain.sent[0].bytes) == 6);
}

TEST_CASE("An over-long datagram, received as an empty one, is recorded as such") {
  const test::TemporaryDirectory directory;
  PlainLink plain;
  plain.waiting = {Datagram{.peer = kPeer, .bytes = {}}};
  RecordingLink link(plain, kLocal);
  Datagram received;
  REQUIRE(link.receive(received));
  CaptureWriter capture(directory / "empty.pcap");
  CHECK(link.drain(capture) == 1);
  CaptureReader reader(directory / "empty.pcap");
  const auto datagram = reader.next();
  REQUIRE(datagram);
  CHECK(datagram->bytes.empty());
}

TEST_CASE("A full ring loses the newest datagrams, counts them, and still lets them pass") {
  const test::TemporaryDirectory directory;
  constexpr std::size_t kCapacity = 4;
  PlainLink plain;
  RecordingLink link(plain, kLocal, wall_clock_ns, kCapacity);
  for (std::uint32_t i = 0; i < 6; ++i) link.send(kPeer, view(numbered(i).bytes));
  CHECK(plain.sent.size() == 6);
  CHECK(link.lost() == 2);
  {
    CaptureWriter capture(directory / "full.pcap");
    CHECK(link.drain(capture) == kCapacity);
    link.send(kPeer, view(numbered(6).bytes));
    CHECK(link.drain(capture) == 1);
  }
  CHECK(link.lost() == 2);
  CaptureReader reader(directory / "full.pcap");
  std::vector<std::uint32_t> numbers;
  for (const auto& datagram : test::read_all(reader)) numbers.push_back(number_of(datagram.bytes));
  CHECK(numbers == std::vector<std::uint32_t>{0, 1, 2, 3, 6});
}

TEST_CASE("Recording allocates nothing, whether or not the ring is full") {
  NullLink null;
  constexpr std::size_t kCapacity = 4;
  RecordingLink link(null, kLocal, wall_clock_ns, kCapacity);
  Datagram received;
  const Datagram sent = numbered(1);
  const test::NoMalloc guard;
  for (int i = 0; i < 5; ++i) {
    link.receive(received);
    link.send(kPeer, view(sent.bytes));
  }
  CHECK(guard.allocations() == 0);
  CHECK(link.lost() == 10 - kCapacity);
}

TEST_CASE("While one thread sends and another drains, each datagram is recorded or counted lost") {
  const test::TemporaryDirectory directory;
  constexpr std::uint32_t kSent = 20'000;
  constexpr std::size_t kCapacity = 64;
  NullLink null;
  RecordingLink link(null, kLocal, wall_clock_ns, kCapacity);
  std::size_t recorded = 0;
  {
    CaptureWriter capture(directory / "concurrent.pcap");
    std::atomic<bool> done = false;
    std::thread sender([&] {
      for (std::uint32_t i = 0; i < kSent; ++i) {
        link.send(kPeer, view(numbered(i).bytes));
        if (i % kCapacity == 0) std::this_thread::yield();
      }
      done = true;
    });
    while (!done) recorded += link.drain(capture);
    sender.join();
    recorded += link.drain(capture);
  }
  CHECK(recorded + link.lost() == kSent);
  CHECK(recorded >= kCapacity);
  CaptureReader reader(directory / "concurrent.pcap");
  std::int64_t previous = -1;
  std::size_t read = 0;
  bool ascending = true;
  while (const auto datagram = reader.next()) {
    const std::int64_t number = number_of(datagram->bytes);
    ascending = ascending && number > previous;
    previous = number;
    ++read;
  }
  CHECK(ascending);
  CHECK(read == recorded);
}

TEST_CASE("The wall clock counts nanoseconds since 1970") {
  constexpr std::int64_t kStartOf2020 = 1'577'836'800'000'000'000;
  constexpr std::int64_t kStartOf2200 = 7'258'118'400'000'000'000;
  CHECK(wall_clock_ns() > kStartOf2020);
  CHECK(wall_clock_ns() < kStartOf2200);
}

}  // namespace
}  // namespace hlm::protocol
