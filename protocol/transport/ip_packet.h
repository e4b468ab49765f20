// UDP datagrams in IPv4 packets, and IPv4 packets in the frames of a capture.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include "hlm/protocol/datagram_link.h"

namespace hlm::protocol {

/// IPv4 header without options, then UDP header, bytes.
inline constexpr std::size_t kIpUdpHeaderSize = 28;

/// A UDP datagram inside a packet.
struct UdpView {
  Endpoint from;
  Endpoint to;
  std::span<const std::byte> payload;
};

/// The headers before `payload` (at most 65507 bytes) on its way, checksums included.
std::array<std::byte, kIpUdpHeaderSize> ip_udp_header(const Endpoint& from, const Endpoint& to,
                                                      std::span<const std::byte> payload) noexcept;

/// The datagram in an IPv4 packet; bytes after the packet's end are padding. Empty if the packet is
/// malformed, cut off, a fragment, or not UDP.
std::optional<UdpView> find_udp(std::span<const std::byte> packet) noexcept;

/// Whether frames with this link type (DLT_… of libpcap) can be read.
bool is_known_link_type(int link_type) noexcept;
/// The IPv4 packet in a frame with a known link type; empty if it holds something else.
std::optional<std::span<const std::byte>> find_ipv4(int link_type,
                                                    std::span<const std::byte> frame) noexcept;

}  // namespace hlm::protocol
