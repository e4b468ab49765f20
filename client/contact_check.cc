#include "hlm/client/contact_check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "hlm/common/friction_limit.h"
#include "hlm/common/range.h"
#include "hlm/protocol/tool_fit.h"
#include "hlm/protocol/wire.h"

namespace hlm {
namespace {

using Error = std::optional<std::string>;
using protocol::kLargestAcceleration, protocol::kLargestLength, protocol::kLargestMobility,
    protocol::kLargestSpeed, protocol::kLargestUnit;

constexpr Range kSeparation{-kLargestLength, kLargestLength, "m"};
constexpr Range kFriction{-kLargestFriction, kLargestFriction};
constexpr Range kLoad{0, protocol::kLargestForce, "N"};

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

std::string numbers(const Vector3& v) {
  char text[96];
  std::snprintf(text, sizeof text, "(%g, %g, %g)", v.x(), v.y(), v.z());
  return text;
}

/// Names the first number that is not within ±most; NaN is not.
template <class Vector>
Error find_beyond(const std::string& name, const Vector& values, double most, const char* unit) {
  for (const double value : values) {
    if (std::abs(value) <= most) continue;
    return name + " has " + number(value) + " " + unit + ", must be within ±" + number(most) + " " +
           unit;
  }
  return std::nullopt;
}

Error find_error(const ContactSide& side, char name, const ToolModel& tool) {
  const auto links = static_cast<std::uint32_t>(tool.links());
  if (side.kind > SideKind::kMovableBody) {
    return std::string("side ") + name + " must be world, tool link or movable body";
  }
  if (side.kind == SideKind::kToolLink && side.index >= links) {
    return std::string("side ") + name + ": link " + std::to_string(side.index) +
           " must be less than " + std::to_string(links) + ", the tool's number of links";
  }
  return std::nullopt;
}

Error find_error(const ReportedContact& contact, const ToolModel& tool) {
  const double length = contact.n_W.norm();
  if (!(std::abs(length - 1) <= kUnitTolerance)) {
    return "normal " + numbers(contact.n_W) + " must be of length 1, not " + number(length);
  }
  if (const Error error = find_error(contact.a, 'a', tool)) return error;
  if (const Error error = find_error(contact.b, 'b', tool)) return error;
  if (contact.b.kind == SideKind::kToolLink && contact.a.kind != SideKind::kToolLink) {
    return "the tool must be side a, to which the normal points";
  }
  if (contact.a.kind == SideKind::kWorld) return "side a must be a tool link or a movable body";
  if (contact.a.kind == SideKind::kToolLink) {
    const Vector3 origin = tool.X_WL(static_cast<int>(contact.a.index)).p;
    const double away = (contact.p_WC + contact.separation * contact.n_W - origin).norm();
    if (away > kFarthest) {
      return "its point on the tool is " + number(away) + " m from the link's origin, at most " +
             number(kFarthest) +
             " is allowed: are lengths in metres and the configuration sampled?";
    }
  }
  if (Error error = find_beyond("point", contact.p_WC, kLargestLength, "m")) return error;
  if (Error error = find_beyond("velocity", contact.v_WC, kLargestSpeed, "m/s")) return error;
  if (Error error = find_error("separation", contact.separation, kSeparation)) return error;
  if (Error error = find_error("friction", contact.friction, kFriction)) return error;
  return find_error("load", contact.load, kLoad);
}

Error find_error(const MovableBody& body) {
  if (Error error = find_beyond("centre", body.p_WCom, kLargestLength, "m")) return error;
  if (Error error = find_beyond("velocity", body.V_W, kLargestSpeed, "m/s or rad/s")) return error;
  if (Error error = find_beyond("acceleration", body.A_W, kLargestAcceleration, "m/s² or rad/s²")) {
    return error;
  }
  if (Error error = find_beyond("inverse inertia", body.W.reshaped(), kLargestMobility,
                                "1/kg or 1/(kg·m²)")) {
    return error;
  }
  if (Error error = find_beyond("axis", body.axis_W, kLargestUnit, "of a unit vector"))
    return error;
  const double asymmetry = (body.W - body.W.transpose()).norm();
  if (asymmetry > 1e-6 * body.W.norm()) return "its inverse inertia must be symmetric";
  if (kWords<Roundness>.size() <= static_cast<std::size_t>(body.roundness)) {
    return "round " + std::to_string(static_cast<int>(body.roundness)) + " must be 0, 1 or 2";
  }
  if (body.roundness == Roundness::kAxis && !(std::abs(body.axis_W.norm() - 1) <= kUnitTolerance)) {
    return "the axis " + numbers(body.axis_W) + " of a round body must be of length 1, not " +
           number(body.axis_W.norm());
  }
  if (body.W.diagonal().minCoeff() < 0) return "the diagonal of its inverse inertia must be >= 0";
  return std::nullopt;
}

/// Index of the first item whose name an earlier one has.
template <class Items, class Name>
std::optional<std::size_t> find_repeated(const Items& items, Name name) {
  StaticVector<std::uint64_t, kMaxContacts> names;
  for (const auto& item : items) names.push_back(name(item));
  auto sorted = names;
  std::ranges::sort(sorted);
  if (std::ranges::adjacent_find(sorted) == sorted.end()) return std::nullopt;
  for (auto later = names.begin();; ++later) {
    if (std::find(names.begin(), later, *later) != later) return later - names.begin();
  }
}

Error find_error(const ReportedContacts& contacts, const ToolModel& tool) {
  const auto of_contact = [&](std::size_t i, const std::string& what) {
    return "contact " + std::to_string(i) + ": " + what;
  };
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (const Error error = find_error(contacts[i], tool)) return of_contact(i, *error);
  }
  if (const auto i = find_repeated(contacts, [](const auto& each) { return each.identity; })) {
    return of_contact(*i, "identity " + std::to_string(contacts[*i].identity) +
                              " is that of an earlier contact; each must have its own");
  }
  return std::nullopt;
}

Error find_error(const MovableBodies& bodies) {
  const auto of_body = [](const MovableBody& body, const std::string& what) {
    return "body " + std::to_string(body.id) + ": " + what;
  };
  for (const MovableBody& body : bodies) {
    if (const Error error = find_error(body)) return of_body(body, *error);
  }
  if (const auto i = find_repeated(bodies, [](const auto& each) { return each.id; })) {
    return of_body(bodies[*i], "its id is that of an earlier body");
  }
  return std::nullopt;
}

/// Whether the tool's own numbers can be used.
Error find_error(const Configuration& q, const Velocity& v) {
  if (Error error = find_beyond("configuration", q, kLargestLength, "m or rad")) return error;
  return find_beyond("velocity of the tool", v, kLargestSpeed, "m/s or rad/s");
}

}  // namespace

std::optional<std::string> find_error(const protocol::ContactUpdate& update,
                                      const ToolModel& tool) {
  if (const Error error = find_error(update.contacts, tool)) return error;
  if (const Error error = find_error(update.bodies)) return error;
  if (const Error error = find_error(update.q_VE, update.v_VE)) return error;
  if (const auto misfit = protocol::find_misfit(tool.description(), update)) {
    return std::string(meaning_of(misfit->error));
  }
  return std::nullopt;
}

}  // namespace hlm
