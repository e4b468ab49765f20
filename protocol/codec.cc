#include "protocol/codec.h"

#include <algorithm>

#include "protocol/layout.h"

namespace hlm::protocol {
namespace {

using layout::kContactsPerPart;
using layout::kHeaderSize;
using layout::kLinksPerPart;

/// "HLMI" in the byte stream.
constexpr std::uint32_t kMagic = 0x494D4C48;
constexpr std::size_t kLengthPosition = 36;

/// How many items a message's list may have, and how many go into each part but the last.
struct ListRule {
  std::size_t smallest;
  std::size_t largest;
  std::size_t per_part;
};

constexpr ListRule list_rule(MessageType type) noexcept {
  switch (type) {
    case MessageType::kHello:
      return {1, kMaxLinks, kLinksPerPart};
    case MessageType::kContactUpdate:
      return {0, kMaxContacts, kContactsPerPart};
    case MessageType::kTicks:
      return {1, kTicksPerMessage, kTicksPerMessage};
    case MessageType::kLocalState:
      return {0, kMaxContacts, layout::kLocalContactsPerPart};
    case MessageType::kWelcome:
    case MessageType::kReject:
    case MessageType::kProxyState:
    case MessageType::kGoodbye:
    case MessageType::kControl:
      break;
  }
  return {0, 0, 1};
}

constexpr std::size_t parts_for(ListRule rule, std::size_t items_total) noexcept {
  return std::max<std::size_t>(1, (items_total + rule.per_part - 1) / rule.per_part);
}
static_assert(parts_for(list_rule(MessageType::kHello), kMaxLinks) <= kMaxParts);
static_assert(parts_for(list_rule(MessageType::kContactUpdate), kMaxContacts) <= kMaxParts);
static_assert(parts_for(list_rule(MessageType::kLocalState), kMaxContacts) <= kMaxParts);

/// Precondition: part < parts_for(rule, items_total).
Slice slice_of(ListRule rule, std::size_t items_total, std::size_t part) noexcept {
  const std::size_t first = part * rule.per_part;
  return {.part = static_cast<std::uint8_t>(part),
          .parts = static_cast<std::uint8_t>(parts_for(rule, items_total)),
          .items = static_cast<std::uint8_t>(std::min(rule.per_part, items_total - first)),
          .items_total = static_cast<std::uint8_t>(items_total)};
}

bool is_valid(const Slice& slice, ListRule rule) noexcept {
  const std::size_t total = slice.items_total;
  if (total < rule.smallest || total > rule.largest) return false;
  return slice.part < parts_for(rule, total) && slice == slice_of(rule, total, slice.part);
}

/// The list of a message; an empty one where the message has none.
const auto& items_of(const Hello& hello) noexcept { return hello.tool.links; }
const auto& items_of(const ContactUpdate& update) noexcept { return update.contacts; }
auto& items_of(Hello& hello) noexcept { return hello.tool.links; }
auto& items_of(ContactUpdate& update) noexcept { return update.contacts; }
const auto& items_of(const Ticks& ticks) noexcept { return ticks.ticks; }
auto& items_of(Ticks& ticks) noexcept { return ticks.ticks; }
const auto& items_of(const LocalState& state) noexcept { return state.contacts; }
auto& items_of(LocalState& state) noexcept { return state.contacts; }

template <class Message>
concept HasList = requires(Message message) {
  items_of(message);
};

template <class Message>
constexpr MessageType kTypeOf = MessageType::kHello;
template <>
constexpr MessageType kTypeOf<Welcome> = MessageType::kWelcome;
template <>
constexpr MessageType kTypeOf<Reject> = MessageType::kReject;
template <>
constexpr MessageType kTypeOf<ContactUpdate> = MessageType::kContactUpdate;
template <>
constexpr MessageType kTypeOf<ProxyState> = MessageType::kProxyState;
template <>
constexpr MessageType kTypeOf<Goodbye> = MessageType::kGoodbye;
template <>
constexpr MessageType kTypeOf<Control> = MessageType::kControl;
template <>
constexpr MessageType kTypeOf<Ticks> = MessageType::kTicks;
template <>
constexpr MessageType kTypeOf<LocalState> = MessageType::kLocalState;

void write_header(Writer& writer, MessageType type, const Envelope& envelope,
                  const Slice& slice) noexcept {
  writer.u32(kMagic);
  writer.u16(kProtocolVersion);
  writer.u8(type);
  writer.u8(0);  // flags
  writer.u64(envelope.session);
  writer.u64(envelope.sequence);
  writer.i64(envelope.send_time);
  writer.u8(slice.part);
  writer.u8(slice.parts);
  writer.u8(slice.items);
  writer.u8(slice.items_total);
  writer.u16(0);  // length, known at the end
  writer.u16(0);  // reserved
}

void write_length(DatagramBytes& bytes) noexcept {
  DatagramBytes length;
  Writer(length).u16(static_cast<std::uint16_t>(bytes.size()));
  std::copy(length.begin(), length.end(), bytes.begin() + kLengthPosition);
}

template <class Message>
std::size_t item_count(const Message& message) noexcept {
  if constexpr (HasList<const Message>) return items_of(message).size();
  return 0;
}

template <class Message>
DatagramBytes encode_part(const Envelope& envelope, const Message& message,
                          std::size_t part) noexcept {
  const ListRule rule = list_rule(kTypeOf<Message>);
  const Slice slice = slice_of(rule, item_count(message), part);
  DatagramBytes bytes;
  Writer writer(bytes);
  write_header(writer, kTypeOf<Message>, envelope, slice);
  layout::body(writer, message);
  if constexpr (HasList<const Message>) {
    const std::size_t first = part * rule.per_part;
    for (std::size_t i = 0; i < slice.items; ++i) {
      layout::item(writer, items_of(message)[first + i]);
    }
  }
  write_length(bytes);
  return bytes;
}

bool is_known(MessageType type) noexcept {
  return type >= MessageType::kHello && type <= MessageType::kLocalState;
}

bool is_outside_sessions(MessageType type) noexcept {
  return type == MessageType::kHello || type == MessageType::kReject;
}

template <class Message>
std::optional<DropReason> decode_body(std::span<const std::byte> bytes, Message& message) noexcept {
  Reader reader(bytes, kHeaderSize);
  layout::body(reader, message);
  return reader.finish();
}

template <class Message>
std::optional<DropReason> decode_single(std::span<const std::byte> bytes,
                                        Message& message) noexcept {
  Header header;
  if (const auto reason = decode_header(bytes, header)) return reason;
  if (header.type != kTypeOf<Message>) return DropReason::kUnexpected;
  return decode_body(bytes, message);
}

/// Reads one part's block and appends its items. `block` is set to the block's bytes.
template <class Message>
std::optional<DropReason> decode_part(std::span<const std::byte> bytes, std::size_t items,
                                      Message& message,
                                      std::span<const std::byte>& block) noexcept {
  Reader reader(bytes, kHeaderSize);
  layout::body(reader, message);
  block = bytes.subspan(kHeaderSize, reader.position() - kHeaderSize);
  auto& list = items_of(message);
  for (std::size_t i = 0; i < items && !reader.error(); ++i) {
    list.emplace_back();
    layout::item(reader, list.back());
  }
  return reader.finish();
}

template <class Message>
std::optional<DropReason> decode_parts(std::span<const DatagramBytes> parts,
                                       Message& message) noexcept {
  if (parts.empty()) return DropReason::kMalformed;
  items_of(message).clear();
  Header first;
  std::span<const std::byte> first_block;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const std::span<const std::byte> bytes = view(parts[i]);
    Header header;
    if (const auto reason = decode_header(bytes, header)) return reason;
    if (header.type != kTypeOf<Message>) return DropReason::kUnexpected;
    if (header.slice.part != i || header.slice.parts != parts.size()) return DropReason::kMalformed;
    if (i == 0) first = header;
    if (header.envelope != first.envelope) return DropReason::kMalformed;
    if (header.slice.items_total != first.slice.items_total) return DropReason::kMalformed;

    std::span<const std::byte> block;
    if (const auto reason = decode_part(bytes, header.slice.items, message, block)) return reason;
    if (i == 0) first_block = block;
    if (!std::ranges::equal(block, first_block)) return DropReason::kMalformed;
  }
  return std::nullopt;
}

}  // namespace

std::uint8_t part_count(const Hello& hello) noexcept {
  return static_cast<std::uint8_t>(
      parts_for(list_rule(MessageType::kHello), hello.tool.links.size()));
}

std::uint8_t part_count(const LocalState& state) noexcept {
  return static_cast<std::uint8_t>(
      parts_for(list_rule(MessageType::kLocalState), state.contacts.size()));
}

std::uint8_t part_count(const ContactUpdate& update) noexcept {
  return static_cast<std::uint8_t>(
      parts_for(list_rule(MessageType::kContactUpdate), update.contacts.size()));
}

DatagramBytes encode(const Envelope& envelope, const Hello& hello, std::uint8_t part) noexcept {
  return encode_part(envelope, hello, part);
}
DatagramBytes encode(const Envelope& envelope, const Welcome& welcome, std::uint8_t part) noexcept {
  return encode_part(envelope, welcome, part);
}
DatagramBytes encode(const Envelope& envelope, const Reject& reject, std::uint8_t part) noexcept {
  return encode_part(envelope, reject, part);
}
DatagramBytes encode(const Envelope& envelope, const ContactUpdate& update,
                     std::uint8_t part) noexcept {
  return encode_part(envelope, update, part);
}
DatagramBytes encode(const Envelope& envelope, const ProxyState& state,
                     std::uint8_t part) noexcept {
  return encode_part(envelope, state, part);
}
DatagramBytes encode(const Envelope& envelope, const Goodbye& goodbye, std::uint8_t part) noexcept {
  return encode_part(envelope, goodbye, part);
}
DatagramBytes encode(const Envelope& envelope, const Control& control, std::uint8_t part) noexcept {
  return encode_part(envelope, control, part);
}
DatagramBytes encode(const Envelope& envelope, const Ticks& ticks, std::uint8_t part) noexcept {
  return encode_part(envelope, ticks, part);
}
DatagramBytes encode(const Envelope& envelope, const LocalState& state,
                     std::uint8_t part) noexcept {
  return encode_part(envelope, state, part);
}

std::optional<DropReason> decode_header(std::span<const std::byte> bytes, Header& header) noexcept {
  if (bytes.size() < kHeaderSize || bytes.size() > kMaxDatagram) return DropReason::kTruncated;
  std::uint32_t magic = 0;
  std::uint16_t version = 0;
  std::uint16_t length = 0;
  std::uint16_t reserved = 0;
  std::uint8_t flags = 0;
  Reader reader(bytes);
  reader.u32(magic);
  reader.u16(version);
  reader.u8(header.type);
  reader.u8(flags);
  reader.u64(header.envelope.session);
  reader.u64(header.envelope.sequence);
  reader.i64(header.envelope.send_time);
  reader.u8(header.slice.part);
  reader.u8(header.slice.parts);
  reader.u8(header.slice.items);
  reader.u8(header.slice.items_total);
  reader.u16(length);
  reader.u16(reserved);

  if (magic != kMagic) return DropReason::kNotOurs;
  if (version != kProtocolVersion) return DropReason::kVersion;
  if (length > bytes.size()) return DropReason::kTruncated;
  reader.require(length == bytes.size() && flags == 0 && reserved == 0);
  reader.require(is_known(header.type) && is_valid(header.slice, list_rule(header.type)));
  reader.require((header.envelope.session == 0) == is_outside_sessions(header.type));
  reader.require(header.envelope.sequence != 0);
  return reader.error();
}

std::optional<DropReason> decode(std::span<const std::byte> bytes, Welcome& welcome) noexcept {
  return decode_single(bytes, welcome);
}

std::optional<DropReason> decode(std::span<const std::byte> bytes, Reject& reject) noexcept {
  const std::optional<StablePart> stable = read_stable_part(bytes);
  if (!stable || stable->type != MessageType::kReject || stable->version == kProtocolVersion) {
    return decode_single(bytes, reject);
  }
  return decode_body(bytes, reject);
}

std::optional<DropReason> decode(std::span<const std::byte> bytes, ProxyState& state) noexcept {
  return decode_single(bytes, state);
}

std::optional<DropReason> decode(std::span<const std::byte> bytes, Goodbye& goodbye) noexcept {
  return decode_single(bytes, goodbye);
}

std::optional<DropReason> decode(std::span<const std::byte> bytes, Control& control) noexcept {
  return decode_single(bytes, control);
}

std::optional<DropReason> decode(std::span<const std::byte> bytes, Ticks& ticks) noexcept {
  Header header;
  if (const auto reason = decode_header(bytes, header)) return reason;
  if (header.type != MessageType::kTicks) return DropReason::kUnexpected;
  ticks.ticks.clear();
  std::span<const std::byte> block;
  return decode_part(bytes, header.slice.items, ticks, block);
}

std::optional<DropReason> decode(std::span<const DatagramBytes> parts, LocalState& state) noexcept {
  return decode_parts(parts, state);
}

std::optional<DropReason> decode(std::span<const DatagramBytes> parts, Hello& hello) noexcept {
  return decode_parts(parts, hello);
}

std::optional<DropReason> decode(std::span<const DatagramBytes> parts,
                                 ContactUpdate& update) noexcept {
  return decode_parts(parts, update);
}

std::optional<StablePart> read_stable_part(std::span<const std::byte> bytes) noexcept {
  StablePart stable;
  std::uint32_t magic = 0;
  Reader reader(bytes);
  reader.u32(magic);
  reader.u16(stable.version);
  reader.u8(stable.type);
  Reader nonce(bytes, kHeaderSize);
  nonce.u64(stable.nonce);
  if (reader.error() || nonce.error() || magic != kMagic) return std::nullopt;
  return stable;
}

}  // namespace hlm::protocol
