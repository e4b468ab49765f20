// Which contacts do several pairs of pieces have in common (docs/method.md 8.5)?
#pragma once

#include <cstdint>
#include <vector>

#include "hlm/geometry/feature.h"
#include "hlm/geometry/pieces.h"

namespace hlm::geometry {

/// What the following work in: with room for the contacts they allocate nothing.
struct MergeSpace {
  std::vector<FoundContact> contacts;
  std::vector<std::uint32_t> pairs;
  std::vector<ContactKey> keys;

  void reserve(std::size_t count) {
    contacts.reserve(count);
    pairs.reserve(count);
    keys.reserve(count);
  }
};

/// Keeps, of the contacts that several pairs have with the same feature in the same place, the one
/// of the smallest separation, and one over its piece rather than those next to theirs. First come
/// those on the best axes, then the others, which all stay. Where the work is spent (Work) it drops
/// what is left on the best axes; returns how many contacts that were.
std::size_t merge_same(std::vector<FoundContact>& contacts, const Pieces& pieces,
                       MergeSpace& space);

/// Leaves no contacts on other axes of a pair whose best one has none: they would act alone. One
/// with the key of a contact on a best axis, which has it from a surface of several pieces, gets
/// another.
void keep_whole_pairs(std::vector<FoundContact>& contacts, MergeSpace& space);

}  // namespace hlm::geometry
