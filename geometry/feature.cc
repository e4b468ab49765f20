#include "hlm/geometry/feature.h"

#include <algorithm>

namespace hlm::geometry {
namespace {

/// SplitMix64's finaliser (Steele, Lea, Flood 2014).
std::uint64_t mixed(std::uint64_t x) noexcept {
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
  return x ^ (x >> 31);
}

std::uint64_t hash(std::initializer_list<std::uint64_t> words) noexcept {
  std::uint64_t value = 0x9E3779B97F4A7C15u;
  for (const std::uint64_t word : words) value = mixed(value + word) + 0x9E3779B97F4A7C15u;
  return mixed(value);
}

/// Each field has bits of its own: 16 of the index, 32 of the shape, then the kind.
std::uint64_t packed(const Feature& feature) noexcept {
  return std::uint64_t{static_cast<std::uint8_t>(feature.kind)} << 48 |
         std::uint64_t{feature.shape} << 16 | feature.index;
}

/// Tells a link of the tool from a body of the same index. `usual`: the kind that the side mostly
/// is.
std::uint64_t number_of(const ContactSide& side, SideKind usual) noexcept {
  constexpr std::uint64_t kOther = std::uint64_t{1} << 32;
  const bool is_link = side.kind == SideKind::kToolLink;
  return side.index + (is_link == (usual == SideKind::kToolLink) ? 0 : kOther);
}

}  // namespace

std::uint64_t identity_of(const ContactKey& key) noexcept {
  return hash({number_of(key.a, SideKind::kToolLink), packed(key.a_feature),
               number_of(key.b, SideKind::kWorld), packed(key.b_feature), key.face});
}

std::uint32_t pair_of(const ContactKey& key) noexcept {
  return static_cast<std::uint32_t>(
      hash({number_of(key.a, SideKind::kToolLink), key.a_feature.shape,
            number_of(key.b, SideKind::kWorld), key.b_feature.shape}));
}

ReportedContacts reports_of(std::span<const FoundContact> contacts) noexcept {
  ReportedContacts reports;
  for (const FoundContact& contact : contacts) {
    ReportedContact& report = reports.emplace_back();
    report.identity = identity_of(contact.key);
    report.pair = contact.pair;
    report.axis = contact.axis;
    report.plane = contact.plane;
    report.a = contact.key.a;
    report.b = contact.key.b;
    report.p_WC = contact.p_WC;
    report.n_W = contact.n_W;
    report.separation = contact.separation;
    report.v_WC = contact.v_WC;
    report.friction = contact.friction;
    report.load = contact.load;
  }
  return reports;
}

}  // namespace hlm::geometry
