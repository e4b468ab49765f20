#include "hlm/protocol/sealing/noise.h"

#include <algorithm>
#include <cassert>
#include <cstdlib>

#include <boost/endian/conversion.hpp>
#include <sodium.h>

namespace hlm::protocol::noise {
namespace {

static_assert(kKeySize == crypto_aead_chacha20poly1305_ietf_KEYBYTES);
static_assert(kKeySize == crypto_scalarmult_BYTES && kKeySize == crypto_scalarmult_SCALARBYTES);
static_assert(kTagSize == crypto_aead_chacha20poly1305_ietf_ABYTES);
static_assert(kHashSize == crypto_generichash_BYTES_MAX);

constexpr std::string_view kName = "Noise_NNpsk0_25519_ChaChaPoly_BLAKE2b";
constexpr std::size_t kBlockSize = 128;  // Block size of BLAKE2b, bytes.

using Hash = std::array<std::byte, kHashSize>;
using SecretHash = Secret<kHashSize>;

unsigned char* writable(MutableBytes bytes) {
  return reinterpret_cast<unsigned char*>(bytes.data());
}
const unsigned char* raw(Bytes bytes) {
  return reinterpret_cast<const unsigned char*>(bytes.data());
}
Bytes bytes_of(std::string_view text) { return std::as_bytes(std::span(text)); }

/// libsodium chooses its implementations once, before the first use.
void require_sodium() noexcept {
  static const bool ready = sodium_init() >= 0;
  if (!ready) std::abort();
}

void hash(std::initializer_list<Bytes> pieces, MutableBytes digest) noexcept {
  crypto_generichash_state state;
  crypto_generichash_init(&state, nullptr, 0, kHashSize);
  for (const Bytes piece : pieces) crypto_generichash_update(&state, raw(piece), piece.size());
  crypto_generichash_final(&state, writable(digest), kHashSize);
  sodium_memzero(&state, sizeof state);
}

/// HMAC (RFC 2104) with BLAKE2b for its hash, as Noise demands (4.3); BLAKE2b's own keyed mode is
/// another function. The key is at most a block long.
void hmac(Bytes key, std::initializer_list<Bytes> pieces, MutableBytes digest) noexcept {
  const auto padded = [key](std::byte with) {
    Secret<kBlockSize> block;
    std::copy(key.begin(), key.end(), block.begin());
    for (std::byte& byte : block) byte ^= with;
    return block;
  };
  crypto_generichash_state state;
  crypto_generichash_init(&state, nullptr, 0, kHashSize);
  crypto_generichash_update(&state, raw(padded(std::byte{0x36})), kBlockSize);
  for (const Bytes piece : pieces) crypto_generichash_update(&state, raw(piece), piece.size());
  SecretHash inner;
  crypto_generichash_final(&state, writable(inner), kHashSize);
  sodium_memzero(&state, sizeof state);
  hash({padded(std::byte{0x5C}), inner}, digest);
}

/// HKDF (4.3): as many outputs as asked for, at most three.
template <std::size_t count>
std::array<SecretHash, count> hkdf(Bytes chaining_key, Bytes material) noexcept {
  SecretHash key;
  hmac(chaining_key, {material}, key);
  std::array<SecretHash, count> outputs;
  for (std::size_t i = 0; i < count; ++i) {
    const std::array number{static_cast<std::byte>(i + 1)};
    hmac(key, {i == 0 ? Bytes() : Bytes(outputs[i - 1]), number}, outputs[i]);
  }
  return outputs;
}

Key key_from(const SecretHash& output) noexcept {
  Key key;
  std::copy_n(output.begin(), kKeySize, key.begin());
  return key;
}

using Nonce = std::array<unsigned char, crypto_aead_chacha20poly1305_ietf_NPUBBYTES>;

/// 32 zero bits, then the number (12.3).
Nonce nonce_of(std::uint64_t number) noexcept {
  Nonce nonce{};
  boost::endian::store_little_u64(nonce.data() + 4, number);
  return nonce;
}

void seal_with(Bytes data, const Key& key, std::uint64_t number, Bytes text,
               MutableBytes sealed) noexcept {
  assert(sealed.size() == text.size() + kTagSize);
  crypto_aead_chacha20poly1305_ietf_encrypt(writable(sealed), nullptr, raw(text), text.size(),
                                            raw(data), data.size(), nullptr,
                                            nonce_of(number).data(), raw(key));
}

bool open_with(Bytes data, const Key& key, std::uint64_t number, Bytes sealed,
               MutableBytes text) noexcept {
  if (sealed.size() < kTagSize) return false;
  assert(text.size() == sealed.size() - kTagSize);
  return crypto_aead_chacha20poly1305_ietf_decrypt(writable(text), nullptr, nullptr, raw(sealed),
                                                   sealed.size(), raw(data), data.size(),
                                                   nonce_of(number).data(), raw(key)) == 0;
}

}  // namespace

void wipe(MutableBytes bytes) noexcept { sodium_memzero(bytes.data(), bytes.size()); }

KeyPair random_key_pair() noexcept {
  require_sodium();
  Key secret_key;
  randombytes_buf(secret_key.data(), secret_key.size());
  return key_pair_of(secret_key);
}

KeyPair key_pair_of(const Key& secret_key) noexcept {
  KeyPair pair;
  pair.secret_key = secret_key;
  crypto_scalarmult_base(writable(pair.public_key), raw(secret_key));
  return pair;
}

void seal(const Key& key, std::uint64_t nonce, Bytes text, MutableBytes sealed) noexcept {
  assert(nonce <= kLastNonce);
  seal_with({}, key, nonce, text, sealed);
}

bool open(const Key& key, std::uint64_t nonce, Bytes sealed, MutableBytes text) noexcept {
  return open_with({}, key, nonce, sealed, text);
}

Handshake::Handshake(std::string_view prologue, const Key& pre_shared) noexcept {
  require_sodium();
  static_assert(kName.size() <= kHashSize);
  const Bytes name = bytes_of(kName);
  std::copy(name.begin(), name.end(), hash_.begin());
  std::copy(hash_.begin(), hash_.end(), chaining_key_.begin());
  mix_hash(bytes_of(prologue));
  mix_key_and_hash(pre_shared);
}

void Handshake::write_first(const KeyPair& ephemeral, Bytes payload,
                            MutableBytes message) noexcept {
  assert(message.size() == message_size(payload.size()));
  ephemeral_ = ephemeral.secret_key;
  std::copy(ephemeral.public_key.begin(), ephemeral.public_key.end(), message.begin());
  mix_public_key(ephemeral.public_key);
  encrypt_and_hash(payload, message.subspan(kKeySize));
}

bool Handshake::read_first(Bytes message, MutableBytes payload) noexcept {
  if (message.size() != message_size(payload.size())) return false;
  std::copy_n(message.begin(), kKeySize, initiator_.begin());
  mix_public_key(initiator_);
  return decrypt_and_hash(message.subspan(kKeySize), payload);
}

bool Handshake::write_second(const KeyPair& ephemeral, Bytes payload,
                             MutableBytes message) noexcept {
  assert(message.size() == message_size(payload.size()));
  std::copy(ephemeral.public_key.begin(), ephemeral.public_key.end(), message.begin());
  mix_public_key(ephemeral.public_key);
  if (!mix_shared(ephemeral.secret_key, initiator_)) return false;
  encrypt_and_hash(payload, message.subspan(kKeySize));
  return true;
}

bool Handshake::read_second(Bytes message, MutableBytes payload) noexcept {
  if (message.size() != message_size(payload.size())) return false;
  PublicKey responder;
  std::copy_n(message.begin(), kKeySize, responder.begin());
  mix_public_key(responder);
  if (!mix_shared(ephemeral_, responder)) return false;
  wipe(ephemeral_);
  return decrypt_and_hash(message.subspan(kKeySize), payload);
}

TransportKeys Handshake::split() const noexcept {
  const auto outputs = hkdf<2>(chaining_key_, {});
  return {key_from(outputs[0]), key_from(outputs[1])};
}

void Handshake::mix_hash(Bytes data) noexcept {
  const Hash before = hash_;
  noise::hash({before, data}, hash_);
}

void Handshake::mix_key(Bytes material) noexcept {
  const auto outputs = hkdf<2>(chaining_key_, material);
  chaining_key_ = outputs[0];
  key_ = key_from(outputs[1]);
}

void Handshake::mix_key_and_hash(Bytes material) noexcept {
  const auto outputs = hkdf<3>(chaining_key_, material);
  chaining_key_ = outputs[0];
  mix_hash(outputs[1]);
  key_ = key_from(outputs[2]);
}

/// The token e of a handshake with a pre-shared key (9.2).
void Handshake::mix_public_key(Bytes public_key) noexcept {
  mix_hash(public_key);
  mix_key(public_key);
}

/// The token ee.
bool Handshake::mix_shared(const Key& own, const PublicKey& others) noexcept {
  Key shared;
  if (crypto_scalarmult(writable(shared), raw(own), raw(others)) != 0) return false;
  mix_key(shared);
  return true;
}

/// Before each payload there is a new key, so its nonce is 0.
void Handshake::encrypt_and_hash(Bytes text, MutableBytes sealed) noexcept {
  seal_with(hash_, key_, 0, text, sealed);
  mix_hash(sealed);
}

bool Handshake::decrypt_and_hash(Bytes sealed, MutableBytes text) noexcept {
  if (!open_with(hash_, key_, 0, sealed, text)) return false;
  mix_hash(sealed);
  return true;
}

}  // namespace hlm::protocol::noise
