// How haptic_doctor says what it found.
#pragma once

#include <string>
#include <vector>

#include "hlm/tools/doctor/finding.h"

namespace hlm::server {

/// The worst of all verdicts; good without any.
Verdict worst(const std::vector<Examination>& examinations) noexcept;

/// Whether all of each was done.
bool complete(const std::vector<Examination>& examinations) noexcept;

/// Lines for a person.
std::string as_text(const std::vector<Examination>& examinations);

/// The lines for a person, headed by what one needs to know who was not there: version, time, the
/// machine's kernel, and the device's keys (`device`, as lines of a configuration file).
std::string as_report(const std::vector<Examination>& examinations, const std::string& device);

/// {"verdict": …, "complete": …, "examinations": [{"question": …, "complete": …, "findings":
/// [{"verdict", "subject", "text", "advice"}]}]}.
std::string as_json(const std::vector<Examination>& examinations);

}  // namespace hlm::server
