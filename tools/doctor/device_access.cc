#include "hlm/tools/doctor/device_access.h"

#include "packaged_rules.h"

namespace hlm::server {

std::string udev_rules() {
  // The other devices need no rule: a serial port belongs to the group dialout, and what else
  // vendors need comes with their own software.
  return std::string(
             "# Save as /etc/udev/rules.d/60-haptic_server.rules, then: sudo udevadm control "
             "--reload && sudo udevadm trigger\n"
             "# sudo groupadd --system --force haptic && sudo usermod -aG haptic,dialout $USER, "
             "then log in again.\n") +
         kPackagedRules;
}

}  // namespace hlm::server
