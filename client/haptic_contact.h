// A contact of the C interface as the C++ libraries have it.
#pragma once

#include <haptic.h>

#include "hlm/common/contact.h"
#include "hlm/common/friction_limit.h"

namespace hlm {

inline ReportedContact contact_of(const haptic_contact& from) {
  ReportedContact contact;
  contact.identity = from.identity;
  contact.pair = from.pair;
  contact.axis = from.axis;
  contact.a = {static_cast<SideKind>(from.a_kind), from.a_index};
  contact.b = {static_cast<SideKind>(from.b_kind), from.b_index};
  contact.p_WC = Eigen::Map<const Vector3>(from.point);
  contact.n_W = Eigen::Map<const Vector3>(from.normal);
  contact.separation = from.separation;
  contact.v_WC = Eigen::Map<const Vector3>(from.velocity);
  contact.friction = usable_friction(from.friction);
  contact.load = from.load;
  contact.plane = from.plane == 1 ? PlaneOwner::kA : PlaneOwner::kB;
  return contact;
}

}  // namespace hlm
