// How haptic_doctor says what it found.
#pragma once

#include <string>
#include <vector>

#include "haptic_server/doctor/finding.h"

namespace hlm::server {

/// The worst of all verdicts; good without any.
Verdict worst(const std::vector<Examination>& examinations) noexcept;

/// Lines for a person.
std::string as_text(const std::vector<Examination>& examinations);

/// {"verdict": …, "examinations": [{"question": …, "findings": [{"verdict", "subject", "text",
/// "advice"}]}]}.
std::string as_json(const std::vector<Examination>& examinations);

}  // namespace hlm::server
