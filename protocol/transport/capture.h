// Captures of datagrams, as ordinary packet files that tcpdump and Wireshark read and write.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "hlm/protocol/datagram_link.h"

struct gzFile_s;
struct pcap;
struct pcap_dumper;

namespace hlm::protocol {

struct CapturedDatagram {
  std::int64_t time_ns = 0;  ///< Time since the epoch, ns, >= 0.
  Endpoint from;
  Endpoint to;
  /// UDP payload; empty, as from DatagramLink::receive, if it was longer than kMaxDatagram.
  DatagramBytes bytes;
};

/// Writes a pcap file, packed by gzip if its name ends in ".gz": stamps in nanoseconds, IPv4 and
/// UDP headers with right checksums. If the process dies it is readable up to the latest flush.
class CaptureWriter {
 public:
  /// Replaces an existing file; "-" is standard output. Throws std::runtime_error naming the file
  /// if it cannot be written.
  explicit CaptureWriter(const std::filesystem::path& path);

  /// `time_ns` is ns since the epoch, >= 0; `bytes` are at most kMaxDatagram.
  void write(std::int64_t time_ns, const Endpoint& from, const Endpoint& to,
             std::span<const std::byte> bytes);
  /// Hands what was written to the system. Throws std::runtime_error naming the file if that, or
  /// any write before it, failed.
  void flush();

 private:
  struct Close {
    void operator()(pcap_dumper* file) const noexcept;
  };

  std::string path_;
  gzFile_s* gz_;  ///< What file_ writes to, and closes.
  std::unique_ptr<pcap_dumper, Close> file_;
};

/// Reads the IPv4 UDP datagrams of a pcap or pcapng file, packed by gzip or not, in the file's
/// order. The packets may be raw IP, Ethernet with or without VLAN tags, Linux cooked (SLL, SLL2)
/// or BSD loopback. Checksums are not verified: the sender's network card fills them in later.
class CaptureReader {
 public:
  /// "-" is standard input. Throws std::runtime_error naming the file if it cannot be read, is not
  /// a capture, or holds another kind of packets.
  explicit CaptureReader(const std::filesystem::path& path);

  /// The next datagram; empty at the end. Throws std::runtime_error naming the file if it is
  /// corrupt. A last packet that an interrupted writer left incomplete is skipped.
  std::optional<CapturedDatagram> next();
  /// Packets skipped so far: not IPv4 UDP, a fragment, malformed, not captured whole, or stamped
  /// before 1970 or after 2262.
  std::uint64_t skipped() const noexcept { return skipped_; }

 private:
  struct Close {
    void operator()(pcap* file) const noexcept;
  };

  std::string path_;
  std::unique_ptr<pcap, Close> file_;
  int link_type_ = 0;
  std::uint64_t skipped_ = 0;
};

}  // namespace hlm::protocol
