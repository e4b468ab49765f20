// The identity of a contact follows from all of its key.
#include "hlm/geometry/feature.h"

#include <set>
#include <vector>

#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::geometry {
namespace {

using test::Random;

std::uint32_t bits(Random& random) { return static_cast<std::uint32_t>(random.engine()()); }

/// As many bits as a field of a large world has: mostly few, at times all.
std::uint32_t number(Random& random, int most_bits) {
  return bits(random) >> (32 - random.integer(1, most_bits));
}

Feature feature(Random& random) {
  return {static_cast<FeatureKind>(random.integer(0, 2)), number(random, 32),
          static_cast<std::uint16_t>(number(random, 16))};
}

ContactKey key(Random& random) {
  return {{SideKind::kToolLink, number(random, 32)},
          feature(random),
          {random.integer(0, 1) == 0 ? SideKind::kWorld : SideKind::kToolLink, number(random, 32)},
          feature(random),
          number(random, 32)};
}

/// The keys that differ from `from` in one bit of one number, or in one kind.
std::vector<ContactKey> neighbours_of(const ContactKey& from) {
  std::vector<ContactKey> keys;
  const auto add = [&](auto&& change) { change(keys.emplace_back(from)); };
  for (int i = 0; i < 32; ++i) {
    const std::uint32_t bit = std::uint32_t{1} << i;
    add([&](ContactKey& to) { to.a.index ^= bit; });
    add([&](ContactKey& to) { to.b.index ^= bit; });
    add([&](ContactKey& to) { to.a_feature.shape ^= bit; });
    add([&](ContactKey& to) { to.b_feature.shape ^= bit; });
    add([&](ContactKey& to) { to.face ^= bit; });
    if (i >= 16) continue;
    const auto low = static_cast<std::uint16_t>(bit);
    add([&](ContactKey& to) { to.a_feature.index ^= low; });
    add([&](ContactKey& to) { to.b_feature.index ^= low; });
  }
  for (const FeatureKind kind : {FeatureKind::kVertex, FeatureKind::kEdge, FeatureKind::kFace}) {
    if (kind != from.a_feature.kind) add([&](ContactKey& to) { to.a_feature.kind = kind; });
    if (kind != from.b_feature.kind) add([&](ContactKey& to) { to.b_feature.kind = kind; });
  }
  const bool is_link = from.b.kind == SideKind::kToolLink;
  add([&](ContactKey& to) { to.b.kind = is_link ? SideKind::kWorld : SideKind::kToolLink; });
  return keys;
}

TEST_CASE("A contact has another identity whichever bit of its key is another") {
  Random random;
  for (int i = 0; i < 500; ++i) {
    const ContactKey from = key(random);
    std::set<std::uint64_t> identities{identity_of(from)};
    const auto neighbours = neighbours_of(from);
    for (const ContactKey& to : neighbours) identities.insert(identity_of(to));
    REQUIRE(identities.size() == neighbours.size() + 1);
  }
}

TEST_CASE("300000 contacts of a skin have as many identities") {
  std::set<std::uint64_t> identities;
  ContactKey key;
  for (std::uint32_t i = 0; i < 300'000; ++i) {
    key.b_feature = {FeatureKind::kFace, 7, 0};
    key.face = (std::uint32_t{1} << 31) + i;
    identities.insert(identity_of(key));
  }
  CHECK(identities.size() == 300'000);
}

TEST_CASE("Whether a body is movable changes none of its contacts' identities") {
  Random random;
  for (int i = 0; i < 100; ++i) {
    ContactKey fixed = key(random);
    fixed.b.kind = SideKind::kWorld;
    ContactKey movable = fixed;
    movable.b.kind = SideKind::kMovableBody;
    CHECK(identity_of(fixed) == identity_of(movable));
  }
}

}  // namespace
}  // namespace hlm::geometry
