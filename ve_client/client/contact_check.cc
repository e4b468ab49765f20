#include "ve_client/client/contact_check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <unordered_set>

#include "protocol/codec.h"
#include "protocol/tool_fit.h"

namespace hlm {
namespace {

using Error = std::optional<std::string>;

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
  if (!contact.p_WC.allFinite()) return "point " + numbers(contact.p_WC) + " must be finite, m";
  if (!contact.v_WC.allFinite())
    return "velocity " + numbers(contact.v_WC) + " must be finite, m/s";
  const double length = contact.n_W.norm();
  if (!(std::abs(length - 1) <= kUnitTolerance)) {
    return "normal " + numbers(contact.n_W) + " must be of length 1, not " + number(length);
  }
  if (!std::isfinite(contact.separation)) {
    return "separation " + number(contact.separation) + " must be finite, m";
  }
  if (!std::isfinite(contact.friction) || !std::isfinite(contact.load) || contact.load < 0) {
    return "friction " + number(contact.friction) + " and load " + number(contact.load) +
           " must be finite, the load not negative";
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
  return std::nullopt;
}

Error find_error(const MovableBody& body) {
  const bool finite =
      body.p_WCom.allFinite() && body.V_W.allFinite() && body.W.allFinite() && body.A_W.allFinite();
  if (!finite) return "its numbers must be finite";
  const double asymmetry = (body.W - body.W.transpose()).norm();
  if (asymmetry > 1e-6 * body.W.norm()) return "its inverse inertia must be symmetric";
  if (kWords<Roundness>.size() <= static_cast<std::size_t>(body.roundness)) {
    return "round is " + std::to_string(static_cast<int>(body.roundness)) + ", must be 0, 1 or 2";
  }
  if (body.roundness == Roundness::kAxis && !(std::abs(body.axis_W.norm() - 1) <= kUnitTolerance)) {
    return "the axis " + numbers(body.axis_W) + " of a round body must be of length 1, not " +
           number(body.axis_W.norm());
  }
  if (body.W.diagonal().minCoeff() < 0) return "the diagonal of its inverse inertia must be >= 0";
  return std::nullopt;
}

Error find_error(const ReportedContacts& contacts, const ToolModel& tool) {
  std::unordered_set<std::uint64_t> identities;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const auto of_contact = [&](const std::string& what) {
      return "contact " + std::to_string(i) + ": " + what;
    };
    if (const Error error = find_error(contacts[i], tool)) return of_contact(*error);
    if (!identities.insert(contacts[i].identity).second) {
      return of_contact("identity " + std::to_string(contacts[i].identity) +
                        " is that of an earlier contact; each must have its own");
    }
  }
  return std::nullopt;
}

Error find_error(const MovableBodies& bodies) {
  std::unordered_set<std::uint32_t> ids;
  for (const MovableBody& body : bodies) {
    const auto of_body = [&](const std::string& what) {
      return "body " + std::to_string(body.id) + ": " + what;
    };
    if (const Error error = find_error(body)) return of_body(*error);
    if (!ids.insert(body.id).second) return of_body("its id is that of an earlier body");
  }
  return std::nullopt;
}

/// What the server's own checks say, which have ranges too.
Error find_refusal(const protocol::ContactUpdate& update, const ToolDescription& tool) {
  if (const auto misfit = protocol::find_misfit(tool, update)) {
    return std::string(meaning_of(misfit->error));
  }
  const protocol::Envelope envelope{.session = 1};
  protocol::ContactUpdate read;
  for (std::uint8_t part = 0; part < protocol::part_count(update); ++part) {
    const protocol::DatagramBytes bytes = protocol::encode(envelope, update, part);
    const auto error = protocol::decode_part(protocol::view(bytes), read);
    if (!error) continue;
    const std::string item = error->in_item ? "item " + std::to_string(error->item) : "update";
    return std::string(item).append(": ").append(meaning_of(error->error));
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::string> find_error(const protocol::ContactUpdate& update,
                                      const ToolModel& tool) {
  if (const Error error = find_error(update.contacts, tool)) return error;
  if (const Error error = find_error(update.bodies)) return error;
  return find_refusal(update, tool.description());
}

}  // namespace hlm
