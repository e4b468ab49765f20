#include "hlm/protocol/codec.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <type_traits>

#include "hlm/protocol/layout.h"

namespace hlm::protocol {
namespace {

using layout::kHeaderSize;
using layout::kListHeaderSize;

/// "HLMI" in the byte stream.
constexpr std::uint32_t kMagic = 0x494D4C48;
/// "HLS", which sealed packets begin with, and the bytes that it takes of a magic.
constexpr std::uint32_t kSealingMagic = 0x534C48;
constexpr std::uint32_t kSealingMask = 0xFFFFFF;
constexpr std::size_t kLengthPosition = 36;
constexpr std::size_t kBlockPosition = 38;
/// What a sender fills of a datagram.
constexpr std::size_t kRoom = kMaxDatagram - kSealRoom;
constexpr std::size_t kMaxLists = 7;

bool is_known(MessageType type) noexcept {
  return type >= MessageType::kHello && type <= MessageType::kHeldBodies;
}

bool is_outside_sessions(MessageType type) noexcept {
  return type == MessageType::kHello || type == MessageType::kReject;
}

/// Which items of each list one part holds.
struct Share {
  std::size_t first = 0;
  std::size_t count = 0;
  std::size_t total = 0;
};
using Shares = std::array<Share, kMaxLists>;

template <class List>
constexpr std::size_t item_size(const List&) noexcept {
  return layout::kItemSize<typename List::value_type>;
}

/// How many of its lists a message is sent with: at its end, what older senders do not send costs
/// no room while it is empty.
template <class Message>
std::size_t count_lists(const Message& message) noexcept {
  std::size_t count = 0;
  std::size_t i = 0;
  layout::lists(message, [&](const auto& list) {
    using Item = typename std::remove_cvref_t<decltype(list)>::value_type;
    ++i;
    if (!layout::kIsAppended<Item> || !list.empty()) count = i;
  });
  return count;
}

/// Puts as many items as fit behind those of the part before; false if none are left.
template <class Message>
bool next_shares(const Message& message, std::size_t block, Shares& shares) noexcept {
  std::size_t used = kHeaderSize + block + count_lists(message) * kListHeaderSize;
  bool any = false;
  std::size_t i = 0;
  layout::lists(message, [&](const auto& list) {
    Share& share = shares[i++];
    share.first += share.count;
    share.count = std::min((kRoom - used) / item_size(list), list.size() - share.first);
    used += share.count * item_size(list);
    any |= share.count > 0;
  });
  return any;
}

template <class Message>
std::size_t block_size(const Message& message) noexcept {
  DatagramBytes bytes;
  Writer writer(bytes);
  layout::block(writer, message);
  return bytes.size();
}

void write_header(Writer& writer, MessageType type, const Envelope& envelope, std::uint8_t part,
                  std::uint8_t parts) noexcept {
  writer.u32(kMagic);
  writer.u16(kProtocolVersion);
  writer.u8(type);
  writer.u8(0);  // flags
  writer.u64(envelope.session);
  writer.u64(envelope.sequence);
  writer.i64(envelope.send_time);
  writer.u8(part);
  writer.u8(parts);
  writer.u8(0);   // tool
  writer.u8(0);   // reserved
  writer.u16(0);  // length, known at the end
  writer.u16(0);  // block, known after it
}

void write_at(DatagramBytes& bytes, std::size_t position, std::size_t value) noexcept {
  DatagramBytes number;
  Writer(number).u16(static_cast<std::uint16_t>(value));
  std::copy(number.begin(), number.end(), bytes.begin() + static_cast<std::ptrdiff_t>(position));
}

template <class List>
void write_list(Writer& writer, const List& list, const Share& share) noexcept {
  writer.u16(static_cast<std::uint16_t>(share.first));
  writer.u16(static_cast<std::uint16_t>(share.count));
  writer.u16(static_cast<std::uint16_t>(list.size()));
  writer.u16(static_cast<std::uint16_t>(item_size(list)));
  for (std::size_t i = 0; i < share.count; ++i) layout::fields(writer, list[share.first + i]);
}

/// What is in front of a list.
struct ListHeader {
  Share share;
  std::uint16_t item_size = 0;
};

/// Reads it, and refuses what the list cannot hold. What an older sender does not send is empty.
template <class List>
ListHeader read_list_header(Reader& reader, const List& list) noexcept {
  if (layout::kIsAppended<typename List::value_type> && reader.at_end()) return {};
  std::uint16_t first = 0;
  std::uint16_t count = 0;
  std::uint16_t total = 0;
  std::uint16_t size = 0;
  reader.u16(first);
  reader.u16(count);
  reader.u16(total);
  reader.u16(size);
  reader.require(total <= list.capacity() && first + count <= total);
  reader.require(count == 0 || size >= item_size(list));
  return {{first, count, total}, size};
}

/// Reads a list's header and its items, each as many bytes as the sender gave it.
template <class List>
void read_list(Reader& reader, List& list, PartError& where) noexcept {
  const auto [share, item_size] = read_list_header(reader, list);
  if (reader.error()) return;
  list.resize(share.total);
  for (std::size_t i = share.first; i < share.first + share.count && !reader.error(); ++i) {
    where.in_item = true;
    where.item = i;
    const std::size_t end = reader.position() + item_size;
    layout::fields(reader, list[i]);
    reader.skip_to(end);
  }
  if (!reader.error()) where.in_item = false;
}

bool are_equal(std::span<const std::byte> a, std::span<const std::byte> b) noexcept {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size()) == 0;
}

/// The datagram's fixed fields.
std::span<const std::byte> block_of(std::span<const std::byte> bytes,
                                    const Header& header) noexcept {
  return bytes.subspan(kHeaderSize, header.block);
}

template <class Message>
std::optional<PartError> decode_body(std::span<const std::byte> bytes, const Header& header,
                                     Message& message) noexcept {
  Reader reader(bytes.first(kHeaderSize + header.block), kHeaderSize);
  layout::block(reader, message);
  if (reader.error()) return PartError{*reader.error(), reader.update_error(), false, 0};

  Reader lists(bytes, kHeaderSize + header.block);
  PartError where;
  layout::lists(message, [&](auto& list) {
    if (!lists.error()) read_list(lists, list, where);
  });
  if (!lists.error()) return std::nullopt;
  where.reason = *lists.error();
  where.error = lists.update_error();
  return where;
}

/// Which items of each list of `message` a part has. False if it cannot be read.
template <class Message>
bool read_shares(std::span<const std::byte> bytes, const Header& header, const Message& message,
                 Shares& shares) noexcept {
  Reader reader(bytes, kHeaderSize + header.block);
  std::size_t i = 0;
  layout::lists(message, [&](const auto& list) {
    const auto [share, item_size] = read_list_header(reader, list);
    reader.skip_to(reader.position() + share.count * item_size);
    shares[i++] = share;
  });
  return !reader.error();
}

using PartViews = StaticVector<std::span<const std::byte>, kMaxParts>;

PartViews views_of(std::span<const DatagramBytes> parts) noexcept {
  PartViews views;
  for (const DatagramBytes& part : parts) views.push_back(view(part));
  return views;
}

/// All parts, in order, with the same fixed fields and each list whole.
template <class Message>
bool are_of_one_message(const PartViews& parts, const Message& message) noexcept {
  Header first;
  Shares before{};  // What the parts up to here hold.
  for (std::size_t i = 0; i < parts.size(); ++i) {
    Header header;
    Shares shares{};
    if (decode_header(parts[i], header)) return false;
    if (!read_shares(parts[i], header, message, shares)) return false;
    if (i == 0) first = header;
    if (header.part != i || header.parts != parts.size()) return false;
    if (header.envelope != first.envelope) return false;
    if (!are_equal(block_of(parts[i], header), block_of(parts[0], first))) return false;
    for (std::size_t list = 0; list < kMaxLists; ++list) {
      const Share& share = shares[list];
      if (i > 0 && share.total != before[list].total) return false;
      if (share.first != before[list].count) return false;
      before[list].total = share.total;
      before[list].count += share.count;
    }
  }
  const auto is_whole = [](const Share& share) { return share.count == share.total; };
  return std::ranges::all_of(before, is_whole);
}

template <class Message>
std::optional<DropReason> decode_parts(const PartViews& parts, Message& message) noexcept {
  for (const std::span<const std::byte> part : parts) {
    if (const auto error = decode_part(part, message)) return error->reason;
  }
  if (!are_of_one_message(parts, message)) return DropReason::kMalformed;
  return std::nullopt;
}

/// A reject is the same in every version, so its header is not looked at.
std::optional<DropReason> decode_reject(std::span<const std::byte> bytes, Reject& reject) noexcept {
  Reader reader(bytes, kHeaderSize);
  layout::block(reader, reject);
  return reader.error();
}

}  // namespace

template <class Message>
std::uint8_t part_count(const Message& message) noexcept {
  const std::size_t block = block_size(message);
  Shares shares{};
  std::uint8_t parts = 0;
  while (next_shares(message, block, shares)) ++parts;
  return std::max<std::uint8_t>(1, parts);
}

template <class Message>
DatagramBytes encode(const Envelope& envelope, const Message& message, std::uint8_t part) noexcept {
  DatagramBytes bytes;
  Writer writer(bytes);
  write_header(writer, kTypeOf<Message>, envelope, part, part_count(message));
  layout::block(writer, message);
  const std::size_t block = bytes.size() - kHeaderSize;
  write_at(bytes, kBlockPosition, block);

  Shares shares{};
  for (std::size_t i = 0; i <= part; ++i) next_shares(message, block, shares);
  const std::size_t lists = count_lists(message);
  std::size_t i = 0;
  layout::lists(message, [&](const auto& list) {
    if (i < lists) write_list(writer, list, shares[i]);
    ++i;
  });
  write_at(bytes, kLengthPosition, bytes.size());
  return bytes;
}

std::optional<DropReason> decode_header(std::span<const std::byte> bytes, Header& header) noexcept {
  if (bytes.size() < kHeaderSize || bytes.size() > kMaxDatagram) return DropReason::kTruncated;
  std::uint32_t magic = 0;
  std::uint16_t version = 0;
  std::uint16_t length = 0;
  std::uint8_t flags = 0;
  std::uint8_t tool = 0;
  std::uint8_t reserved = 0;
  Reader reader(bytes);
  reader.u32(magic);
  reader.u16(version);
  reader.u8(header.type);
  reader.u8(flags);
  reader.u64(header.envelope.session);
  reader.u64(header.envelope.sequence);
  reader.i64(header.envelope.send_time);
  reader.u8(header.part);
  reader.u8(header.parts);
  reader.u8(tool);
  reader.u8(reserved);
  reader.u16(length);
  reader.u16(header.block);

  if ((magic & kSealingMask) == kSealingMagic) return DropReason::kSealed;
  if (magic != kMagic) return DropReason::kNotOurs;
  if (version != kProtocolVersion) return DropReason::kVersion;
  if (length > bytes.size()) return DropReason::kTruncated;
  if (!is_known(header.type)) return DropReason::kUnexpected;
  reader.require(length == bytes.size() && kHeaderSize + header.block <= length);
  reader.require(flags == 0 && tool == 0);
  reader.require(header.part < header.parts && header.parts <= kMaxParts);
  reader.require((header.envelope.session == 0) == is_outside_sessions(header.type));
  reader.require(header.envelope.sequence != 0);
  return reader.error();
}

template <class Message>
std::optional<PartError> decode_part(std::span<const std::byte> bytes, Message& message) noexcept {
  Header header;
  if (const auto reason = decode_header(bytes, header)) return PartError{.reason = *reason};
  if (header.type != kTypeOf<Message>) return PartError{.reason = DropReason::kUnexpected};
  return decode_body(bytes, header, message);
}

template <class Message>
std::optional<DropReason> decode(std::span<const std::byte> bytes, Message& message) noexcept {
  if constexpr (std::is_same_v<Message, Reject>) {
    const std::optional<StablePart> stable = read_stable_part(bytes);
    if (stable && stable->type == MessageType::kReject && stable->version != kProtocolVersion) {
      return decode_reject(bytes, message);
    }
  }
  return decode_parts({bytes}, message);
}

template <class Message>
std::optional<DropReason> decode(std::span<const DatagramBytes> parts, Message& message) noexcept {
  if (parts.empty() || parts.size() > kMaxParts) return DropReason::kMalformed;
  return decode_parts(views_of(parts), message);
}

template <class Message>
bool is_whole(std::span<const DatagramBytes> parts, const Message& message) noexcept {
  return are_of_one_message(views_of(parts), message);
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

#define HLM_INSTANTIATE(Message)                                                                \
  template std::uint8_t part_count(const Message&) noexcept;                                    \
  template DatagramBytes encode(const Envelope&, const Message&, std::uint8_t) noexcept;        \
  template std::optional<PartError> decode_part(std::span<const std::byte>, Message&) noexcept; \
  template std::optional<DropReason> decode(std::span<const std::byte>, Message&) noexcept;     \
  template std::optional<DropReason> decode(std::span<const DatagramBytes>, Message&) noexcept; \
  template bool is_whole(std::span<const DatagramBytes>, const Message&) noexcept;
HLM_INSTANTIATE(Hello)
HLM_INSTANTIATE(Welcome)
HLM_INSTANTIATE(Reject)
HLM_INSTANTIATE(ContactUpdate)
HLM_INSTANTIATE(ProxyState)
HLM_INSTANTIATE(Goodbye)
HLM_INSTANTIATE(Control)
HLM_INSTANTIATE(Ticks)
HLM_INSTANTIATE(LocalState)
HLM_INSTANTIATE(Refusal)
HLM_INSTANTIATE(Impulses)
HLM_INSTANTIATE(HeldBodies)
HLM_INSTANTIATE(SceneChunk)
HLM_INSTANTIATE(SceneState)
#undef HLM_INSTANTIATE

}  // namespace hlm::protocol
