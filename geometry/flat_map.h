// A map with room for a fixed number of entries.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace hlm::geometry {

/// Sorted by key. Allocates in reserve() alone.
template <class Key, class Value>
class FlatMap {
 public:
  void reserve(std::size_t count) { entries_.reserve(count); }
  void clear() noexcept { entries_.clear(); }
  void swap(FlatMap& other) noexcept { entries_.swap(other.entries_); }
  /// Takes over the entries; the room for them must be there.
  void copy(const FlatMap& other) noexcept {
    entries_.assign(other.entries_.begin(), other.entries_.end());
  }

  bool has_room() const noexcept { return entries_.size() < entries_.capacity(); }
  /// Null if there is none.
  const Value* find(const Key& key) const noexcept {
    const auto at = std::ranges::lower_bound(entries_, key, {}, &Entry::first);
    return at != entries_.end() && at->first == key ? &at->second : nullptr;
  }
  /// Quick if keys come in their order.
  void put(const Key& key, const Value& value) noexcept {
    const bool is_last = entries_.empty() || entries_.back().first < key;
    const auto at =
        is_last ? entries_.end() : std::ranges::lower_bound(entries_, key, {}, &Entry::first);
    if (at != entries_.end() && at->first == key) {
      at->second = value;
    } else {
      entries_.insert(at, {key, value});
    }
  }

 private:
  using Entry = std::pair<Key, Value>;
  std::vector<Entry> entries_;
};

}  // namespace hlm::geometry
