// Random changes to inputs, as a fuzzer makes them, but without feedback.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

namespace hlm::fuzz {

using Bytes = std::vector<std::uint8_t>;

class Mutator {
 public:
  Mutator(const std::vector<Bytes>& corpus, std::uint64_t seed) : corpus_(corpus), engine_(seed) {}

  /// One of the corpus with one to eight changes.
  Bytes next() {
    Bytes bytes = corpus_[below(corpus_.size())];
    for (std::size_t n = 1 + below(8); n > 0; --n) change(bytes);
    return bytes;
  }

 private:
  std::size_t below(std::size_t end) {
    return std::uniform_int_distribution<std::size_t>(0, end - 1)(engine_);
  }
  auto at(Bytes& bytes, std::size_t index) {
    return bytes.begin() + static_cast<std::ptrdiff_t>(index);
  }

  void change(Bytes& bytes) {
    if (bytes.empty()) return bytes.push_back(static_cast<std::uint8_t>(below(256)));
    switch (below(6)) {
      case 0:
        bytes[below(bytes.size())] ^= static_cast<std::uint8_t>(1u << below(8));
        return;
      case 1:
        bytes[below(bytes.size())] = static_cast<std::uint8_t>(below(256));
        return;
      case 2:
        return put_number(bytes);
      case 3:
        return erase(bytes);
      case 4:
        return repeat(bytes);
      case 5:
        return splice(bytes);
    }
  }

  /// A number that is seldom met.
  void put_number(Bytes& bytes) {
    using Limits = std::numeric_limits<double>;
    constexpr std::array kDoubles{0.0,
                                  -1.0,
                                  1e-300,
                                  1e30,
                                  -1e200,
                                  Limits::infinity(),
                                  Limits::max(),
                                  -0.0,
                                  Limits::quiet_NaN(),
                                  1e9};
    constexpr std::array<std::uint64_t, 6> kWholes{0,      1,          0x7F,
                                                   0x7FFF, 0x7FFFFFFF, ~std::uint64_t{0}};
    std::array<std::uint8_t, 8> number{};
    std::size_t size = sizeof(double);
    if (below(2) == 0) {
      std::memcpy(number.data(), &kDoubles[below(kDoubles.size())], size);
    } else {
      size = std::size_t{1} << below(4);
      std::memcpy(number.data(), &kWholes[below(kWholes.size())], size);
    }
    const std::size_t place = below(bytes.size());
    for (std::size_t i = 0; i < size && place + i < bytes.size(); ++i) bytes[place + i] = number[i];
  }

  void erase(Bytes& bytes) {
    const std::size_t first = below(bytes.size());
    const std::size_t count = 1 + below(std::min<std::size_t>(bytes.size() - first, 64));
    bytes.erase(at(bytes, first), at(bytes, first + count));
  }

  void repeat(Bytes& bytes) {
    const std::size_t first = below(bytes.size());
    const std::size_t count = 1 + below(std::min<std::size_t>(bytes.size() - first, 64));
    const Bytes part(at(bytes, first), at(bytes, first + count));
    bytes.insert(at(bytes, below(bytes.size() + 1)), part.begin(), part.end());
  }

  /// Its begin, and the end of another.
  void splice(Bytes& bytes) {
    const Bytes& other = corpus_[below(corpus_.size())];
    if (other.empty()) return;
    bytes.resize(below(bytes.size() + 1));
    bytes.insert(bytes.end(), other.begin() + static_cast<std::ptrdiff_t>(below(other.size())),
                 other.end());
  }

  const std::vector<Bytes>& corpus_;
  std::mt19937_64 engine_;
};

}  // namespace hlm::fuzz
