// Reported contacts for tests.
#pragma once

#include <cstddef>

#include "hlm/common/contact.h"

namespace hlm::test {

/// Contacts of different identity, everything else by default.
inline ReportedContacts distinct_contacts(std::size_t count) {
  ReportedContacts contacts(count);
  for (std::size_t i = 0; i < count; ++i) {
    contacts[i].identity = i;
  }
  return contacts;
}

}  // namespace hlm::test
