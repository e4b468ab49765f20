// The handshake Noise_NNpsk0_25519_ChaChaPoly_BLAKE2b, as The Noise Protocol Framework has it
// (revision 34, noiseprotocol.org; "N" below is its section N), over libsodium's primitives:
//
//   -> psk, e
//   <- e, ee
//
// Nothing here waits, allocates or throws.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace hlm::protocol::noise {

inline constexpr std::size_t kKeySize = 32;   ///< Size of a public key and a secret one, bytes.
inline constexpr std::size_t kTagSize = 16;   ///< Bytes by which a sealed text is longer.
inline constexpr std::size_t kHashSize = 64;  ///< Bytes.
/// Noise keeps the largest nonce for itself (5.1): the last with which a text may be sealed.
inline constexpr std::uint64_t kLastNonce = UINT64_MAX - 1;

using Bytes = std::span<const std::byte>;
using MutableBytes = std::span<std::byte>;

/// Overwrites with zeros, in a way that the compiler does not leave out.
void wipe(MutableBytes bytes) noexcept;

/// Bytes that are wiped when they go.
template <std::size_t size>
struct Secret : std::array<std::byte, size> {
  Secret() noexcept : std::array<std::byte, size>{} {}
  Secret(const Secret&) noexcept = default;
  Secret& operator=(const Secret&) noexcept = default;
  ~Secret() { wipe(*this); }
};
using Key = Secret<kKeySize>;
using PublicKey = std::array<std::byte, kKeySize>;

/// A key pair of Curve25519, for one handshake.
struct KeyPair {
  Key secret_key;
  PublicKey public_key{};
};
/// A key pair from the system's random source.
KeyPair random_key_pair() noexcept;
KeyPair key_pair_of(const Key& secret_key) noexcept;

/// ChaCha20-Poly1305 with Noise's nonce (12.3) and no additional data. `sealed` has room for the
/// text and kTagSize bytes more.
void seal(const Key& key, std::uint64_t nonce, Bytes text, MutableBytes sealed) noexcept;
/// False, and `text` means nothing, unless `sealed` was made with that key and nonce. `text` has
/// room for what is sealed without its tag.
[[nodiscard]] bool open(const Key& key, std::uint64_t nonce, Bytes sealed,
                        MutableBytes text) noexcept;

/// The keys of the two directions.
struct TransportKeys {
  Key from_initiator;
  Key from_responder;
};

/// One side of one handshake. The initiator calls write_first, read_second, split; the responder
/// read_first, write_second, split. After a read that failed the object is of no more use: try on
/// a copy. A payload may be empty.
class Handshake {
 public:
  /// What both sides know before the first message: equal prologues and the pre-shared key.
  Handshake(std::string_view prologue, const Key& pre_shared) noexcept;

  /// Bytes of either message with a payload of that size.
  static constexpr std::size_t message_size(std::size_t payload) {
    return kKeySize + payload + kTagSize;
  }

  /// `message` has message_size(payload.size()) bytes. `ephemeral` must serve no other handshake.
  void write_first(const KeyPair& ephemeral, Bytes payload, MutableBytes message) noexcept;
  /// False unless the sender holds the pre-shared key. Symmetric work alone: some microseconds.
  [[nodiscard]] bool read_first(Bytes message, MutableBytes payload) noexcept;
  /// Here is the Diffie-Hellman, some 50 µs. False if the other's public key is of low order.
  [[nodiscard]] bool write_second(const KeyPair& ephemeral, Bytes payload,
                                  MutableBytes message) noexcept;
  [[nodiscard]] bool read_second(Bytes message, MutableBytes payload) noexcept;
  /// After the second message.
  TransportKeys split() const noexcept;
  /// Different for any two handshakes, equal on both sides.
  const std::array<std::byte, kHashSize>& hash() const noexcept { return hash_; }

 private:
  void mix_hash(Bytes data) noexcept;
  void mix_key(Bytes material) noexcept;
  void mix_key_and_hash(Bytes material) noexcept;
  void mix_public_key(Bytes public_key) noexcept;
  [[nodiscard]] bool mix_shared(const Key& own, const PublicKey& others) noexcept;
  void encrypt_and_hash(Bytes text, MutableBytes sealed) noexcept;
  [[nodiscard]] bool decrypt_and_hash(Bytes sealed, MutableBytes text) noexcept;

  Secret<kHashSize> chaining_key_;
  std::array<std::byte, kHashSize> hash_{};
  Key key_;
  Key ephemeral_;          ///< The initiator's own, until the second message.
  PublicKey initiator_{};  ///< Public key of the initiator, for the responder.
};

}  // namespace hlm::protocol::noise
