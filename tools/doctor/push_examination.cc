#include "hlm/tools/doctor/push_examination.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "hlm/tools/doctor/push_fit.h"

namespace hlm::server {
namespace {

constexpr double kShareOfRating = 0.1;
constexpr double kPushTime = 0.5;   // s, at most.
constexpr double kQuietTime = 0.3;  // s, without force before the first push.
constexpr double kPatience = 4;     // s, until the handle rests.
/// Speed below which a handle is at rest, m/s: nobody's handle, and one in a hand, which trembles.
constexpr double kRestSpeed = 0.01;
constexpr double kRestSpeedHeld = 0.05;
/// A way that is seen, m: of a handle that nobody holds, and of one in a hand, which trembles.
constexpr double kLeastWay = 0.2e-3;
constexpr double kLeastWayHeld = 1e-3;
constexpr double kTimesNoise = 6;
/// Cosine of the angle between push and way up to which the handle went where it was pushed. The
/// mass of a device is not the same in all directions.
constexpr double kAlong = 0.7;
/// A fit that leaves more of the way unexplained says nothing.
constexpr double kUnexplained = 0.05;
constexpr double kOtherMass = 0.3;    // Share of the rated mass.
constexpr double kOtherDelay = 2e-3;  // s.
/// Apparent masses along two axes that differ by more are those of a motor that gives less than the
/// others: devices are not equally heavy in all directions, but not so unequal.
constexpr double kUnequalAxes = 1.5;

/// What the two pushes along one axis showed.
struct AxisPushes {
  Vector3 axis = Vector3::Zero();
  Vector3 way = Vector3::Zero();  ///< Half the difference of both, m.
  std::string answer{};           ///< Answer of the person.
  std::array<std::vector<HandleSample>, 2> samples{};
};

/// The way from before the push to where the handle was farthest.
Vector3 way_of(const std::vector<HandleSample>& samples) {
  Vector3 farthest = Vector3::Zero();
  for (const HandleSample& sample : samples) {
    const Vector3 way = sample.p - samples.front().p;
    if (way.norm() > farthest.norm()) farthest = way;
  }
  return farthest;
}

std::string terms(double force, std::size_t axes) {
  return fmt::format(
      "The force: there are {} pushes, each of {:.2g} N at most and {} s at most, limited as "
      "haptic_server limits force. A push ends at once when the handle has gone {:.0f} mm or is "
      "faster than {} m/s, when its position stands still, by Ctrl-C, or at a terminal by Enter. "
      "With its motors on, a device that compensates for gravity also bears its own weight. Keep "
      "the device's switch within reach and the handle near the middle of where it goes. Type yes "
      "to allow them; no leaves the motors off.",
      2 * axes, force, kPushTime, 1e3 * kFarthestPush, kFastestPush);
}

/// What was measured, for a person: "1 N moved it 3.2 mm right".
std::string what_happened(const AxisPushes& pushes, double force, bool seen,
                          const Outlook& outlook) {
  if (!seen) return fmt::format("{:.2g} N did not move it", force);
  return fmt::format("{:.2g} N moved it {:.1f} mm {}", force, 1e3 * pushes.way.norm(),
                     outlook.word_of(pushes.way));
}

/// In a hand, the way alone proves no wrong sign: a hand moves by itself.
Finding finding_on(const AxisPushes& pushes, double force, double least_way, bool free,
                   const Outlook& outlook) {
  const std::string subject(outlook.word_of(pushes.axis));
  const double size = pushes.way.norm();
  const bool seen = size > least_way;
  const double along = seen ? pushes.axis.dot(pushes.way) / size : 0;
  const std::optional<Vector3> felt = outlook.in_world(pushes.answer);
  const double felt_along = felt ? pushes.axis.dot(*felt) : 0;
  const std::string what = what_happened(pushes, force, seen, outlook);
  if (along < -kAlong && (free || felt_along < 0)) {
    return {Verdict::kProblem, subject,
            what +
                ": its force has the wrong sign, and contact would "
                "make the handle run away",
            "do not start a session; look at the sign of force in the device's settings"};
  }
  if (felt && felt_along < kAlong) {
    return {Verdict::kProblem, subject,
            what + fmt::format(", but the person says that it went {}", outlook.word_of(*felt)),
            "check the frame again; do not start a session before both agree"};
  }
  if (along > kAlong) return {Verdict::kGood, subject, what, ""};
  if (along < -kAlong) {
    return {Verdict::kWarning, subject, what + ", against the push, which a hand may have done",
            "try again with a handle that nobody holds"};
  }
  if (seen && free) {
    return {Verdict::kProblem, subject, what + " instead of " + subject,
            "something touched it, or its forces are in another frame than its positions"};
  }
  if (felt) {
    return {Verdict::kGood, subject, "felt " + subject + "; what was measured tells nothing", ""};
  }
  return {Verdict::kWarning, subject,
          what + " and nothing was felt: its friction is more, or its motors are off",
          force < kPushes.most ? fmt::format("try again with --push {}", kPushes.most) : ""};
}

/// A push that the machine disturbed weighs no more than another.
struct Spread {
  double least = 0;
  double median = 0;
  double most = 0;
};

Spread spread_of(const std::vector<PushFit>& fits, double PushFit::*member) {
  std::vector<double> values(fits.size());
  std::transform(fits.begin(), fits.end(), values.begin(),
                 [member](const PushFit& fit) { return fit.*member; });
  std::sort(values.begin(), values.end());
  return {values.front(), values[values.size() / 2], values.back()};
}

std::string text_of(const Spread& spread, const char* unit, double scale = 1) {
  return fmt::format("{:.2g} {} ({:.2g} to {:.2g})", scale * spread.median, unit,
                     scale * spread.least, scale * spread.most);
}

Finding mass_finding(const Spread& mass, const DeviceRatings& rated) {
  const double known = rated.mass * rated.scale;  // Mass at the handle.
  const std::string text = text_of(mass, "kg");
  const std::string advice = fmt::format("--device-option apparent-mass={:.2g}", mass.median);
  if (known == 0) {
    return {Verdict::kNote, "mass", text + ", which the driver does not know",
            advice + " lets the server estimate the hand's force, and bound the stiffness"};
  }
  const std::string both = text + fmt::format("; known as {:.2g} kg", known);
  if (std::abs(mass.median - known) <= kOtherMass * known) {
    return {Verdict::kGood, "mass", both, ""};
  }
  return {Verdict::kWarning, "mass",
          both + fmt::format(": its motors give {:.2g} times what was commanded, or its positions "
                             "have another scale, or that mass is wrong",
                             known / mass.median),
          "hang a known weight on the handle while a session holds it: what is commanded must bear "
          "it. If it does, " +
              advice};
}

/// A motor that gives less than the others, as a handle that is heavier along one axis.
void add_unequal_axes(const std::vector<std::pair<Vector3, double>>& masses, const Outlook& outlook,
                      std::vector<Finding>& findings) {
  if (masses.size() < 2) return;
  const auto [least, most] = std::minmax_element(
      masses.begin(), masses.end(),
      [](const auto& one, const auto& other) { return one.second < other.second; });
  if (most->second <= kUnequalAxes * least->second) return;
  findings.push_back(
      {Verdict::kWarning, "axes",
       fmt::format("{:.2g} kg {}, but {:.2g} kg {}: one motor gives less than the others, or one "
                   "position has another scale",
                   most->second, outlook.word_of(most->first), least->second,
                   outlook.word_of(least->first)),
       "look at the motors, their cables and the device's own settings before a session"});
}

Finding delay_finding(const Spread& delay, const DeviceRatings& rated) {
  const std::string text = text_of(delay, "ms", 1e3) + " from a command to its effect in the pose";
  if (delay.median < rated.delay + kOtherDelay) return {Verdict::kGood, "delay", text, ""};
  const std::string known = rated.delay > 0 ? fmt::format("; known as {:.2g} ms", 1e3 * rated.delay)
                                            : ", which the driver does not know";
  return {Verdict::kWarning, "delay", text + known,
          fmt::format("--device-option apparent-delay={:.2g} has the server lower stiffness to "
                      "what this bears",
                      delay.median)};
}

/// Adds the fits of a handle that nobody held.
void add_fits(const std::vector<AxisPushes>& all, const DeviceRatings& rated,
              const Outlook& outlook, std::vector<Finding>& findings) {
  std::vector<PushFit> fits;
  std::vector<std::pair<Vector3, double>> masses;  // By axis, kg.
  for (const AxisPushes& pushes : all) {
    double sum = 0;
    int count = 0;
    for (std::size_t i = 0; i < 2; ++i) {
      const Vector3 direction = i == 0 ? pushes.axis : Vector3(-pushes.axis);
      const auto fit = fit_push(pushes.samples[i], direction);
      if (!fit || fit->unexplained >= kUnexplained) continue;
      fits.push_back(*fit);
      sum += fit->mass;
      ++count;
    }
    if (count > 0) masses.emplace_back(pushes.axis, sum / count);
  }
  if (fits.empty()) {
    findings.push_back(
        {Verdict::kNote, "mass",
         "mass, friction and delay are not known: no push moved the handle as a free "
         "one moves",
         ""});
    return;
  }
  findings.push_back(delay_finding(spread_of(fits, &PushFit::delay), rated));
  findings.push_back(mass_finding(spread_of(fits, &PushFit::mass), rated));
  add_unequal_axes(masses, outlook, findings);
  findings.push_back({Verdict::kNote, "friction",
                      text_of(spread_of(fits, &PushFit::friction), "N") + " dry; damping " +
                          text_of(spread_of(fits, &PushFit::damping), "N·s/m"),
                      ""});
}

/// Motors on; without a command a handle must not run away.
void begin(DeviceBench& bench, double force) {
  bench.enable(force);
  const Vector3 before = bench.latest().p;
  bench.watch(kQuietTime);
  const HandleSample& now = bench.latest();
  if ((now.p - before).norm() > kFarthestPush || now.v.norm() > kFastestPush) {
    throw BenchEnded(Verdict::kProblem,
                     "with its motors on and without a command the handle moved away: it bears its "
                     "weight wrongly, or a hand moved it");
  }
}

std::string blind(double force) {
  return fmt::format(
      "no new state came during a push of {:.2g} N: its state is frozen, or friction holds it{}",
      force, force < kPushes.most ? fmt::format("; try again with --push {}", kPushes.most) : "");
}

AxisPushes push_along(DeviceBench& bench, const Vector3& axis, double force, bool free) {
  AxisPushes pushes{.axis = axis};
  const auto wait_for_rest = [&] {
    if (!bench.rests(free ? kRestSpeed : kRestSpeedHeld, kPatience)) {
      throw BenchEnded(Verdict::kWarning, "the handle did not come to rest around a push");
    }
  };
  const auto push = [&](double sign) {
    wait_for_rest();
    if (!bench.push(sign * force * axis, kPushTime))
      throw BenchEnded(Verdict::kProblem, blind(force));
    std::vector<HandleSample> samples = bench.samples();
    wait_for_rest();
    return samples;
  };
  pushes.samples[0] = push(1);
  pushes.answer = bench.ask(
      "Which way did it go: right, left, away, near, up or down? Enter if you cannot tell.");
  pushes.samples[1] = push(-1);
  pushes.way = (way_of(pushes.samples[0]) - way_of(pushes.samples[1])) / 2;
  return pushes;
}

}  // namespace

double push_force(const DeviceRatings& rated, std::optional<double> most) {
  const double usual = std::clamp(kShareOfRating * rated.max_force, kPushes.least, kPushes.most);
  return std::min(most.value_or(usual), rated.max_force);
}

bool examine_pushes(DeviceBench& bench, Person& person, const Outlook& outlook, double force,
                    double noise, std::vector<Finding>& findings) {
  std::vector<Vector3> axes;
  for (int i = 0; i < 3; ++i) {
    if ((bench.device().ratings().freedoms >> i & 1) != 0) axes.push_back(Vector3::Unit(i));
  }
  if (axes.empty()) {
    findings.push_back({Verdict::kWarning, "force",
                        "not tried: the handle moves along none of the world's axes, along which "
                        "it would be pushed",
                        "try again with a frame whose axes are the device's, as 'x y z'"});
    return false;
  }
  if (!person.may_consent()) {
    findings.push_back({Verdict::kWarning, "force",
                        "not tried: answers come from a file, which cannot allow force",
                        "answer at a terminal, or through a pipe that stays open"});
    return false;
  }
  if (!bench.ask_whether(terms(force, axes.size()))) {
    findings.push_back({Verdict::kWarning, "force", "not tried: it was not allowed", ""});
    return false;
  }
  begin(bench, force);
  const bool free = bench.ask_whether(
      "The motors are on, without a command yet. Let go of the handle if it stays "
      "where it is; otherwise hold it loosely. Is it free? yes or no");
  if (free) bench.let_go();
  const double least_way = std::max(free ? kLeastWay : kLeastWayHeld, kTimesNoise * noise);
  std::vector<AxisPushes> all;
  for (const Vector3& axis : axes) {
    person.say(fmt::format("It pushes {} ...", outlook.word_of(axis)));
    all.push_back(push_along(bench, axis, force, free));
    findings.push_back(finding_on(all.back(), force, least_way, free, outlook));
    if (findings.back().verdict == Verdict::kProblem) break;
  }
  bench.disable();
  if (!free) {
    findings.push_back({Verdict::kNote, "mass",
                        "mass, friction and delay are not known: they need a handle that nobody "
                        "holds",
                        ""});
  } else if (findings.back().verdict != Verdict::kProblem) {
    add_fits(all, bench.device().ratings(), outlook, findings);
  }
  return all.size() == axes.size();
}

}  // namespace hlm::server
