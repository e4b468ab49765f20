// Files of the capture tests: a directory that vanishes with its test, and captures of any kind.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include <pcap/pcap.h>
#include <unistd.h>

#include "hlm/protocol/transport/capture.h"

namespace hlm::test {

using ByteVector = std::vector<std::byte>;

class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    std::string name = (std::filesystem::temp_directory_path() / "hlm_test_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary directory");
    path_ = name;
  }
  ~TemporaryDirectory() { std::filesystem::remove_all(path_); }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

/// Bytes from hexadecimal digits; blanks separate.
inline ByteVector from_hex(const std::string& text) {
  ByteVector bytes;
  std::string digits;
  for (const char c : text) {
    if (c == ' ') continue;
    digits += c;
    if (digits.size() < 2) continue;
    bytes.push_back(static_cast<std::byte>(std::stoi(digits, nullptr, 16)));
    digits.clear();
  }
  return bytes;
}

inline ByteVector operator+(ByteVector a, const ByteVector& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

inline ByteVector read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> text{std::istreambuf_iterator<char>(file), {}};
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

inline void write_file(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
}

/// One packet of a capture made by another program.
struct CapturedFrame {
  ByteVector bytes;
  std::size_t cut = 0;  ///< Bytes that the capture left out at the end.
};

/// Writes a pcap file with stamps of 1 s, 2 s, … plus 7 µs, in microseconds.
inline void write_frames(const std::filesystem::path& path, int link_type,
                         const std::vector<CapturedFrame>& frames) {
  pcap_t* const format = pcap_open_dead(link_type, 65535);
  pcap_dumper_t* const file = pcap_dump_open(format, path.c_str());
  pcap_pkthdr record{};
  record.ts.tv_usec = 7;
  for (const CapturedFrame& frame : frames) {
    ++record.ts.tv_sec;
    record.caplen = static_cast<bpf_u_int32>(frame.bytes.size() - frame.cut);
    record.len = static_cast<bpf_u_int32>(frame.bytes.size());
    pcap_dump(reinterpret_cast<u_char*>(file), &record,
              reinterpret_cast<const u_char*>(frame.bytes.data()));
  }
  pcap_dump_close(file);
  pcap_close(format);
}

/// A pcapng file of one IPv4 packet of 33 bytes, stamped 0x18d7000000000123 ns.
inline ByteVector pcapng_of(const ByteVector& packet) {
  const ByteVector section =
      from_hex("0a0d0d0a 1c000000 4d3c2b1a 0100 0000 ffffffffffffffff 1c000000");
  const ByteVector interface = from_hex(  // Raw IP; stamps count 10^-9 s.
      "01000000 20000000 6500 0000 00000400 0900 0100 09000000 00000000 20000000");
  const ByteVector head = from_hex(  // The stamp; 33 bytes and 3 of padding.
      "06000000 44000000 00000000 0000d718 23010000 21000000 21000000");
  return section + interface + head + packet + from_hex("000000 44000000");
}

inline std::vector<protocol::CapturedDatagram> read_all(protocol::CaptureReader& reader) {
  std::vector<protocol::CapturedDatagram> datagrams;
  while (auto datagram = reader.next()) datagrams.push_back(*datagram);
  return datagrams;
}

}  // namespace hlm::test
