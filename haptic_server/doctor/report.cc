#include "haptic_server/doctor/report.h"

#include <algorithm>

#include <nlohmann/json.hpp>
#include <spdlog/fmt/fmt.h>

#include "common/settings/table.h"

namespace hlm::server {
namespace {

constexpr std::size_t kIndent = 24;

/// Wrapped, and indented except for its first line.
std::string block(const std::string& text) {
  const std::string wrapped = settings::wrapped(text, kIndent);
  return wrapped.substr(std::min(kIndent, wrapped.size()));
}

std::string as_text(const Finding& finding) {
  std::string text = fmt::format("  {:<8} {:<12} {}", name_of(finding.verdict), finding.subject,
                                 block(finding.text));
  if (!finding.advice.empty()) {
    text += std::string(kIndent - 2, ' ') + "> " + block(finding.advice);
  }
  return text;
}

}  // namespace

Verdict worst(const std::vector<Examination>& examinations) noexcept {
  Verdict verdict = Verdict::kGood;
  for (const Examination& examination : examinations) {
    for (const Finding& finding : examination.findings) {
      verdict = std::max(verdict, finding.verdict);
    }
  }
  return verdict;
}

std::string as_text(const std::vector<Examination>& examinations) {
  std::string text;
  std::size_t problems = 0;
  for (const Examination& examination : examinations) {
    text += examination.question + '\n';
    for (const Finding& finding : examination.findings) {
      text += as_text(finding);
      problems += finding.verdict == Verdict::kProblem ? 1 : 0;
    }
    text += '\n';
  }
  return text + (problems == 0   ? "No problem was found.\n"
                 : problems == 1 ? "One problem was found.\n"
                                 : fmt::format("{} problems were found.\n", problems));
}

std::string as_json(const std::vector<Examination>& examinations) {
  nlohmann::json all = nlohmann::json::array();
  for (const Examination& examination : examinations) {
    nlohmann::json findings = nlohmann::json::array();
    for (const Finding& f : examination.findings) {
      findings.push_back({{"verdict", name_of(f.verdict)},
                          {"subject", f.subject},
                          {"text", f.text},
                          {"advice", f.advice}});
    }
    all.push_back({{"question", examination.question}, {"findings", std::move(findings)}});
  }
  const nlohmann::json report{{"verdict", name_of(worst(examinations))},
                              {"examinations", std::move(all)}};
  return report.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
}

}  // namespace hlm::server
