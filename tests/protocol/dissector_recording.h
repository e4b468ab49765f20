// Captures of whole, cut and changed messages, and what the dissector must show of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <utility>
#include <vector>

#include "hlm/protocol/codec.h"
#include "hlm/protocol/layout.h"
#include "hlm/protocol/transport/capture.h"
#include "tests/protocol/expected_fields.h"
#include "tests/protocol/tshark.h"
#include "tests/support/catch.h"

namespace hlm::protocol {

// The ends of each datagram, and the envelopes in and outside a session.
inline constexpr Endpoint kClient{.address = 0x0A000002, .port = 50000};
inline constexpr Endpoint kServer{.address = 0x0A000001, .port = 47800};
inline const Envelope kInSession{.session = 0xFEDCBA9876543210,
                                 .sequence = 0x8000000000000001,
                                 .send_time = -1'234'567'890'123'456'789};
inline const Envelope kOutside{.session = 0, .sequence = 3, .send_time = 9'000'000'000'000'000'001};

/// True, after saying so, where there is no tshark to test with.
inline bool is_skipped() {
  if (test::tshark_is_installed()) return false;
  WARN("skipped: tshark is not installed");
  return true;
}

/// Envelope of a message of this type.
template <class Message>
Envelope envelope_of() {
  return std::is_same_v<Message, Hello> || std::is_same_v<Message, Reject> ? kOutside : kInSession;
}

/// The message's datagrams.
template <class Message>
std::vector<DatagramBytes> all_parts(const Message& message) {
  std::vector<DatagramBytes> parts;
  for (std::uint8_t part = 0; part < part_count(message); ++part) {
    parts.push_back(encode(envelope_of<Message>(), message, part));
  }
  return parts;
}

/// The datagram of a message that needs no more.
template <class Message>
DatagramBytes only_part(const Message& message) {
  REQUIRE(part_count(message) == 1);
  return all_parts(message)[0];
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
  void add(const Message& message) {
    for (const DatagramBytes& part : all_parts(message)) {
      add(part);
      expected_.emplace_back(test::expected_part(message, view(part)), part.size());
    }
  }

  void check(const std::vector<std::vector<test::ShownField>>& packets) const {
    REQUIRE(packets.size() == expected_.size());
    for (std::size_t i = 0; i < packets.size(); ++i) {
      INFO("packet " << i + 1);
      expected_[i].first.check(packets[i], expected_[i].second);
    }
  }

 private:
  CaptureWriter writer_;
  std::int64_t time_ = 0;
  std::vector<std::pair<test::Expected, std::size_t>> expected_;
};

/// The bytes with a little-endian number of `size` bytes written at `at`.
inline DatagramBytes with(DatagramBytes bytes, std::size_t at, std::size_t size,
                          std::uint64_t value) {
  for (std::size_t i = 0; i < size; ++i) bytes[at + i] = static_cast<std::byte>(value >> (8 * i));
  return bytes;
}

/// Cut off, or with zeros appended.
inline DatagramBytes resized(DatagramBytes bytes, std::size_t size) {
  bytes.resize(size, std::byte{0});
  return bytes;
}

// Where fields of the header stand.
inline constexpr std::size_t kTypeAt = 6;
inline constexpr std::size_t kPartAt = 32;
inline constexpr std::size_t kPartsAt = 33;
inline constexpr std::size_t kLengthAt = 36;
inline constexpr std::size_t kBlockAt = 38;

/// The same with the length field of the header to match: only the contents do not fit.
inline DatagramBytes relabelled(const DatagramBytes& bytes, std::size_t size) {
  return with(resized(bytes, size), kLengthAt, 2, size);
}

inline std::uint16_t block_size(const DatagramBytes& bytes) {
  Header header;
  REQUIRE_FALSE(decode_header(view(bytes), header));
  return header.block;
}

/// Where the header of the first list stands.
inline std::size_t first_list(const DatagramBytes& bytes) {
  return layout::kHeaderSize + block_size(bytes);
}

}  // namespace hlm::protocol
