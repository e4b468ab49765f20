// What haptic_doctor finds: judged sentences for a person.
#pragma once

#include <string>
#include <vector>

#include "hlm/common/vocabulary.h"

namespace hlm::server {

/// The verdicts in order: the worse the larger.
enum class Verdict { kGood, kNote, kWarning, kProblem };

}  // namespace hlm::server

namespace hlm {

template <>
inline constexpr std::array<Word<server::Verdict>, 4> kWords<server::Verdict>{{
    {server::Verdict::kGood, "good", "as it should be"},
    {server::Verdict::kNote, "note", "not judged, or not to be found out from here"},
    {server::Verdict::kWarning, "warning", "it works, but not as well as it could"},
    {server::Verdict::kProblem, "problem", "with this it does not work, or not safely"},
}};

}  // namespace hlm

namespace hlm::server {

struct Finding {
  Verdict verdict = Verdict::kNote;
  std::string subject;  ///< A word or two.
  std::string text;     ///< What was found, with its figures.
  std::string advice;   ///< What to do; empty: nothing.
};

/// One question and what was found.
struct Examination {
  std::string question;
  std::vector<Finding> findings;
  bool complete = true;  ///< All of it was done.
};

}  // namespace hlm::server
