// Sealed packets: once each, unchanged, in any order within the window.
#include "hlm/protocol/sealing/sealed_channel.h"

#include <algorithm>
#include <set>
#include <vector>

#include "hlm/protocol/wire.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::protocol {
namespace {

constexpr std::uint64_t kWidth = ReplayWindow::kWidth;

struct Channels {
  explicit Channels(std::uint64_t first_counter = 0)
      : sender(1, 2, keys, first_counter), receiver(2, 1, {keys.receive, keys.send}) {}

  DatagramBytes sealed(std::size_t size = 100) {
    const std::vector<std::byte> words(size, std::byte{7});
    return sender.seal(words);
  }
  std::optional<DropReason> open(const DatagramBytes& packet) {
    return receiver.open(view(packet), text);
  }

  SealedChannel::Keys keys{noise::random_key_pair().secret_key,
                           noise::random_key_pair().secret_key};
  SealedChannel sender;
  SealedChannel receiver;
  DatagramBytes text;
};

TEST_CASE("What is sealed opens as it was, from nothing up to the longest, 32 bytes longer") {
  Channels channels;
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, kMaxDatagram - kSealRoom}) {
    const DatagramBytes packet = channels.sealed(size);
    CHECK(packet.size() == size + kSealRoom);
    REQUIRE_FALSE(channels.open(packet));
    CHECK(channels.text == DatagramBytes(size, std::byte{7}));
  }
  CHECK(channels.sealed(kMaxDatagram - kSealRoom + 1).empty());
}

TEST_CASE("A packet of which any bit was changed, or bytes are missing, does not open") {
  Channels channels;
  const DatagramBytes packet = channels.sealed(40);
  // The eight bytes before are for finding the channel: sealed_links_test.cc.
  for (std::size_t bit = 8 * kResponseHeader; bit < 8 * packet.size(); ++bit) {
    DatagramBytes changed = packet;
    changed[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
    CHECK(channels.open(changed));
  }
  for (std::size_t size = kSealRoom; size < packet.size(); ++size) {
    CHECK(channels.open({packet.begin(), packet.begin() + static_cast<std::ptrdiff_t>(size)}) ==
          DropReason::kAltered);
  }
  CHECK_FALSE(channels.open(packet));
}

TEST_CASE("Each packet opens once, and not in the direction that it came from") {
  Channels channels;
  const DatagramBytes packet = channels.sealed();
  CHECK(channels.sender.open(view(packet), channels.text) == DropReason::kAltered);
  CHECK_FALSE(channels.open(packet));
  CHECK(channels.open(packet) == DropReason::kReplayed);
}

TEST_CASE("A packet 1023 behind the newest opens, one 1024 behind is too old") {
  Channels channels;
  std::vector<DatagramBytes> packets;
  for (std::uint64_t i = 0; i <= kWidth; ++i) packets.push_back(channels.sealed(8));
  CHECK_FALSE(channels.open(packets.back()));
  CHECK(channels.open(packets[0]) == DropReason::kTooOld);
  CHECK_FALSE(channels.open(packets[1]));
  CHECK(channels.open(packets[1]) == DropReason::kReplayed);
}

TEST_CASE("An altered packet far ahead does not move the window") {
  Channels channels;
  const DatagramBytes packet = channels.sealed();
  DatagramBytes ahead = packet;
  ahead[kResponseHeader + 6] = std::byte{1};  // 2^48 ahead
  CHECK(channels.open(ahead) == DropReason::kAltered);
  CHECK_FALSE(channels.open(packet));
}

TEST_CASE("Counters are never used twice: after the last one nothing is sealed") {
  Channels channels(noise::kLastNonce - 1);
  const DatagramBytes last_but_one = channels.sealed();
  const DatagramBytes last = channels.sealed();
  CHECK(channels.sealed().empty());
  CHECK_FALSE(channels.open(last));
  CHECK_FALSE(channels.open(last_but_one));
  CHECK(channels.open(last) == DropReason::kReplayed);
  DatagramBytes reserved = sealed_header(2, noise::kLastNonce + 1);
  reserved.resize(kSealRoom);
  CHECK(channels.open(reserved) == DropReason::kMalformed);
}

TEST_CASE("Whatever the order, the window takes each counter once, and all that it should") {
  INFO("seed " << test::random_seed());
  test::Random random;
  ReplayWindow window;
  std::set<std::uint64_t> taken;
  std::uint64_t newest = 0;
  for (int i = 0; i < 200'000; ++i) {
    // Mostly near the newest; sometimes a leap of up to three windows, sometimes far behind.
    const int leap = random.integer(0, 99) == 0 ? 3 * static_cast<int>(kWidth) : 20;
    const auto back = static_cast<std::uint64_t>(random.integer(0, 1100));
    const std::uint64_t ahead = newest + static_cast<std::uint64_t>(random.integer(0, leap));
    const std::uint64_t counter =
        random.integer(0, 1) == 0 ? ahead : newest - std::min(newest, back);
    std::optional<DropReason> expected;
    if (!taken.empty() && counter + kWidth <= newest) {
      expected = DropReason::kTooOld;
    } else if (taken.contains(counter)) {
      expected = DropReason::kReplayed;
    }
    REQUIRE(window.judge(counter) == expected);
    if (expected) continue;
    window.mark(counter);
    taken.insert(counter);
    newest = std::max(newest, counter);
  }
}

}  // namespace
}  // namespace hlm::protocol
