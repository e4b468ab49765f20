#include "hlm/tools/doctor/report.h"

#include <algorithm>
#include <ctime>

#include <nlohmann/json.hpp>
#include <spdlog/fmt/chrono.h>
#include <spdlog/fmt/fmt.h>
#include <sys/utsname.h>

#include "hlm/common/settings/table.h"

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

bool complete(const std::vector<Examination>& examinations) noexcept {
  return std::all_of(examinations.begin(), examinations.end(),
                     [](const Examination& examination) { return examination.complete; });
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
  text += problems == 0   ? "No problem was found"
          : problems == 1 ? "One problem was found"
                          : fmt::format("{} problems were found", problems);
  return text + (complete(examinations) ? ".\n" : ", but not all was checked.\n");
}

std::string as_report(const std::vector<Examination>& examinations, const std::string& device) {
  utsname system{};
  uname(&system);
  return fmt::format("haptic_doctor {}, {:%Y-%m-%d %H:%M} UTC\n{} {} {}, {}\n\n[device]\n{}\n{}",
                     HLM_VERSION, fmt::gmtime(std::time(nullptr)), system.sysname, system.release,
                     system.machine, system.version, device, as_text(examinations));
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
    all.push_back({{"question", examination.question},
                   {"complete", examination.complete},
                   {"findings", std::move(findings)}});
  }
  const nlohmann::json report{{"verdict", name_of(worst(examinations))},
                              {"complete", complete(examinations)},
                              {"examinations", std::move(all)}};
  return report.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
}

}  // namespace hlm::server
