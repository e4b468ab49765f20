#include "hlm/protocol/transport/ip_packet.h"

#include <algorithm>
#include <cassert>
#include <cstdint>

#include <boost/endian/conversion.hpp>
#include <pcap/dlt.h>

namespace hlm::protocol {
namespace {

using Bytes = std::span<const std::byte>;

constexpr std::size_t kIpHeaderSize = 20;
constexpr std::size_t kUdpHeaderSize = 8;
constexpr std::size_t kChecksumOffset = 10;     // Offset in the IPv4 header.
constexpr std::size_t kAddressesOffset = 12;    // Offset in the IPv4 header.
constexpr std::size_t kUdpChecksumOffset = 26;  // Behind an IPv4 header without options.
constexpr std::uint8_t kVersion4 = 4;
constexpr std::uint8_t kUdpProtocol = 17;
constexpr std::uint8_t kTimeToLive = 64;
constexpr std::uint16_t kDoNotFragment = 0x4000;
constexpr std::uint16_t kFragmentMask = 0x3FFF;  // More fragments, and the fragment's offset.

std::uint8_t load_u8(Bytes bytes, std::size_t at) {
  return std::to_integer<std::uint8_t>(bytes[at]);
}

std::uint16_t load_u16(Bytes bytes, std::size_t at) {
  assert(at + 2 <= bytes.size());
  return boost::endian::load_big_u16(reinterpret_cast<const unsigned char*>(&bytes[at]));
}

std::uint32_t load_u32(Bytes bytes, std::size_t at) {
  assert(at + 4 <= bytes.size());
  return boost::endian::load_big_u32(reinterpret_cast<const unsigned char*>(&bytes[at]));
}

/// Appends big-endian fields to a buffer that has room for them.
class BigEndianWriter {
 public:
  explicit BigEndianWriter(std::span<std::byte> bytes) : bytes_(bytes) {}

  void u8(std::uint8_t value) { *take(1) = value; }
  void u16(std::size_t value) {
    boost::endian::store_big_u16(take(2), static_cast<std::uint16_t>(value));
  }
  void u32(std::uint32_t value) { boost::endian::store_big_u32(take(4), value); }

 private:
  unsigned char* take(std::size_t count) {
    assert(count <= bytes_.size());
    unsigned char* field = reinterpret_cast<unsigned char*>(bytes_.data());
    bytes_ = bytes_.subspan(count);
    return field;
  }
  std::span<std::byte> bytes_;
};

/// Sum of big-endian 16-bit words; a last odd byte counts as the high half of one.
std::uint32_t sum_of_words(Bytes bytes) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) sum += load_u16(bytes, i);
  if (bytes.size() % 2 != 0)
    sum += static_cast<std::uint32_t>(load_u8(bytes, bytes.size() - 1)) << 8;
  return sum;
}

/// The internet checksum (RFC 1071) of words with this sum.
std::uint16_t checksum(std::uint32_t sum) {
  while (sum > 0xFFFF) sum = (sum & 0xFFFF) + (sum >> 16);
  return static_cast<std::uint16_t>(~sum);
}

/// Over the datagram and RFC 768's pseudo-header; zero is sent as its complement.
std::uint16_t udp_checksum(Bytes headers, Bytes payload) {
  const std::size_t length = kUdpHeaderSize + payload.size();
  const std::uint16_t result =
      checksum(sum_of_words(headers.subspan(kAddressesOffset)) + sum_of_words(payload) +
               kUdpProtocol + static_cast<std::uint32_t>(length));
  return result == 0 ? 0xFFFF : result;
}

/// Where the frames of a link type name their network protocol, and where that begins.
struct FrameLayout {
  int link_type;
  std::size_t protocol_offset;
  std::size_t header_size;
};
constexpr FrameLayout kEtherTyped[] = {
    {DLT_EN10MB, 12, 14},
    {DLT_LINUX_SLL, 14, 16},
    {DLT_LINUX_SLL2, 0, 20},
};
constexpr std::uint16_t kEtherTypeIpv4 = 0x0800;

bool is_vlan_tag(std::uint16_t ether_type) {
  return ether_type == 0x8100 || ether_type == 0x88A8 || ether_type == 0x9100;
}

const FrameLayout* find_layout(int link_type) {
  const auto* found = std::ranges::find(kEtherTyped, link_type, &FrameLayout::link_type);
  return found == std::end(kEtherTyped) ? nullptr : found;
}

bool is_raw(int link_type) { return link_type == DLT_RAW || link_type == DLT_IPV4; }
bool is_loopback(int link_type) { return link_type == DLT_NULL || link_type == DLT_LOOP; }

std::optional<Bytes> find_behind_ether_type(const FrameLayout& layout, Bytes frame) {
  constexpr std::size_t kVlanTagSize = 4;
  constexpr std::size_t kInnerTypeOffset = 2;  // Offset in the tag: its number, then the type.
  if (frame.size() < layout.header_size) return {};
  std::uint16_t ether_type = load_u16(frame, layout.protocol_offset);
  Bytes rest = frame.subspan(layout.header_size);
  while (is_vlan_tag(ether_type)) {
    if (rest.size() < kVlanTagSize) return {};
    ether_type = load_u16(rest, kInnerTypeOffset);
    rest = rest.subspan(kVlanTagSize);
  }
  if (ether_type != kEtherTypeIpv4) return {};
  return rest;
}

std::optional<Bytes> find_behind_address_family(Bytes frame) {
  constexpr std::size_t kHeaderSize = 4;
  constexpr std::uint32_t kIpv4 = 2;
  if (frame.size() < kHeaderSize) return {};
  const std::uint32_t family = load_u32(frame, 0);
  // The byte order is that of the machine that captured, whichever that was.
  if (family != kIpv4 && boost::endian::endian_reverse(family) != kIpv4) return {};
  return frame.subspan(kHeaderSize);
}

}  // namespace

std::array<std::byte, kIpUdpHeaderSize> ip_udp_header(const Endpoint& from, const Endpoint& to,
                                                      std::span<const std::byte> payload) noexcept {
  std::array<std::byte, kIpUdpHeaderSize> header;
  BigEndianWriter fields(header);
  fields.u8(kVersion4 << 4 | kIpHeaderSize / 4);
  fields.u8(0);  // Type of service.
  fields.u16(kIpUdpHeaderSize + payload.size());
  fields.u16(0);  // Identification: means nothing where fragments are forbidden.
  fields.u16(kDoNotFragment);
  fields.u8(kTimeToLive);
  fields.u8(kUdpProtocol);
  fields.u16(0);  // Checksum, below.
  fields.u32(from.address);
  fields.u32(to.address);
  fields.u16(from.port);
  fields.u16(to.port);
  fields.u16(kUdpHeaderSize + payload.size());
  fields.u16(0);  // Checksum, below.

  const Bytes ip = Bytes(header).first(kIpHeaderSize);
  BigEndianWriter(std::span(header).subspan(kChecksumOffset)).u16(checksum(sum_of_words(ip)));
  BigEndianWriter(std::span(header).subspan(kUdpChecksumOffset)).u16(udp_checksum(header, payload));
  return header;
}

std::optional<UdpView> find_udp(std::span<const std::byte> packet) noexcept {
  if (packet.size() < kIpHeaderSize || load_u8(packet, 0) >> 4 != kVersion4) return {};
  const std::size_t ip_header_size = 4u * (load_u8(packet, 0) & 0x0Fu);
  const std::size_t total_length = load_u16(packet, 2);
  if (ip_header_size < kIpHeaderSize || total_length < ip_header_size + kUdpHeaderSize) return {};
  if (total_length > packet.size()) return {};
  if ((load_u16(packet, 6) & kFragmentMask) != 0 || load_u8(packet, 9) != kUdpProtocol) return {};

  const Bytes udp = packet.first(total_length).subspan(ip_header_size);
  const std::size_t udp_length = load_u16(udp, 4);
  if (udp_length < kUdpHeaderSize || udp_length > udp.size()) return {};
  return UdpView{
      .from = {.address = load_u32(packet, kAddressesOffset), .port = load_u16(udp, 0)},
      .to = {.address = load_u32(packet, kAddressesOffset + 4), .port = load_u16(udp, 2)},
      .payload = udp.first(udp_length).subspan(kUdpHeaderSize)};
}

bool is_known_link_type(int link_type) noexcept {
  return is_raw(link_type) || is_loopback(link_type) || find_layout(link_type) != nullptr;
}

std::optional<std::span<const std::byte>> find_ipv4(int link_type,
                                                    std::span<const std::byte> frame) noexcept {
  if (is_raw(link_type)) return frame;
  if (is_loopback(link_type)) return find_behind_address_family(frame);
  const FrameLayout* layout = find_layout(link_type);
  assert(layout != nullptr);
  return find_behind_ether_type(*layout, frame);
}

}  // namespace hlm::protocol
