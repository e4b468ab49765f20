// Captures: what CaptureWriter writes is an ordinary packet file, and CaptureReader reads those of
// other programs.
#include <algorithm>
#include <array>

#include "hlm/protocol/transport/ip_packet.h"
#include "tests/protocol/transport/capture_files.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::protocol {
namespace {

using Catch::Matchers::ContainsSubstring;
using test::ByteVector;
using test::CapturedFrame;
using test::from_hex;
using test::operator+;

constexpr Endpoint kClient{.address = 0x0A000002, .port = 50000};
constexpr Endpoint kServer{.address = 0x0A000001, .port = 47800};

/// From kClient to kServer, "HLMI!"; its checksums were computed elsewhere.
const ByteVector kPacket =
    from_hex("45000021 00004000 401126ca 0a000002 0a000001 c350bab8 000db732 484c4d4921");
const ByteVector kPayload = from_hex("484c4d4921");

/// kPacket with other bytes from `at` on. Checksums are then wrong, which no reader minds.
ByteVector changed(std::size_t at, const std::string& hex) {
  ByteVector packet = kPacket;
  std::ranges::copy(from_hex(hex), packet.begin() + static_cast<std::ptrdiff_t>(at));
  return packet;
}

ByteVector random_bytes(test::Random& random, std::size_t size) {
  ByteVector bytes(size);
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random.integer(0, 255));
  return bytes;
}

bool same_bytes(std::span<const std::byte> a, std::span<const std::byte> b) {
  return std::ranges::equal(a, b);
}

/// What went wrong in reading the file to its end; empty if nothing did.
std::string error_of_reading(const std::filesystem::path& path) {
  try {
    CaptureReader reader(path);
    test::read_all(reader);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

std::string error_of_writing(const std::filesystem::path& path) {
  try {
    const CaptureWriter writer(path);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

/// The folded sum of all words: 0xFFFF over a range that contains its right checksum (RFC 1071).
unsigned folded_sum(const ByteVector& bytes) {
  unsigned sum = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    sum += std::to_integer<unsigned>(bytes[i]) << (i % 2 == 0 ? 8 : 0);
  }
  while (sum > 0xFFFF) sum = (sum & 0xFFFF) + (sum >> 16);
  return sum;
}

TEST_CASE("What is written to a capture is read back, stamps to the nanosecond") {
  const test::TemporaryDirectory directory;
  const auto path = directory / GENERATE("written.pcap", "packed.pcap.gz");
  test::Random random;
  std::vector<std::pair<std::int64_t, ByteVector>> written;
  {
    CaptureWriter writer(path);
    std::int64_t time = 1'790'000'000'999'999'990;
    for (const std::size_t size : std::array<std::size_t, 8>{0, 1, 2, 39, 40, 41, 1199, 1200}) {
      written.emplace_back(time += 3, random_bytes(random, size));
      const bool from_client = written.size() % 2 == 0;
      writer.write(time, from_client ? kClient : kServer, from_client ? kServer : kClient,
                   written.back().second);
    }
  }
  CaptureReader reader(path);
  for (std::size_t i = 0; i < written.size(); ++i) {
    const auto datagram = reader.next();
    REQUIRE(datagram);
    const bool from_client = (i + 1) % 2 == 0;
    CHECK(datagram->time_ns == written[i].first);
    CHECK(datagram->from == (from_client ? kClient : kServer));
    CHECK(datagram->to == (from_client ? kServer : kClient));
    CHECK(same_bytes(view(datagram->bytes), written[i].second));
  }
  CHECK_FALSE(reader.next());
  CHECK(reader.skipped() == 0);
}

TEST_CASE("A datagram is written as these bytes of an IPv4 packet") {
  const test::TemporaryDirectory directory;
  const auto path = directory / "golden.pcap";
  CaptureWriter(path).write(5'000'000'006, kClient, kServer, kPayload);
  // Magic of nanosecond pcap, 2.4, two zeros, snapshot length, LINKTYPE_RAW; then s, ns, lengths.
  const ByteVector headers = from_hex(
      "4d3cb2a1 0200 0400 00000000 00000000 00000400 65000000"
      "05000000 06000000 21000000 21000000");
  CHECK(test::read_file(path) == headers + kPacket);
}

TEST_CASE("The IPv4 and UDP checksums of any datagram are right") {
  test::Random random;
  for (int i = 0; i < 200; ++i) {
    const ByteVector bytes =
        random_bytes(random, static_cast<std::size_t>(random.integer(0, 1200)));
    const Endpoint from{.address = static_cast<std::uint32_t>(random.engine()()), .port = 1};
    const auto header = ip_udp_header(from, kServer, bytes);
    const ByteVector ip(header.begin(), header.begin() + 20);
    CHECK(folded_sum(ip) == 0xFFFF);
    const auto length = static_cast<std::byte>((bytes.size() + 8) >> 8);
    const auto length_low = static_cast<std::byte>(bytes.size() + 8);
    const ByteVector pseudo = from_hex("0011") + ByteVector{length, length_low};
    CHECK(folded_sum(pseudo + ByteVector(header.begin() + 12, header.end()) + bytes) == 0xFFFF);
  }
}

TEST_CASE("A UDP checksum of zero is sent as its complement, because zero means none") {
  ByteVector bytes = from_hex("0000");
  const auto header = ip_udp_header(kClient, kServer, bytes);
  // With its own checksum as contents the sum of the datagram is all ones.
  bytes = {header[26], header[27]};
  const auto full = ip_udp_header(kClient, kServer, bytes);
  CHECK(ByteVector(full.end() - 2, full.end()) == from_hex("ffff"));
}

TEST_CASE("What was flushed can be read while the writer is still open") {
  const test::TemporaryDirectory directory;
  const auto path = directory / GENERATE("open.pcap", "packed.pcap.gz");
  CaptureWriter writer(path);
  {
    CaptureReader empty(path);
    CHECK_FALSE(empty.next());
  }
  writer.write(1, kClient, kServer, kPayload);
  writer.flush();
  CaptureReader reader(path);
  CHECK(reader.next());
}

TEST_CASE("A capture of any known link type yields the same datagram") {
  struct LinkType {
    const char* name;
    int dlt;
    std::string header;
  };
  const std::string macs = "020000000001 020000000002 ";
  const std::vector<LinkType> link_types = {
      {"raw", DLT_RAW, ""},
      {"raw IPv4", DLT_IPV4, ""},
      {"Ethernet", DLT_EN10MB, macs + "0800"},
      {"Ethernet, VLAN", DLT_EN10MB, macs + "8100 0064 0800"},
      {"Ethernet, two VLAN tags", DLT_EN10MB, macs + "88a8 0001 8100 0002 0800"},
      {"Linux cooked", DLT_LINUX_SLL, "0000 0001 0006 0200000000010000 0800"},
      {"Linux cooked, VLAN", DLT_LINUX_SLL, "0000 0001 0006 0200000000010000 8100 0064 0800"},
      {"Linux cooked 2", DLT_LINUX_SLL2, "0800 0000 00000003 0001 00 06 0200000000010000"},
      {"loopback, little-endian", DLT_NULL, "02000000"},
      {"loopback, big-endian", DLT_NULL, "00000002"},
      {"loopback, OpenBSD", DLT_LOOP, "00000002"},
  };
  const test::TemporaryDirectory directory;
  for (const LinkType& link_type : link_types) {
    INFO(link_type.name);
    const auto path = directory / "other.pcap";
    test::write_frames(path, link_type.dlt, {{from_hex(link_type.header) + kPacket}});
    CaptureReader reader(path);
    const auto datagram = reader.next();
    REQUIRE(datagram);
    CHECK(datagram->from == kClient);
    CHECK(datagram->to == kServer);
    CHECK(same_bytes(view(datagram->bytes), kPayload));
    CHECK(datagram->time_ns == 1'000'007'000);
    CHECK_FALSE(reader.next());
    CHECK(reader.skipped() == 0);
  }
}

TEST_CASE("A pcapng capture is read, stamps to the nanosecond") {
  const test::TemporaryDirectory directory;
  const auto path = directory / "packets.pcapng";
  test::write_file(path, test::pcapng_of(kPacket));
  CaptureReader reader(path);
  const auto datagram = reader.next();
  REQUIRE(datagram);
  CHECK(datagram->time_ns == 0x18d7000000000123);
  CHECK(datagram->from == kClient);
  CHECK(same_bytes(view(datagram->bytes), kPayload));
  CHECK_FALSE(reader.next());
}

TEST_CASE("A packet stamped before 1970 or after 2262 is skipped and counted") {
  const test::TemporaryDirectory directory;
  const auto path = directory / "stamps.pcap";
  test::write_frames(path, DLT_RAW, {{kPacket}, {kPacket}});
  ByteVector bytes = test::read_file(path);
  constexpr std::size_t kStamp = 24;  // Of the first packet, behind the file's header.
  bytes[kStamp + 3] = std::byte{0xFF};
  test::write_file(path, bytes);
  CaptureReader reader(path);
  const auto datagram = reader.next();
  REQUIRE(datagram);
  CHECK(datagram->time_ns == 2'000'007'000);
  CHECK_FALSE(reader.next());
  CHECK(reader.skipped() == 1);
}

TEST_CASE("Packets that are not whole UDP datagrams are skipped and counted") {
  const std::vector<CapturedFrame> others = {
      {changed(0, "65")},                      // IPv6.
      {changed(9, "06")},                      // TCP.
      {changed(6, "2000")},                    // First of several fragments.
      {changed(6, "0001")},                    // A later fragment.
      {changed(0, "44")},                      // Header shorter than the least.
      {changed(0, "4f")},                      // Header longer than the packet.
      {changed(2, "001b")},                    // Packet shorter than its headers.
      {changed(2, "0022")},                    // Packet longer than what there is.
      {changed(24, "0007")},                   // UDP shorter than its header.
      {changed(24, "000e")},                   // UDP longer than its packet.
      {changed(24, "000e") + from_hex("00")},  // The same in a padded frame.
      {kPacket, 1},                            // Not captured whole.
      {ByteVector(kPacket.begin(), kPacket.begin() + 19)},
      {{}},
  };
  const test::TemporaryDirectory directory;
  const auto path = directory / "others.pcap";
  for (const CapturedFrame& other : others) {
    INFO("packet " << &other - others.data());
    test::write_frames(path, DLT_RAW, {{kPacket}, other, {kPacket}});
    CaptureReader reader(path);
    const auto datagrams = test::read_all(reader);
    REQUIRE(datagrams.size() == 2);
    CHECK(datagrams[1].time_ns == 3'000'007'000);
    CHECK(reader.skipped() == 1);
  }
}

TEST_CASE("Frames that hold no IPv4 packet are skipped and counted") {
  const std::vector<std::pair<int, std::string>> others = {
      {DLT_EN10MB, "020000000001 020000000002 0806"},       // ARP.
      {DLT_EN10MB, "020000000001 020000000002 8100 0064"},  // Ends in its VLAN tag.
      {DLT_EN10MB, "020000000001 0200000000"},              // Ends in its header.
      {DLT_LINUX_SLL, "0000 0001 0006 0200000000010000 86dd"},
      {DLT_LINUX_SLL2, "0806 0000 00000003 0001 00 06 0200000000010000"},
      {DLT_NULL, "1e000000"},
      {DLT_NULL, "02"},
  };
  const test::TemporaryDirectory directory;
  for (const auto& [link_type, frame] : others) {
    INFO(frame);
    const auto path = directory / "others.pcap";
    test::write_frames(path, link_type, {{from_hex(frame)}});
    CaptureReader reader(path);
    CHECK_FALSE(reader.next());
    CHECK(reader.skipped() == 1);
  }
}

TEST_CASE("Options of the IPv4 header and padding of the frame are no part of the datagram") {
  ByteVector packet = changed(0, "46");
  packet.insert(packet.begin() + 20, 4, std::byte{1});
  packet[3] = std::byte{0x25};
  packet.resize(60);
  const auto udp = find_udp(packet);
  REQUIRE(udp);
  CHECK(udp->from == kClient);
  CHECK(same_bytes(udp->payload, kPayload));
}

TEST_CASE("A datagram longer than the protocol allows is read as an empty one") {
  const ByteVector bytes(kMaxDatagram + 1);
  const auto header = ip_udp_header(kClient, kServer, bytes);
  const test::TemporaryDirectory directory;
  const auto path = directory / "long.pcap";
  test::write_frames(path, DLT_RAW, {{ByteVector(header.begin(), header.end()) + bytes}});
  CaptureReader reader(path);
  const auto datagram = reader.next();
  REQUIRE(datagram);
  CHECK(datagram->bytes.empty());
}

TEST_CASE("A capture whose writer was interrupted yields all whole packets") {
  const test::TemporaryDirectory directory;
  const auto whole = directory / "whole.pcap";
  test::write_frames(whole, DLT_RAW, {{kPacket}, {kPacket}});
  const ByteVector bytes = test::read_file(whole);
  constexpr std::size_t kFileHeader = 24;
  const std::size_t record = 16 + kPacket.size();
  for (std::size_t size = kFileHeader; size <= bytes.size(); ++size) {
    const auto path = directory / "interrupted.pcap";
    test::write_file(path, std::span(bytes).first(size));
    CaptureReader reader(path);
    CHECK(test::read_all(reader).size() == (size - kFileHeader) / record);
    CHECK(reader.skipped() == ((size - kFileHeader) % record == 0 ? 0 : 1));
  }
}

TEST_CASE("A packed capture that is cut anywhere yields what was flushed before") {
  const test::TemporaryDirectory directory;
  const auto path = directory / "packed.pcap.gz";
  test::Random random;
  std::vector<std::size_t> flushed;  // Sizes with so many datagrams.
  std::optional<CaptureWriter> writer(path);
  for (int i = 0; i < 20; ++i) {
    flushed.push_back(std::filesystem::file_size(path));
    writer->write(i, kClient, kServer, random_bytes(random, 50));
    writer->flush();
  }
  writer.reset();
  const ByteVector bytes = test::read_file(path);
  const auto cut = directory / "cut.pcap.gz";
  for (std::size_t size = flushed.front(); size <= bytes.size(); ++size) {
    test::write_file(cut, std::span(bytes).first(size));
    CaptureReader reader(cut);
    const auto whole = std::ranges::upper_bound(flushed, size) - flushed.begin() - 1;
    CHECK(test::read_all(reader).size() >= static_cast<std::size_t>(whole));
  }
  ByteVector damaged = bytes;
  damaged[damaged.size() / 2] ^= std::byte{0xFF};
  test::write_file(cut, damaged);
  CHECK_THAT(error_of_reading(cut),
             ContainsSubstring(cut.string()) && ContainsSubstring("Bad message"));
}

TEST_CASE("A file that is no capture is refused with a line that names it") {
  const test::TemporaryDirectory directory;
  const auto text = directory / "text.pcap";
  test::write_file(text, std::as_bytes(std::span("this is a text of some length, not packets")));
  CHECK_THAT(error_of_reading(text), ContainsSubstring(text.string()));
  const auto empty = directory / "empty.pcap";
  test::write_file(empty, {});
  CHECK_THAT(error_of_reading(empty), ContainsSubstring(empty.string()));
  const auto missing = directory / "missing.pcap";
  CHECK_THAT(error_of_reading(missing), ContainsSubstring("No such file"));
  const auto wireless = directory / "wireless.pcap";
  test::write_frames(wireless, DLT_IEEE802_11, {});
  CHECK_THAT(error_of_reading(wireless), ContainsSubstring(wireless.string()) &&
                                             ContainsSubstring("IEEE802_11") &&
                                             ContainsSubstring("allowed are"));
}

TEST_CASE("A capture file that cannot be written is refused with a line that names it") {
  CHECK_THAT(
      error_of_writing("/nonexistent/directory/a.pcap"),
      ContainsSubstring("/nonexistent/directory/a.pcap") && ContainsSubstring("No such file"));
  // The device that is always full.
  CHECK_THAT(error_of_writing("/dev/full"), ContainsSubstring("/dev/full"));
  const test::TemporaryDirectory directory;
  const auto packed = directory / "full.pcap.gz";
  std::filesystem::create_symlink("/dev/full", packed);
  CHECK_THAT(error_of_writing(packed), ContainsSubstring("is the disk full?"));
}

}  // namespace
}  // namespace hlm::protocol
