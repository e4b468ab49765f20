// Which contacts are reported?
#include "hlm/geometry/select.h"

#include <algorithm>
#include <vector>

#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::geometry::test {
namespace {

using hlm::test::Random;

const Vector3 kPlane = Vector3::UnitZ();

FoundContact contact(std::uint16_t vertex, const Vector3& p_W, const Vector3& n_W,
                     double separation) {
  FoundContact result;
  result.key.a_feature = {FeatureKind::kVertex, 0, vertex};
  result.key.b_feature = {FeatureKind::kFace, 0, 0};
  result.p_WC = p_W;
  result.n_W = n_W;
  result.separation = separation;
  return result;
}

std::vector<FoundContact> random_contacts(int count, Random& random) {
  std::vector<FoundContact> contacts;
  for (int i = 0; i < count; ++i) {
    contacts.push_back(contact(static_cast<std::uint16_t>(i), random.vector(1), random.direction(),
                               random.uniform(-0.02, 0.005)));
  }
  std::shuffle(contacts.begin(), contacts.end(), random.engine());
  return contacts;
}

std::vector<FoundContact> select_contacts(std::span<const FoundContact> candidates,
                                          const std::optional<Vector3>& planar_normal_W) {
  ContactSelection selection;
  const auto selected = selection.select(candidates, planar_normal_W);
  return {selected.begin(), selected.end()};
}

bool is_sorted_by_key(const std::vector<FoundContact>& contacts) {
  return std::is_sorted(contacts.begin(), contacts.end(),
                        [](const auto& a, const auto& b) { return a.key < b.key; });
}

}  // namespace

TEST_CASE("A spatial tool's contacts are all reported, sorted by key") {
  Random random;
  const auto candidates = random_contacts(40, random);
  const std::vector<FoundContact> reported = select_contacts(candidates, std::nullopt);
  CHECK(reported.size() == 40);
  CHECK(is_sorted_by_key(reported));
}

TEST_CASE(
    "Of too many contacts of equal depth those farthest apart stay: no side of a face is cut") {
  // A plate on 5x5 boxes: four contacts on each, all of one separation.
  std::vector<FoundContact> candidates;
  for (std::uint16_t i = 0; i < 100; ++i) {
    const double x = 0.02 * (i / 10);
    const double y = 0.02 * (i % 10);
    candidates.push_back(contact(i, {x, y, 0}, Vector3::UnitZ(), 1e-6 * i));
  }
  const std::vector<FoundContact> kept = select_contacts(candidates, std::nullopt);
  REQUIRE(kept.size() == kMaxSelected);
  Vector3 centre = Vector3::Zero();
  for (const FoundContact& c : kept) centre += c.p_WC / kMaxSelected;
  CHECK((centre - Vector3(0.09, 0.09, 0)).norm() < 0.02);  // m; the first 64 by key: 0.027
  for (const double x : {0.0, 0.18}) {
    for (const double y : {0.0, 0.18}) {
      CHECK(std::ranges::any_of(
          kept, [&](const auto& c) { return (c.p_WC - Vector3(x, y, 0)).norm() < 1e-12; }));
    }
  }
}

TEST_CASE("Of too many contacts those of the smallest separations are reported, in any order") {
  Random random;
  auto candidates = random_contacts(200, random);
  const std::vector<FoundContact> reported = select_contacts(candidates, std::nullopt);
  REQUIRE(reported.size() == kMaxSelected);
  CHECK(is_sorted_by_key(reported));
  double largest = -1;
  for (const auto& c : reported) largest = std::max(largest, c.separation);
  // A deeper one is left out only where another with its normal is deeper still.
  const double similar = 1e-3;  // m
  for (const auto& left : candidates) {
    if (left.separation >= largest - 2 * similar) continue;
    CHECK(std::ranges::any_of(reported, [&](const auto& c) {
      return c.key == left.key ||
             (c.separation < left.separation && (c.n_W - left.n_W).norm() < 0.1);
    }));
  }

  std::shuffle(candidates.begin(), candidates.end(), random.engine());
  const std::vector<FoundContact> again = select_contacts(candidates, std::nullopt);
  REQUIRE(again.size() == reported.size());
  for (std::size_t i = 0; i < again.size(); ++i) CHECK(again[i].key == reported[i].key);
}

/// A plate on count × count points, `pitch` apart (m), at z = 0.
std::vector<FoundContact> plate(int count, double pitch) {
  std::vector<FoundContact> contacts;
  for (int i = 0; i < count * count; ++i) {
    contacts.push_back(contact(static_cast<std::uint16_t>(i),
                               {pitch * (i / count), pitch * (i % count), 0}, Vector3::UnitZ(), 0));
  }
  return contacts;
}

TEST_CASE("The outermost contacts of a face stay, however many deeper ones there are") {
  std::vector<FoundContact> candidates = plate(10, 0.004);
  std::vector<FoundContact> corners;
  for (std::uint16_t i = 0; i < 4; ++i) {
    corners.push_back(contact(static_cast<std::uint16_t>(1000 + i),
                              {i % 2 == 0 ? -0.1 : 0.1, i < 2 ? -0.1 : 0.1, 0}, Vector3::UnitZ(),
                              0.004));
  }
  candidates.insert(candidates.end(), corners.begin(), corners.end());
  const std::vector<FoundContact> kept = select_contacts(candidates, std::nullopt);
  REQUIRE(kept.size() == kMaxSelected);
  for (const FoundContact& corner : corners) {
    CHECK(std::ranges::any_of(kept, [&](const auto& c) { return c.key == corner.key; }));
  }
}

TEST_CASE("Contacts of one face within a millimetre are one: that of the smallest separation") {
  std::vector<FoundContact> candidates = plate(4, 0.05);
  FoundContact deeper = candidates[5];
  deeper.key.a_feature.index = 100;
  deeper.p_WC.x() += 0.0005;
  deeper.separation = -1e-4;
  FoundContact other_normal = candidates[6];
  other_normal.key.a_feature.index = 101;
  other_normal.n_W = Vector3::UnitX();
  candidates.push_back(deeper);
  candidates.push_back(other_normal);
  const std::vector<FoundContact> kept = select_contacts(candidates, std::nullopt);
  CHECK(kept.size() == 17);
  CHECK(std::ranges::count_if(kept, [](const auto& c) { return c.key.a_feature.index == 5; }) == 0);
}

TEST_CASE("A tremor of 5 µm changes no identity among too many contacts or in a cluster",
          "[optimised]") {
  for (const double pitch : {0.02, 0.001}) {
    ContactSelection selection;
    Random random;
    std::vector<ContactKey> first;
    for (int frame = 0; frame < 100; ++frame) {
      std::vector<FoundContact> candidates = plate(16, pitch);
      for (FoundContact& c : candidates) {
        c.separation = random.uniform(-5e-6, 5e-6);
        c.p_WC += random.vector(5e-6);
      }
      std::vector<ContactKey> keys;
      for (const FoundContact& c : selection.select(candidates, std::nullopt)) {
        keys.push_back(c.key);
      }
      if (frame == 0) first = keys;
      const bool same = keys == first;
      CHECK(same);
    }
  }
}

TEST_CASE("Contacts of a planar tool one above the other are one constraint, of the smallest key") {
  const std::vector<FoundContact> candidates = {
      contact(5, {0.1, 0.2, 0.02}, Vector3::UnitX(), -0.001),
      contact(1, {0.1, 0.2, -0.02}, Vector3::UnitX(), -0.001),
      contact(2, {0.1, 0.3, -0.02}, Vector3::UnitX(), -0.001)};
  const std::vector<FoundContact> reported = select_contacts(candidates, kPlane);
  REQUIRE(reported.size() == 2);
  CHECK(reported[0].key.a_feature.index == 1);
  CHECK(reported[1].key.a_feature.index == 2);
  CHECK(select_contacts(candidates, std::nullopt).size() == 3);
}

TEST_CASE("Contacts of a planar tool that differ in the plane, or by link or body, all stay") {
  const FoundContact first = contact(1, {0.1, 0.2, 0}, Vector3::UnitX(), -0.001);
  FoundContact other_normal = contact(2, {0.1, 0.2, 0.02}, Vector3::UnitY(), -0.001);
  FoundContact other_separation = contact(3, {0.1, 0.2, 0.02}, Vector3::UnitX(), 0.001);
  FoundContact other_body = contact(4, {0.1, 0.2, 0.02}, Vector3::UnitX(), -0.001);
  other_body.key.b.index = 7;
  FoundContact other_link = contact(5, {0.1, 0.2, 0.02}, Vector3::UnitX(), -0.001);
  other_link.key.a.index = 1;
  const std::vector<FoundContact> candidates = {first, other_normal, other_separation, other_body,
                                                other_link};
  CHECK(select_contacts(candidates, kPlane).size() == 5);
}

TEST_CASE(
    "A contact whose normal leaves a planar tool's plane constrains nothing and is left out") {
  const Vector3 steep = Vector3(0.2, 0, 1).normalized();
  const std::vector<FoundContact> candidates = {contact(1, {0, 0, 0}, kPlane, -0.001),
                                                contact(2, {0, 0, 0}, -kPlane, -0.001),
                                                contact(3, {0, 0, 0}, steep, -0.001)};
  const std::vector<FoundContact> reported = select_contacts(candidates, kPlane);
  REQUIRE(reported.size() == 1);
  CHECK(reported[0].key.a_feature.index == 3);
  CHECK(select_contacts(candidates, std::nullopt).size() == 3);
}

TEST_CASE("No candidates make no contacts") {
  CHECK(select_contacts({}, std::nullopt).empty());
  CHECK(select_contacts({}, kPlane).empty());
}

}  // namespace hlm::geometry::test
