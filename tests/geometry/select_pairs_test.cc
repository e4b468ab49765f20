// Which pairs of shapes are reported whole?
#include "hlm/geometry/select_pairs.h"

#include <algorithm>
#include <vector>

#include "tests/support/catch.h"

namespace hlm::geometry::test {
namespace {

constexpr double kEpsilon = 0.005;  // m

struct Pair {
  std::uint16_t number;
  double separation;  // m
  int best = 4;
  int others = 4;
  ContactSide b{SideKind::kWorld, 0};
};

/// Contacts 10 mm apart, so that none stands for another.
void add(std::vector<FoundContact>& found, const Pair& pair) {
  for (int i = 0; i < pair.best + pair.others; ++i) {
    FoundContact& contact = found.emplace_back();
    contact.key.a_feature = {FeatureKind::kVertex, 0, static_cast<std::uint16_t>(i)};
    contact.key.b = pair.b;
    contact.key.b_feature = {FeatureKind::kFace, pair.number, 0};
    contact.pair = pair.number;
    contact.axis = i < pair.best ? 0 : 1;
    contact.separation = contact.axis == 0 ? pair.separation : -0.01;
    contact.n_W = contact.axis == 0 ? Vector3::UnitZ() : Vector3::UnitX();
    contact.p_WC = Vector3(0.01 * i, 0.01 * pair.number, 0);
  }
}

struct Count {
  std::ptrdiff_t best;
  std::ptrdiff_t others;

  bool operator==(const Count&) const = default;
};

Count count(const std::vector<FoundContact>& contacts, std::uint16_t pair) {
  const auto of = [&](bool best) {
    return std::ranges::count_if(contacts, [&](const FoundContact& contact) {
      return contact.pair == pair && (contact.axis == 0) == best;
    });
  };
  return {of(true), of(false)};
}

std::vector<FoundContact> select(const std::vector<Pair>& pairs,
                                 SideKind stays = SideKind::kToolLink) {
  std::vector<FoundContact> found;
  for (const Pair& pair : pairs) add(found, pair);
  ContactSelection selection;
  return select_pairs(selection, found, kEpsilon, std::nullopt,
                      [&](const ContactSide& side) { return side.kind == stays; });
}

std::vector<Pair> row(std::uint16_t count, double separation) {
  std::vector<Pair> pairs;
  for (std::uint16_t i = 0; i < count; ++i) pairs.push_back({i, separation + 1e-4 * i});
  return pairs;
}

}  // namespace

TEST_CASE("All pairs are reported whole if they fit") {
  const auto contacts = select(row(16, 0.02));
  CHECK(contacts.size() == kMostToolContacts);
}

TEST_CASE("Of pairs beyond epsilon those that do not fit are left out whole, the farthest first") {
  const auto contacts = select(row(20, 0.02));
  for (std::uint16_t pair = 0; pair < 20; ++pair) {
    CAPTURE(pair);
    CHECK(count(contacts, pair) == (pair < 16 ? Count{4, 4} : Count{0, 0}));
  }
}

TEST_CASE("A pair within epsilon is reported, however many others there are") {
  std::vector<Pair> pairs = row(20, 0.02);
  pairs.push_back({20, 0.004, 32, 0});
  const auto contacts = select(pairs);
  CHECK(count(contacts, 20) == Count{32, 0});
  CHECK(count(contacts, 0) == Count{4, 4});
  CHECK(count(contacts, 7) == Count{4, 4});
  CHECK(count(contacts, 8) == Count{0, 0});
}

TEST_CASE("Contacts that stand for one another take one place of those for far pairs") {
  std::vector<FoundContact> found;
  for (std::uint16_t i = 0; i < 65; ++i) add(found, {i, 0.004, 1, 0});
  for (FoundContact& contact : found) contact.p_WC = Vector3(1e-6 * contact.pair, 0, 0);
  add(found, {65, 0.02});
  for (FoundContact& contact : found) contact.key.b_feature.shape = 0;
  ContactSelection selection;
  const auto contacts = select_pairs(selection, found, kEpsilon, std::nullopt,
                                     [](const ContactSide&) { return false; });
  CHECK(count(contacts, 65) == Count{4, 4});
}

TEST_CASE("A pair with a body that is reported stays, however far") {
  std::vector<Pair> pairs = row(20, 0.02);
  pairs.push_back({20, 0.06, 4, 4, {SideKind::kMovableBody, 3}});
  CHECK(count(select(pairs), 20) == Count{0, 0});
  CHECK(count(select(pairs, SideKind::kMovableBody), 20) == Count{4, 4});
}

TEST_CASE("Contacts on other axes of a pair without a best one are left out") {
  const auto contacts = select({{0, 0.01}, {1, 0.01, 0, 4}});
  CHECK(count(contacts, 0) == Count{4, 4});
  CHECK(count(contacts, 1) == Count{0, 0});
}

}  // namespace hlm::geometry::test
