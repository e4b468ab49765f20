#include "hlm/geometry/select_pairs.h"

#include <algorithm>
#include <limits>
#include <map>
#include <span>

namespace hlm::geometry {
namespace {

struct Pair {
  std::vector<FoundContact> best;    ///< Contacts on the pair's best axis.
  std::vector<FoundContact> others;  ///< Contacts on its other axes.
  double separation = std::numeric_limits<double>::infinity();  ///< m.
};

/// Those with a contact on a best axis, the nearest first, with what is selected of the others.
std::vector<Pair> pairs_of(std::span<const FoundContact> found,
                           const std::optional<Vector3>& planar_normal_W) {
  std::map<std::uint32_t, Pair> by_number;
  for (const FoundContact& contact : found) {
    Pair& pair = by_number[contact.pair];
    (contact.axis == 0 ? pair.best : pair.others).push_back(contact);
    if (contact.axis == 0) pair.separation = std::min(pair.separation, contact.separation);
  }
  std::vector<Pair> pairs;
  for (auto& [number, pair] : by_number) {
    if (pair.best.empty()) continue;
    ContactSelection of_pair;
    const auto selected = of_pair.select(pair.others, planar_normal_W);
    pair.others.assign(selected.begin(), selected.end());
    pairs.push_back(std::move(pair));
  }
  std::ranges::stable_sort(pairs, {}, &Pair::separation);
  return pairs;
}

/// selection: as it was at the frame before.
void leave_out_far(std::vector<Pair>& pairs, ContactSelection selection, double epsilon,
                   const std::optional<Vector3>& planar_normal_W,
                   const std::function<bool(const ContactSide&)>& stays) {
  const auto is_needed = [&](const Pair& pair) {
    return pair.separation <= epsilon || stays(pair.best.front().key.b);
  };
  std::vector<FoundContact> needed;
  std::size_t others = 0;
  for (const Pair& pair : pairs) {
    if (!is_needed(pair)) continue;
    needed.insert(needed.end(), pair.best.begin(), pair.best.end());
    others += pair.others.size();
  }
  std::size_t best = selection.select(needed, planar_normal_W).size();
  std::erase_if(pairs, [&](const Pair& pair) {
    if (is_needed(pair)) return false;
    const std::size_t of_pair = ContactSelection().select(pair.best, planar_normal_W).size();
    const bool fits = best + of_pair <= kMaxSelected &&
                      best + of_pair + others + pair.others.size() <= kMostToolContacts;
    if (!fits) return true;
    best += of_pair;
    others += pair.others.size();
    return false;
  });
}

}  // namespace

std::vector<FoundContact> select_pairs(ContactSelection& selection, std::vector<FoundContact> found,
                                       double epsilon,
                                       const std::optional<Vector3>& planar_normal_W,
                                       const std::function<bool(const ContactSide&)>& stays) {
  std::vector<Pair> pairs = pairs_of(found, planar_normal_W);
  leave_out_far(pairs, selection, epsilon, planar_normal_W, stays);
  std::vector<FoundContact> best;
  for (const Pair& pair : pairs) best.insert(best.end(), pair.best.begin(), pair.best.end());
  const auto selected = selection.select(best, planar_normal_W);
  std::vector<FoundContact> contacts(selected.begin(), selected.end());
  for (const Pair& pair : pairs) {
    const auto is_of_pair = [&](const FoundContact& contact) {
      return contact.pair == pair.best.front().pair;
    };
    if (std::ranges::none_of(selected, is_of_pair)) continue;
    if (contacts.size() + pair.others.size() > kMostToolContacts) break;
    contacts.insert(contacts.end(), pair.others.begin(), pair.others.end());
  }
  return contacts;
}

}  // namespace hlm::geometry
