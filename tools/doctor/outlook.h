// Directions as a person says them, and where they are in the world.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "hlm/common/spatial.h"

namespace hlm::server {

/// How the world lies before a person whose right is p_P = (1, 0, 0), whose forward direction is
/// (0, 1, 0), and whose up is (0, 0, 1).
class Outlook {
 public:
  /// Where the world's x, y and z point, as "right away up" or "right up near", in any case.
  /// `axes` must be valid (find_error).
  explicit Outlook(const std::string& axes);

  /// The unit vector in the world of the person's right, away and up, by `axis` from 0.
  Vector3 in_world(Eigen::Index axis) const { return R_PW_.row(axis).transpose(); }
  /// The same of a word, right, left, away, near, up or down, or its first letter; empty for
  /// anything else.
  std::optional<Vector3> in_world(std::string_view word) const;
  /// The word that a vector in the world is nearest to.
  std::string_view word_of(const Vector3& v_W) const;

 private:
  Matrix3 R_PW_;
};

/// Why they cannot be the world's axes; empty if they can.
std::optional<std::string> find_error_in_axes(const std::string& axes);

}  // namespace hlm::server
