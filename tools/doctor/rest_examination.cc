#include "hlm/tools/doctor/rest_examination.h"

#include <cmath>

#include <spdlog/fmt/fmt.h>

namespace hlm::server {
namespace {

constexpr double kRestTime = 2;  // s.
/// A mean that moved by more from the first half to the second is no rest, m.
constexpr double kDrift = 0.5e-3;
/// The usual coupling of 1.5 kN/m makes 0.03 N of 20 µm, a fine tremble, and 0.3 N of 0.2 mm,
/// which a hand feels as a buzz.
constexpr double kSomeNoise = 20e-6;
constexpr double kMuchNoise = 0.2e-3;
/// The usual damping of 20 N·s/m makes 0.2 N of 0.01 m/s.
constexpr double kMuchSpeedNoise = 0.01;
/// Below this the stiffness that a device supports falls, Hz; a device with less than the server's
/// own least rate is not usable.
constexpr double kLowRate = 500;
constexpr double kTooLowRate = 100;
/// A stall as long as this is a fault in a session, s.
constexpr double kLongestGap = 0.015;
constexpr std::uint64_t kFewestGaps = 20;
/// Share of all periods.
constexpr double kManyMissed = 0.01;

Vector3 mean_of(const std::vector<HandleSample>& samples, Vector3 HandleSample::*member,
                std::size_t begin, std::size_t end) {
  Vector3 sum = Vector3::Zero();
  for (std::size_t i = begin; i < end; ++i) sum += samples[i].*member;
  return sum / static_cast<double>(end - begin);
}

/// Root mean square of the distance from the mean.
double scatter_of(const std::vector<HandleSample>& samples, Vector3 HandleSample::*member) {
  const Vector3 mean = mean_of(samples, member, 0, samples.size());
  double sum = 0;
  for (const HandleSample& sample : samples) sum += (sample.*member - mean).squaredNorm();
  return std::sqrt(sum / static_cast<double>(samples.size()));
}

Finding position_noise(double noise) {
  const std::string text = fmt::format("position at rest {:.3g} mm rms", 1e3 * noise);
  if (noise > kMuchNoise) {
    return {Verdict::kProblem, "noise", text + ": stiff contact would buzz",
            "look for a bad cable or encoder, or a device that is not calibrated"};
  }
  if (noise > kSomeNoise) {
    return {Verdict::kWarning, "noise", text, "lower --coupling-stiffness if contact trembles"};
  }
  return {Verdict::kGood, "noise",
          text + (noise == 0 ? ": its steps are larger than its noise" : ""), ""};
}

Finding speed_noise(double speed) {
  const std::string text = fmt::format("speed at rest {:.3g} mm/s rms", 1e3 * speed);
  if (speed <= kMuchSpeedNoise) return {Verdict::kGood, "noise", text, ""};
  return {Verdict::kWarning, "noise", text,
          "lower --coupling-damping, or the device's velocity cut-off if it has one"};
}

Finding rate_of_states(const DeviceBench& bench) {
  const Histogram& gaps = bench.gaps();
  if (gaps.count() < kFewestGaps) {
    return {Verdict::kNote, "rate",
            "not known: the handle moved too little, and one that rests shows no new states", ""};
  }
  const double median = gaps.quantile(0.5);
  std::string text = fmt::format("{:.0f} new states/s while it moved, worst gap {:.1f} ms",
                                 1 / median, 1e3 * gaps.max());
  const double least = std::min(kLowRate, 0.6 * bench.rate());
  if (1 / median < kTooLowRate) {
    return {Verdict::kProblem, "rate", text, "the device or its connection is too slow"};
  }
  if (1 / median < least) {
    return {Verdict::kWarning, "rate",
            text + fmt::format(", asked {:.0f} times a second", bench.rate()),
            "look at the rate in the vendor's settings, and at the cable; the stiffness that it "
            "bears is lower"};
  }
  if (gaps.max() > kLongestGap) {
    return {
        Verdict::kWarning, "rate", text,
        "a stall so long ends a session: give the server real-time rights, and see haptic_doctor "
        "--check machine"};
  }
  return {Verdict::kGood, "rate", std::move(text), ""};
}

/// Force off is the person's to mend; a few late ticks are the machine's.
Finding health(const DeviceBench& bench) {
  const double share =
      static_cast<double>(bench.ticks_not_good()) / static_cast<double>(bench.ticks());
  const bool matters = bench.health() == DeviceHealth::kForceOff || share > kManyMissed;
  const std::string why = bench.cause_of_health();
  return {matters ? Verdict::kWarning : Verdict::kNote, "state",
          fmt::format("in {:.1f} % of the ticks not good: {}{}{}", 1e2 * share,
                      meaning_of(bench.health()), why.empty() ? "" : ": ", why),
          ""};
}

std::string numbers_of(std::uint32_t buttons) {
  std::string text;
  for (int i = 0; i < 32; ++i) {
    if ((buttons >> i & 1) != 0) text += (text.empty() ? "" : ", ") + std::to_string(i + 1);
  }
  return text;
}

Finding buttons(const DeviceBench& bench) {
  const std::string pressed = numbers_of(bench.buttons_seen());
  return {Verdict::kNote, "buttons",
          fmt::format("up to {}; pressed meanwhile: {}", bench.device().ratings().buttons,
                      pressed.empty() ? "none" : pressed),
          ""};
}

}  // namespace

RestFigures examine_rest(DeviceBench& bench, Person& person) {
  person.say("Let the handle rest for two seconds. Nothing pushes.");
  bench.watch(kRestTime);
  const std::vector<HandleSample>& samples = bench.samples();
  const std::size_t half = samples.size() / 2;
  const double drift = (mean_of(samples, &HandleSample::p, half, samples.size()) -
                        mean_of(samples, &HandleSample::p, 0, half))
                           .norm();
  RestFigures figures{.noise = scatter_of(samples, &HandleSample::p), .findings = {}};
  if (drift > kDrift) {
    figures.noise = 0;
    figures.findings.push_back(
        {Verdict::kWarning, "noise",
         fmt::format("not known: the handle moved by {:.2g} mm meanwhile", 1e3 * drift),
         "let it rest and try again"});
    return figures;
  }
  figures.findings.push_back(position_noise(figures.noise));
  figures.findings.push_back(speed_noise(scatter_of(samples, &HandleSample::v)));
  figures.findings.push_back(
      {Verdict::kNote, "noise",
       fmt::format("orientation at rest {:.2g} rad rms", scatter_of(samples, &HandleSample::turn)),
       ""});
  return figures;
}

std::vector<Finding> examine_exchange(const DeviceBench& bench) {
  std::vector<Finding> findings{rate_of_states(bench)};
  const double missed = static_cast<double>(bench.missed());
  const double share = missed / (missed + static_cast<double>(bench.ticks()));
  if (share > kManyMissed) {
    findings.push_back({Verdict::kWarning, "loop",
                        fmt::format("{:.1f} % of its periods were missed", 1e2 * share),
                        "see haptic_doctor --check machine; figures above are less sure"});
  }
  if (bench.health() != DeviceHealth::kGood) findings.push_back(health(bench));
  if (bench.device().ratings().buttons > 0) findings.push_back(buttons(bench));
  const auto& [closed, open] = bench.gripper_seen();
  if (closed <= open) {
    findings.push_back({Verdict::kNote, "gripper",
                        fmt::format("{:.2f} to {:.2f} open (0 is closed)", closed, open), ""});
  }
  return findings;
}

}  // namespace hlm::server
