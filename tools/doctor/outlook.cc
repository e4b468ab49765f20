#include "hlm/tools/doctor/outlook.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <iterator>
#include <sstream>
#include <vector>

namespace hlm::server {
namespace {

/// Along the person's axes and against them.
constexpr std::array<std::array<std::string_view, 2>, 3> kWords{
    {{"right", "left"}, {"away", "near"}, {"up", "down"}}};

/// The direction that the word names, in the person's axes.
std::optional<Vector3> direction_of(std::string_view word) {
  for (Eigen::Index i = 0; i < 3; ++i) {
    for (int sign = 0; sign < 2; ++sign) {
      const std::string_view known =
          kWords[static_cast<std::size_t>(i)][static_cast<std::size_t>(sign)];
      if (word == known || word == known.substr(0, 1)) {
        return (sign == 0 ? 1 : -1) * Vector3::Unit(i);
      }
    }
  }
  return std::nullopt;
}

/// The world's axes as columns; empty unless they are three words.
std::optional<Matrix3> matrix_of(const std::string& axes) {
  std::string lower = axes;
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  std::istringstream text(lower);
  const std::vector<std::string> words{std::istream_iterator<std::string>(text), {}};
  if (words.size() != 3) return std::nullopt;
  Matrix3 R_PW;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const auto direction = direction_of(words[static_cast<std::size_t>(i)]);
    if (!direction) return std::nullopt;
    R_PW.col(i) = *direction;
  }
  return R_PW;
}

}  // namespace

Outlook::Outlook(const std::string& axes) : R_PW_(*matrix_of(axes)) {}

std::optional<Vector3> Outlook::in_world(std::string_view word) const {
  const std::optional<Vector3> direction = direction_of(word);
  return direction ? std::optional<Vector3>(R_PW_.transpose() * *direction) : std::nullopt;
}

std::string_view Outlook::word_of(const Vector3& v_W) const {
  const Vector3 v = R_PW_ * v_W;
  Eigen::Index i = 0;
  v.cwiseAbs().maxCoeff(&i);
  return kWords[static_cast<std::size_t>(i)][v[i] < 0 ? 1 : 0];
}

std::optional<std::string> find_error_in_axes(const std::string& axes) {
  const std::optional<Matrix3> R_PW = matrix_of(axes);
  const bool is_rotation = R_PW && std::abs(R_PW->determinant() - 1) < 0.5;
  if (is_rotation) return std::nullopt;
  return "world-axes '" + axes +
         "' must be three of right, left, away, near, up, down that are right-handed, as 'right "
         "away "
         "up' or 'right up near'";
}

}  // namespace hlm::server
