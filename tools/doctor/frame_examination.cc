#include "hlm/tools/doctor/frame_examination.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <optional>

#include <spdlog/fmt/fmt.h>

#include "hlm/tools/doctor/frame_fit.h"

namespace hlm::server {
namespace {

constexpr double kLeastMove = 0.015;  // m; less cannot be told from how a hand rests.
constexpr double kLargestMove = 0.3;  // m; more is another unit, not 5 cm.
/// What is asked, m, and how far a hand is off at most; in a small workspace it moves less.
constexpr double kAskedMove = 0.05;
constexpr double kFarMove = 1.4 * kAskedMove;
constexpr double kNearMove = 0.5 * kAskedMove;
/// Speeds that lead farther or less far than the handle went by that factor have another scale.
constexpr double kOtherSpeed = 1.3;
constexpr int kTries = 3;                                   // Tries for each direction.
constexpr double kSameFrame = 25 * std::numbers::pi / 180;  // rad.
constexpr double kUnsure = 30 * std::numbers::pi / 180;     // rad.
constexpr Freedoms kAlongAxes = 0b000111;
/// Questions in the order of Outlook::in_world().
constexpr std::array<const char*, 3> kAsked{"to the right", "away from you", "up"};

/// A movement that takes back more than this of an earlier one also goes back.
constexpr double kBack = 0.4;

/// How far the speeds of the latest run lead along its way, of that way; empty if it is too short.
std::optional<double> led_share(const std::vector<HandleSample>& samples) {
  if (samples.size() < 2) return std::nullopt;
  const Vector3 way = samples.back().p - samples.front().p;
  if (way.norm() < kLeastMove) return std::nullopt;
  Vector3 led = Vector3::Zero();
  for (std::size_t i = 1; i < samples.size(); ++i) {
    led += (samples[i].time - samples[i - 1].time) * (samples[i].v + samples[i - 1].v) / 2;
  }
  return led.dot(way) / way.squaredNorm();
}

double median_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Speed and scale: of one movement a person may be wrong, of all only the device.
void add_scales(const std::vector<double>& shares, const std::vector<ToldMove>& moves,
                std::vector<Finding>& findings) {
  if (!shares.empty()) {
    const double share = median_of(shares);
    const bool differs = share > kOtherSpeed || share < 1 / kOtherSpeed;
    findings.push_back(
        {differs ? Verdict::kWarning : Verdict::kGood, "speed",
         fmt::format("leads {:.2g} times as far as its positions went", share),
         differs ? "look at the unit of its speed, or take the speed from its positions: a wrong "
                   "one makes contact buzz or creep"
                 : ""});
  }
  if (moves.size() < 2) return;
  std::vector<double> sizes;
  for (const ToldMove& move : moves) sizes.push_back(move.moved.norm());
  const double size = median_of(sizes);
  if (size <= kFarMove && size >= kNearMove) return;
  findings.push_back(
      {Verdict::kWarning, "scale",
       fmt::format("its movements were {:.0f} mm, where about {:.0f} mm were asked", 1e3 * size,
                   1e3 * kAskedMove),
       "if you moved it by 5 cm, its positions have another scale: look at its settings"});
}

int translations(const DeviceRatings& rated) {
  return std::popcount(static_cast<unsigned>(rated.freedoms & kAlongAxes));
}

/// Whether the handle was taken back, as to the middle, before it went where it was to go.
bool goes_back(const Vector3& move, const std::vector<Vector3>& earlier) {
  return std::any_of(earlier.begin(), earlier.end(), [&](const Vector3& before) {
    return move.dot(before) < -kBack * before.squaredNorm();
  });
}

/// The move in the world, m; empty if the handle does not go there. earlier: moves before it.
std::optional<Vector3> move_along(DeviceBench& bench, Person& person, std::size_t axis,
                                  const std::vector<Vector3>& earlier,
                                  std::vector<double>& shares) {
  const bool may_skip = translations(bench.device().ratings()) < 3;
  const std::string question =
      fmt::format("{} move the handle about 5 cm {}, hold it there and press Enter{}.",
                  earlier.empty() ? "Now" : "From where it is now, not from the middle,",
                  kAsked[axis], may_skip ? ", or type skip if it does not go there" : "");
  bool went_back = false;
  for (int i = 0; i < kTries; ++i) {
    const Vector3 before = bench.latest().p;
    if (bench.ask(question) == "skip" && may_skip) return std::nullopt;
    const Vector3 move = bench.latest().p - before;
    went_back = goes_back(move, earlier);
    if (move.norm() >= kLeastMove && !went_back) {
      if (const auto share = led_share(bench.samples())) shares.push_back(*share);
      return move;
    }
    person.say(went_back
                   ? "It also went back from where it was. Leave it there. Once more."
                   : fmt::format("It moved by {:.1f} mm only. Once more.", 1e3 * move.norm()));
  }
  if (went_back) {
    throw BenchEnded(Verdict::kWarning,
                     fmt::format("the handle went back each time before it went {}", kAsked[axis]));
  }
  throw BenchEnded(Verdict::kProblem,
                   fmt::format("the handle did not move {}, or its state is frozen", kAsked[axis]));
}

std::string device_axis(const Matrix3& R_WB, const Vector3& move) {
  const Vector3 v = R_WB.transpose() * move;
  Eigen::Index i = 0;
  v.cwiseAbs().maxCoeff(&i);
  return std::string(v[i] < 0 ? "-" : "+") + "xyz"[i];
}

Finding finding_on(const std::vector<ToldMove>& moves, const Workspace& workspace) {
  const std::string name = "frame '" + workspace.frame + "' ";
  if (moves.size() < 2) {
    return {Verdict::kWarning, "frame", "not checked: that needs two directions", ""};
  }
  const std::optional<FrameFit> fit = fit_frame(moves);
  if (!fit) {
    return {Verdict::kProblem, "frame",
            "not known: two of the movements were reported in the same direction",
            "move along one direction at a time, and try again"};
  }
  if (mirrors(moves)) {
    return {
        Verdict::kProblem, "frame",
        "the positions are those of a mirror: no turn of the device explains these movements",
        "if you moved as asked, look at the device's own settings (handedness, sign of an axis); "
        "no frame can mend it"};
  }
  const double off = angle_between(fit->R_WB, rotation_of(workspace));
  const double degrees = off * 180 / std::numbers::pi;
  if (fit->deviation > kUnsure) {
    return {Verdict::kWarning, "frame",
            "not sure: the movements were not at right angles to each other", "try again"};
  }
  if (off < kSameFrame) {
    return {Verdict::kGood, "frame",
            name + fmt::format("is right, within {:.0f}° of how the hand moved", degrees), ""};
  }
  const std::string right = frame_text(fit->R_WB);
  return {Verdict::kProblem, "frame",
          name + fmt::format("is wrong by {:.0f}°: these movements are those of frame '{}'",
                             degrees, right),
          "--device-option \"frame=" + right + "\", then check again"};
}

}  // namespace

bool examine_frame(DeviceBench& bench, Person& person, const Workspace& workspace,
                   const Outlook& outlook, std::vector<Finding>& findings) {
  person.say(
      fmt::format("The frame: in the world x points {}, y {} and z {} "
                  "(--world-axes says so). The motors are off: if the handle falls, hold it.",
                  outlook.word_of(Vector3::UnitX()), outlook.word_of(Vector3::UnitY()),
                  outlook.word_of(Vector3::UnitZ())));
  bench.ask("Take the handle to the middle of where it goes, and press Enter.");
  const Matrix3 R_WB = rotation_of(workspace);
  std::vector<ToldMove> moves;
  std::vector<Vector3> earlier;
  std::vector<double> shares;  // Of the ways, to which the speeds lead.
  for (std::size_t axis = 0; axis < kAsked.size(); ++axis) {
    const Vector3 told = outlook.in_world(static_cast<Eigen::Index>(axis));
    const std::string word(outlook.word_of(told));
    const std::optional<Vector3> move = move_along(bench, person, axis, earlier, shares);
    if (!move) {
      findings.push_back({Verdict::kNote, word, "skipped: the handle does not go there", ""});
      continue;
    }
    const bool is_large = move->norm() > kLargestMove;
    findings.push_back({is_large ? Verdict::kWarning : Verdict::kNote, word,
                        fmt::format("{:.0f} mm along the device's {}", 1e3 * move->norm(),
                                    device_axis(R_WB, *move)),
                        is_large ? "about 50 mm were asked: is its unit another one?" : ""});
    earlier.push_back(*move);
    moves.push_back({told, R_WB.transpose() * *move});
  }
  add_scales(shares, moves, findings);
  findings.push_back(finding_on(moves, workspace));
  return findings.back().verdict == Verdict::kGood;
}

}  // namespace hlm::server
