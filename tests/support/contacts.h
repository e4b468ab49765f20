// Reported contacts for tests.
#pragma once

#include <cstddef>
#include <cstdint>

#include "common/contact.h"

namespace hlm::test {

/// Contacts of different identity, everything else by default.
inline ReportedContacts distinct_contacts(std::size_t count) {
  ReportedContacts contacts(count);
  for (std::size_t i = 0; i < count; ++i) {
    contacts[i].key.tool_feature.index = static_cast<std::uint16_t>(i);
  }
  return contacts;
}

}  // namespace hlm::test
