// How a time is distributed: a histogram with logarithmic bins that costs the same for every value.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace hlm::server {

/// Counts times up to 68 s with a resolution of 1/32 of the value or 1 ns. Recording neither
/// allocates nor waits.
class Histogram {
 public:
  /// value: s. Negative and NaN count as 0, longer ones as 68 s; max() is kept exactly.
  void record(double value) noexcept {
    const double seconds = value > 0 ? value : 0;
    ++counts_[bin(static_cast<std::uint64_t>(std::min(1e9 * seconds, kLargest)))];
    ++count_;
    max_ = std::max(max_, seconds);
  }

  std::uint64_t count() const noexcept { return count_; }
  /// Largest value recorded, s; 0 without any.
  double max() const noexcept { return max_; }

  /// The smallest bin edge, s, that at least the fraction `q` of all values do not exceed; at most
  /// max(). 0 without values. q in [0, 1].
  double quantile(double q) const noexcept {
    const auto rank =
        std::max<std::uint64_t>(1, static_cast<std::uint64_t>(std::ceil(q * double(count_))));
    std::uint64_t below = 0;
    for (std::size_t i = 0; i < kBins; ++i) {
      below += counts_[i];
      if (below >= rank) return std::min(1e-9 * upper_edge(i), max_);
    }
    return max_;
  }

 private:
  // A value of n bits keeps its leading kBits + 1 bits: its bin is one of kStep for each power of
  // two.
  static constexpr int kBits = 5;
  static constexpr std::size_t kStep = 1u << kBits;
  static constexpr int kLargestBits = 36;
  static constexpr std::size_t kBins = kStep * (kLargestBits - kBits + 1);
  static constexpr double kLargest = 0x1.0p36 - 1;  ///< ns.

  static std::size_t bin(std::uint64_t ns) noexcept {
    const int shift = std::max(0, static_cast<int>(std::bit_width(ns)) - kBits - 1);
    return static_cast<std::size_t>(shift) * kStep + static_cast<std::size_t>(ns >> shift);
  }
  /// First value after the bin, ns.
  static double upper_edge(std::size_t bin) noexcept {
    const std::size_t shift = bin < 2 * kStep ? 0 : bin / kStep - 1;
    return std::ldexp(static_cast<double>(bin - shift * kStep + 1), static_cast<int>(shift));
  }

  std::array<std::uint64_t, kBins> counts_{};
  std::uint64_t count_ = 0;
  double max_ = 0;
};

}  // namespace hlm::server
