// The handshake against a published vector, against PROTOCOL.md, and against what is wrong.
#include "hlm/protocol/sealing/noise.h"

#include <algorithm>
#include <string>
#include <vector>

#include "hlm/protocol/sealing/packets.h"
#include "hlm/protocol/sealing/sealed_channel.h"
#include "tests/protocol/sealing/document_vector.h"
#include "tests/support/catch.h"

namespace hlm::protocol::noise {
namespace {

using test::from_hex;
using test::key_from_hex;
using ByteVector = std::vector<std::byte>;

struct Sides {
  explicit Sides(const Key& key, std::string_view prologue = "p")
      : initiator(prologue, key), responder(prologue, key) {}

  Handshake initiator;
  Handshake responder;
};

template <class Bytes>
ByteVector vector_of(const Bytes& bytes) {
  return {bytes.begin(), bytes.end()};
}

/// Both messages, with payloads, as sent and read; whether each could be read.
ByteVector exchange_first(Sides& sides, const Key& secret, const ByteVector& payload) {
  ByteVector message(Handshake::message_size(payload.size()));
  sides.initiator.write_first(key_pair_of(secret), payload, message);
  ByteVector read(payload.size());
  REQUIRE(sides.responder.read_first(message, read));
  CHECK(read == payload);
  return message;
}

ByteVector exchange_second(Sides& sides, const Key& secret, const ByteVector& payload) {
  ByteVector message(Handshake::message_size(payload.size()));
  REQUIRE(sides.responder.write_second(key_pair_of(secret), payload, message));
  ByteVector read(payload.size());
  REQUIRE(sides.initiator.read_second(message, read));
  CHECK(read == payload);
  return message;
}

ByteVector sealed(const Key& key, std::uint64_t nonce, const ByteVector& text) {
  ByteVector result(text.size() + kTagSize);
  seal(key, nonce, text, result);
  return result;
}

// From the collection of vectors that the Haskell implementation "cacophony" publishes.
TEST_CASE("The handshake gives the published vector's bytes") {
  Sides sides(key_from_hex("54686973206973206d7920417573747269616e20706572737065637469766521"),
              "John Galt");
  CHECK(exchange_first(
            sides, key_from_hex("893e28b9dc6ca8d611ab664754b8ceb7bac5117349a4439a6b0569da977c464a"),
            from_hex("4c756477696720766f6e204d69736573")) ==
        from_hex("ca35def5ae56cec33dc2036731ab14896bc4c75dbb07a61f879f8e3afa4c7944ed63df2f5a12aee1"
                 "185ee9c50305f2ecf12421dcb53c047a63b784cf7c54a105"));
  CHECK(exchange_second(
            sides, key_from_hex("bbdb4cdbd309f1a1f2e1456967fe288cadd6f712d65dc7b7793d5e63da6b375b"),
            from_hex("4d757272617920526f746862617264")) ==
        from_hex("95ebc60d2b1fa672c1f46a8aa265ef51bfe38e7ccb39ec5be34069f1448088430e0fe7d5c0c9b92f"
                 "7478716c8852f1b4f389edb75e3ebe546fafafd5b6f0f7"));
  CHECK(vector_of(sides.initiator.hash()) ==
        from_hex("ed5e9692d0ab507b6c2beec3f584fd5b127817a9d20b26cd50aa72c507260fa31aa7d88dd3723316"
                 "338af37ce0b4cfb2923aeb848bbf2b934911306f01ffc963"));
  const TransportKeys keys = sides.initiator.split();
  CHECK(sealed(keys.from_initiator, 0, from_hex("462e20412e20486179656b")) ==
        from_hex("0fe04b26dcfbb69f8a6a94c61f1a26ef88769218d32f5d17c068a6"));
  CHECK(sealed(keys.from_responder, 0, from_hex("4361726c204d656e676572")) ==
        from_hex("2239e0c540c01f09eb1f4cc5258fd5acfefff18a5a3773f21b7bfe"));
  CHECK(sealed(keys.from_initiator, 1, from_hex("4a65616e2d426170746973746520536179")) ==
        from_hex("f216cb03d30fb8af1e561fe02a07552d09b416e27a75e62c77d193718b0bdaae9f"));
}

TEST_CASE("Handshake and sealed packets have the bytes of the document's vector") {
  const test::DocumentVector document;
  Sides sides(document.key("key"), kPrologue);
  const auto with_header = [](const DatagramBytes& header, const ByteVector& message) {
    ByteVector packet = vector_of(header);
    packet.insert(packet.end(), message.begin(), message.end());
    return packet;
  };
  constexpr ChannelIndex kClient = 0x01020304;
  constexpr ChannelIndex kServer = 0x05060708;
  CHECK(with_header(initiation_header(), exchange_first(sides, document.key("client_secret"),
                                                        vector_of(to_payload(kClient)))) ==
        document.value("initiation"));
  CHECK(with_header(response_header(kClient), exchange_second(sides, document.key("server_secret"),
                                                              vector_of(to_payload(kServer)))) ==
        document.value("response"));
  const TransportKeys keys = sides.responder.split();
  CHECK(vector_of(keys.from_initiator) == document.value("client_seals_with"));
  CHECK(vector_of(keys.from_responder) == document.value("server_seals_with"));

  const SealedChannel::Keys clients{keys.from_initiator, keys.from_responder};
  const SealedChannel::Keys servers{keys.from_responder, keys.from_initiator};
  CHECK(vector_of(SealedChannel(kClient, kServer, clients).seal(document.example("hello"))) ==
        document.value("hello"));
  CHECK(vector_of(SealedChannel(kServer, kClient, servers).seal(document.example("welcome"))) ==
        document.value("welcome"));
  CHECK(vector_of(SealedChannel(kClient, kServer, clients, std::uint64_t{1} << 32u)
                      .seal(document.example("goodbye"))) == document.value("goodbye"));
}

TEST_CASE("A first message with another key or prologue, or with any bit changed, is not read") {
  const Key key = random_key_pair().secret_key;
  ByteVector message(Handshake::message_size(4));
  Handshake("p", key).write_first(random_key_pair(), ByteVector(4), message);
  ByteVector payload(4);
  CHECK(Handshake("p", key).read_first(message, payload));
  CHECK_FALSE(Handshake("q", key).read_first(message, payload));
  CHECK_FALSE(Handshake("p", random_key_pair().secret_key).read_first(message, payload));
  for (std::size_t bit = 0; bit < 8 * message.size(); ++bit) {
    ByteVector changed = message;
    changed[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
    CHECK_FALSE(Handshake("p", key).read_first(changed, payload));
  }
}

TEST_CASE("A second message with any bit changed, or to another first one, is not read") {
  const Key key = random_key_pair().secret_key;
  Sides sides(key);
  exchange_first(sides, random_key_pair().secret_key, ByteVector(4));
  ByteVector message(Handshake::message_size(4));
  REQUIRE(sides.responder.write_second(random_key_pair(), ByteVector(4), message));
  ByteVector payload(4);
  for (std::size_t bit = 0; bit < 8 * message.size(); ++bit) {
    ByteVector changed = message;
    changed[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
    CHECK_FALSE(Handshake(sides.initiator).read_second(changed, payload));
  }
  Sides others(key);
  exchange_first(others, random_key_pair().secret_key, ByteVector(4));
  CHECK_FALSE(others.initiator.read_second(message, payload));
  CHECK(sides.initiator.read_second(message, payload));
}

TEST_CASE("A public key that makes every shared secret zero is refused") {
  Sides sides(random_key_pair().secret_key);
  KeyPair zero = random_key_pair();
  zero.public_key.fill(std::byte{0});
  ByteVector message(Handshake::message_size(0));
  sides.initiator.write_first(zero, {}, message);
  REQUIRE(sides.responder.read_first(message, {}));
  CHECK_FALSE(sides.responder.write_second(random_key_pair(), {}, message));
}

TEST_CASE("Two handshakes with one key give different keys") {
  const Key key = random_key_pair().secret_key;
  const auto keys_of_one = [&] {
    Sides sides(key);
    exchange_first(sides, random_key_pair().secret_key, {});
    exchange_second(sides, random_key_pair().secret_key, {});
    return sides.responder.split();
  };
  const TransportKeys first = keys_of_one();
  const TransportKeys second = keys_of_one();
  CHECK(first.from_initiator != second.from_initiator);
  CHECK(first.from_responder != second.from_responder);
  CHECK(first.from_initiator != first.from_responder);
}

TEST_CASE("A secret is wiped when it goes") {
  alignas(Key) std::array<std::byte, sizeof(Key)> place;
  Key* const key = new (place.data()) Key(random_key_pair().secret_key);
  CHECK(std::ranges::any_of(place, [](std::byte byte) { return byte != std::byte{0}; }));
  key->~Key();
  CHECK(std::ranges::all_of(place, [](std::byte byte) { return byte == std::byte{0}; }));
}

}  // namespace
}  // namespace hlm::protocol::noise
