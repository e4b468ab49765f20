// Where a device's axes point in the world, from movements of which a person says the direction.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "hlm/common/spatial.h"

namespace hlm::server {

/// One movement of the handle.
struct ToldMove {
  Vector3 told;   ///< Where it went, unit vector of a world axis.
  Vector3 moved;  ///< What the device reported, in its own frame, m, not zero.
};

struct FrameFit {
  Matrix3 R_WB;      ///< The rotation that fits best; B: the device's frame.
  double deviation;  ///< Deviation of the movement that fits worst, rad.
};

/// The fit to two or three movements along different axes; with two, a mirror cannot be told from a
/// frame that is turned over. Empty if the movements were no three, or two, different ones.
std::optional<FrameFit> fit_frame(const std::vector<ToldMove>& moves);

/// Whether three movements are those of a mirror.
bool mirrors(const std::vector<ToldMove>& moves);

/// The frame as the key `frame` takes it: "-y x z" where its axes lie within 25° of the world's, or
/// else roll, pitch and yaw in degrees, rounded to 5.
std::string frame_text(const Matrix3& R_WB);

/// Angle of the turn from one frame to another, rad.
double angle_between(const Matrix3& A, const Matrix3& B);

}  // namespace hlm::server
