// The fields that the dissector must show of each message: those of layout.h, behind a header.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "hlm/protocol/codec.h"
#include "hlm/protocol/layout.h"
#include "tests/protocol/expected.h"
#include "tests/support/catch.h"

namespace hlm::test {

/// The header of a datagram of `length` bytes.
inline void add_header(Expected& fields, const protocol::Header& header, std::size_t length) {
  fields.begin("hlm.");
  fields.shown("HLMI");
  fields.integer(protocol::kProtocolVersion);
  fields.enumeration(header.type);
  fields.integer(0);
  fields.integer(header.envelope.session);
  fields.integer(header.envelope.sequence);
  fields.integer(header.envelope.send_time);
  fields.integer(header.part);
  fields.integer(header.parts);
  fields.integer(0);
  fields.integer(0);
  fields.integer(length);
  fields.integer(header.block);
}

/// PROTOCOL.md's table of an item.
template <class Item>
inline const std::string kTable;
template <>
inline const std::string kTable<Link> = "link";
template <>
inline const std::string kTable<JointCurve> = "curve";
template <>
inline const std::string kTable<JointDrive> = "drive";
template <>
inline const std::string kTable<MovableBody> = "body";
template <>
inline const std::string kTable<ReportedContact> = "contact";
template <>
inline const std::string kTable<protocol::TickSignals> = "tick";
template <>
inline const std::string kTable<protocol::LocalContactReport> = "local_contact";
template <>
inline const std::string kTable<protocol::BodyImpulse> = "impulse";
template <>
inline const std::string kTable<BodyPose> = "pose";
template <>
inline const std::string kTable<AccelerationRate> = "rate";
template <>
inline const std::string kTable<ExternalWrench> = "wrench";
template <>
inline const std::string kTable<Ownership> = "owner";
template <>
inline const std::string kTable<protocol::HeldBody> = "held_body";

/// All that is shown of one part of a message.
template <class Message>
Expected expected_part(const Message& message, std::span<const std::byte> bytes) {
  protocol::Header header;
  REQUIRE_FALSE(protocol::decode_header(bytes, header));
  Expected fields;
  add_header(fields, header, bytes.size());
  const std::string name = "hlm." + std::string(name_of(header.type)) + ".";
  fields.begin(name);
  protocol::layout::block(fields, message);
  protocol::Reader reader(bytes, protocol::layout::kHeaderSize + header.block);
  protocol::layout::lists(message, [&](const auto& list) {
    using Item = typename std::remove_cvref_t<decltype(list)>::value_type;
    if (protocol::layout::kIsAppended<Item> && list.empty()) return;
    fields.begin(name);
    std::array<std::uint16_t, 4> share{};  // first, count, total, item_size
    for (std::uint16_t& number : share) {
      reader.u16(number);
      fields.integer(number);
    }
    fields.begin("hlm." + kTable<Item> + ".");
    for (std::size_t i = share[0]; i < std::size_t{share[0]} + share[1]; ++i) {
      protocol::layout::fields(fields, list[i]);
    }
    reader.skip_to(reader.position() + std::size_t{share[1]} * share[3]);
  });
  REQUIRE_FALSE(reader.error());
  return fields;
}

}  // namespace hlm::test
