// A short text for a person that can be made in the tick: it never allocates.
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <concepts>
#include <cstddef>
#include <string>
#include <string_view>

namespace hlm {

/// A text of at most kCapacity bytes; what exceeds them is cut.
class Sentence {
 public:
  /// What a reject holds (protocol::kMaxText).
  static constexpr std::size_t kCapacity = 200;

  // Implicit, as with std::string.
  Sentence(std::string_view text) noexcept { append(text); }
  Sentence(const char* text) noexcept : Sentence(std::string_view(text)) {}

  Sentence& append(std::string_view text) noexcept {
    text = text.substr(0, kCapacity - size_);
    std::copy(text.begin(), text.end(), text_.begin() + static_cast<std::ptrdiff_t>(size_));
    size_ += text.size();
    return *this;
  }

  std::string_view view() const noexcept { return {text_.data(), size_}; }
  operator std::string_view() const noexcept { return view(); }
  operator std::string() const { return std::string(view()); }

  friend Sentence operator+(Sentence text, std::string_view more) noexcept {
    return text.append(more);
  }
  friend Sentence operator+(Sentence text, std::integral auto number) noexcept {
    std::array<char, 24> digits;
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), number).ptr;
    return text.append({digits.data(), end});
  }
  friend bool operator==(const Sentence& a, std::string_view b) noexcept { return a.view() == b; }

 private:
  std::array<char, kCapacity> text_;
  std::size_t size_ = 0;
};

}  // namespace hlm
