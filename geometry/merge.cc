#include "hlm/geometry/merge.h"

#include <algorithm>
#include <cstdint>

#include "hlm/geometry/manifold.h"
#include "hlm/geometry/work.h"

namespace hlm::geometry {
namespace {

/// Two contacts with normals within this angle, rad, in one place are the same.
constexpr double kSamePlane = 0.02;
/// Separations that differ by less, m, are equal: the first pair keeps the contact.
constexpr double kRounding = 1e-9;
/// Work of two contacts that are compared.
constexpr std::uint64_t kCompared = 4;

bool is_beside(const FoundContact& contact) { return (contact.key.face & kBeside) != 0; }

/// Whether contacts on the best axes of their pairs are the same.
bool are_same(const FoundContact& x, const FoundContact& y, const Pieces& pieces) {
  if (x.key == y.key) return true;
  if (x.key.a != y.key.a || x.key.b.kind != y.key.b.kind) return false;
  if (x.key.b != y.key.b &&
      (x.key.b.kind == SideKind::kToolLink || !pieces.is_fixed(static_cast<int>(x.key.b.index)) ||
       !pieces.is_fixed(static_cast<int>(y.key.b.index)))) {
    return false;
  }
  const bool one_feature = x.key.a_feature == y.key.a_feature ||
                           (x.key.b == y.key.b && x.key.b_feature == y.key.b_feature);
  return one_feature && (x.p_WC - y.p_WC).norm() <= kEdgeGap &&
         (x.n_W - y.n_W).norm() <= kSamePlane;
}

}  // namespace

std::size_t merge_same(std::vector<FoundContact>& contacts, const Pieces& pieces,
                       MergeSpace& space) {
  std::vector<FoundContact>& kept = space.contacts;
  kept.clear();
  std::size_t cut = 0;
  const auto has_time = [&] {
    Work::add(kCompared * (1 + kept.size()));
    if (Work::is_spent()) ++cut;
    return !Work::is_spent();
  };
  for (const FoundContact& contact : contacts) {
    if (contact.axis > 0 || is_beside(contact) || !has_time()) continue;
    const auto known = std::ranges::find_if(
        kept, [&](const FoundContact& other) { return are_same(other, contact, pieces); });
    if (known == kept.end()) {
      kept.push_back(contact);
    } else if (contact.separation < known->separation - kRounding) {
      *known = contact;
    }
  }
  const std::size_t over = kept.size();
  for (const FoundContact& contact : contacts) {
    if (contact.axis > 0 || !is_beside(contact) || !has_time()) continue;
    const auto end = kept.begin() + static_cast<std::ptrdiff_t>(over);
    if (std::none_of(kept.begin(), end,
                     [&](const FoundContact& other) { return are_same(other, contact, pieces); })) {
      kept.push_back(contact);
    }
  }
  for (const FoundContact& contact : contacts) {
    if (contact.axis > 0) kept.push_back(contact);
  }
  contacts.swap(kept);
  return cut;
}

void keep_whole_pairs(std::vector<FoundContact>& contacts, MergeSpace& space) {
  std::vector<std::uint32_t>& pairs = space.pairs;
  std::vector<ContactKey>& keys = space.keys;
  pairs.clear();
  keys.clear();
  for (const FoundContact& contact : contacts) {
    if (contact.axis > 0) continue;
    pairs.push_back(contact.pair);
    keys.push_back(contact.key);
  }
  std::ranges::sort(pairs);
  std::ranges::sort(keys);
  std::erase_if(contacts, [&](const FoundContact& contact) {
    return contact.axis > 0 && !std::ranges::binary_search(pairs, contact.pair);
  });
  for (FoundContact& contact : contacts) {
    if (contact.axis > 0 && std::ranges::binary_search(keys, contact.key)) {
      contact.key.face = kTellsApart + contact.axis;
    }
  }
}

}  // namespace hlm::geometry
