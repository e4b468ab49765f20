// Whether bodies move as their reports say (docs/method.md 20).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "hlm/common/contact.h"
#include "hlm/common/spatial.h"
#include "hlm/common/static_vector.h"
#include "hlm/common/vocabulary.h"

namespace hlm::server {

/// What a report says of a body, and what was expected of it. World axes, m and s.
struct BodyEvidence {
  std::uint32_t id = 0;
  double time = 0;                       ///< Since the report before.
  Vector3 moved_W = Vector3::Zero();     ///< Since then, of the centre of mass.
  Vector3 V_W = Vector3::Zero();         ///< Mean of the velocity at both reports,
  Vector3 change_W = Vector3::Zero();    ///< and how much it changed.
  Vector3 error_W = Vector3::Zero();     ///< Of the velocity: what it is beyond what was expected.
  Vector3 given_W = Vector3::Zero();     ///< Velocity that the tool's impulses were to give it.
  Vector3 A_W = Vector3::Zero();         ///< Acceleration that it was to have without contacts.
  Vector3 A_change_W = Vector3::Zero();  ///< What it changed by, that of a spring.
  Vector3 gravity_W = Vector3::Zero();   ///< As far as its joints leave it.
  bool jointed = false;  ///< Limits, friction and motors of joints may hold it, as nobody says.
};

/// Compares each report of a body with what the local model expected from the one before. A report
/// that differs votes for what an adapter does wrongly, if that explains the difference: a blow
/// or a fall that the local model does not know makes one vote at most. Votes fade in some seconds.
class BodyAudit {
 public:
  /// An update comes so long after the one before, s: votes fade, and who was away for long is
  /// forgotten.
  void begin(double time) noexcept;
  void add(const BodyEvidence& evidence) noexcept;

  struct Finding {
    BodyDoubt doubt = BodyDoubt::kNone;
    std::uint32_t body = 0;
  };
  /// Of all bodies the one with most votes.
  Finding finding() const noexcept;
  BodyDoubt doubt(std::uint32_t body) const noexcept;

 private:
  static constexpr std::size_t kDoubts = kWords<BodyDoubt>.size();

  struct Record {
    std::uint32_t id = 0;
    double away = 0;  ///< Since it was reported, s.
    std::array<double, kDoubts> votes{};
    double kept_way = 0;  ///< Votes that its velocity is right.
    /// Since the latest vote on that.
    double time = 0;                       ///< s.
    Vector3 moved_W = Vector3::Zero();     ///< m.
    Vector3 expected_W = Vector3::Zero();  ///< m, by its velocity;
    double unknown = 0;                    ///< what blows may have made of it, m.
  };

  static void judge_way(const BodyEvidence& evidence, Record& record) noexcept;
  /// None of what tells nothing.
  static std::optional<BodyDoubt> vote(const BodyEvidence& evidence) noexcept;
  static BodyDoubt judge(const Record& record) noexcept;
  Record& of(std::uint32_t body) noexcept;

  StaticVector<Record, kMaxBodies> records_;
};

}  // namespace hlm::server
