// Does the device push as commanded, and how soon? By small pushes that a person allows.
#pragma once

#include <optional>
#include <vector>

#include "hlm/common/range.h"
#include "hlm/tools/doctor/device_bench.h"
#include "hlm/tools/doctor/finding.h"
#include "hlm/tools/doctor/outlook.h"

namespace hlm::server {

/// What a push may have at most, N: a hand that holds the handle loosely endures it, one that does
/// not hold it loses nothing in 20 mm.
inline constexpr Range kPushes{0.05, 1, "N"};

/// `most`, as far as the device is rated for it; unset: a tenth of its rating, within kPushes. N.
double push_force(const DeviceRatings& rated, std::optional<double> most);

/// Two pushes along each axis of the world along which the handle moves, once the person has typed
/// `yes`. force: N; noise: of the position at rest, m. Adds what it finds, also up to where it
/// throws BenchEnded. Motors are off afterwards. Whether it pushed along each of these axes.
bool examine_pushes(DeviceBench& bench, Person& person, const Outlook& outlook, double force,
                    double noise, std::vector<Finding>& findings);

}  // namespace hlm::server
