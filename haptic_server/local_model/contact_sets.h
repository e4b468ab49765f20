// The local contacts, and room for those of the next update.
#pragma once

#include <array>
#include <cstddef>

#include "hlm/haptic_server/local_model/local_contact.h"

namespace hlm::server {

class ContactSets {
 public:
  /// Of the tool, sorted by identity.
  const LocalContacts& contacts() const noexcept { return contacts_[present_]; }
  LocalContacts& contacts() noexcept { return contacts_[present_]; }
  /// Of the bodies without the tool.
  const LocalContacts& supports() const noexcept { return supports_[present_]; }
  LocalContacts& supports() noexcept { return supports_[present_]; }

  /// What is present becomes what was, where it stays until the next time; what was before makes
  /// room.
  void renew() noexcept { present_ = 1 - present_; }

 private:
  std::array<LocalContacts, 2> contacts_;
  std::array<LocalContacts, 2> supports_;
  std::size_t present_ = 0;
};

}  // namespace hlm::server
