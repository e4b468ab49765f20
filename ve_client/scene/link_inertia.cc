#include "hlm/ve_client/scene/link_inertia.h"

#include <sstream>
#include <string>

#include <Eigen/Eigenvalues>

#include "hlm/common/range.h"
#include "hlm/ve_client/scene/sdf_geometry.h"
#include "hlm/ve_client/scene/sdf_places.h"

namespace hlm::ve {
namespace {

/// Masses of a body that moves. The engine divides by it.
constexpr Range kMasses{1e-9, 1e9, "kg"};
/// Mean density below which a mass is a mistake, kg/m³: a hundredth of the air's.
constexpr double kLeastDensity = 0.01;
/// Density of links whose mass is none, kg/m³: that of water, as in SDFormat.
constexpr double kDensity = 1000;
/// Least principal moment of inertia as a portion of the largest: below, the inertia cannot be
/// inverted reliably.
constexpr double kLeastMoment = 1e-9;
/// How far, as a portion of the largest, the largest moment may exceed the sum of the others:
/// files round to two or three digits.
constexpr double kMomentTolerance = 0.01;
/// Largest moment, as a portion of that of the shapes with the same mass, below which it is a
/// mistake: the body would turn a hundred times as fast as its size lets it.
constexpr double kLeastOfShapes = 1e-4;

/// The largest is the last.
Vector3 principal(const Matrix3& I_B) {
  return Eigen::SelfAdjointEigenSolver<Matrix3>(I_B, Eigen::EigenvaluesOnly).eigenvalues();
}

std::string in_digits(double value) {
  std::ostringstream text;
  text.precision(3);
  text << value;
  return text.str();
}

/// Three digits of each.
std::string brief(const Vector3& moments) {
  return in_digits(moments[0]) + ", " + in_digits(moments[1]) + ", " + in_digits(moments[2]) +
         " kg·m²";
}

/// Why no rigid body has this inertia; empty if one may. `of_shapes`: that of the shapes with the
/// same mass; null: there are none.
std::optional<std::string> find_inertia_error(const Matrix3& I_B, const Matrix3* of_shapes) {
  const Vector3 moments = principal(I_B);
  const std::string text = "principal moments of inertia " + shortest_text(moments[0]) + ", " +
                           shortest_text(moments[1]) + ", " + shortest_text(moments[2]) + " kg·m²";
  const Range largest{1e-15, 1e12};
  if (!largest.contains(moments[2]) || !(moments[0] >= kLeastMoment * moments[2])) {
    return text + " must be above 0";
  }
  if (moments[2] - moments[0] - moments[1] > kMomentTolerance * moments[2]) {
    return text + ": the largest must not exceed the sum of the others";
  }
  if (of_shapes != nullptr && moments[2] < kLeastOfShapes * principal(*of_shapes)[2]) {
    return text + " are those of a point";
  }
  return std::nullopt;
}

std::optional<std::string> find_mass_error(double mass, const std::optional<Solid>& solid) {
  if (auto error = find_error("mass", mass, kMasses)) return error;
  if (!solid || mass >= kLeastDensity * solid->volume) return std::nullopt;
  return "mass " + shortest_text(mass) + " kg must be at least " +
         in_digits(kLeastDensity * solid->volume) + " kg for shapes of " +
         in_digits(solid->volume) + " m³";
}

/// One link.
class InertiaReader {
 public:
  InertiaReader(const sdf::Link& link, const std::optional<Solid>& solid_B, BodyDescription& body,
                Diagnostics& diagnostics)
      : link_(link),
        inertial_(link.Element()->FindElement("inertial")),
        solid_(solid_B),
        body_(body),
        diagnostics_(diagnostics) {}

  void read() {
    body_.mass = link_.Inertial().MassMatrix().Mass();
    body_.I_B = to_matrix(link_.Inertial().Moi());
    if (!inertial_) return read_without_inertial();
    if (auto error = find_mass_error(body_.mass, solid_)) return replace_mass(*error);
    if (!inertial_->HasElement("mass"))
      say("an <inertial> without <mass> has 1 kg, as in SDFormat");
    if (!has_moments()) return read_without_moments();
    const Matrix3 of_shapes = solid_ ? of_solid() : Matrix3::Zero();
    const auto error = find_inertia_error(body_.I_B, solid_ ? &of_shapes : nullptr);
    if (!error) return;
    if (!solid_) return refuse(*error);
    take_moments();
    say(*error + "; those of its shapes are used: " + brief(principal(body_.I_B)));
  }

 private:
  void read_without_inertial() {
    if (!solid_) {
      return say("a link without <inertial> has 1 kg and 1 kg·m² about each axis, as in SDFormat");
    }
    take_all();
    say("a link without <inertial> has 1 kg, as in SDFormat, and the centre of mass and the "
        "inertia "
        "of its shapes: " +
        brief(principal(body_.I_B)));
  }

  void read_without_moments() {
    const std::string what = "an <inertial> without all of <ixx>, <iyy>, <izz> has ";
    if (!solid_) return say(what + "1 kg·m² where one is missing, as in SDFormat");
    take_moments();
    say(what + "those of the link's shapes: " + brief(principal(body_.I_B)));
  }

  /// Whether the file has all three.
  bool has_moments() const {
    const sdf::ElementPtr inertia = inertial_->FindElement("inertia");
    if (!inertia) return false;
    for (const char* name : {"ixx", "iyy", "izz"}) {
      const sdf::ElementPtr moment = inertia->FindElement(name);
      if (!moment || !moment->GetExplicitlySetInFile()) return false;
    }
    return true;
  }

  void replace_mass(const std::string& error) {
    const double mass = solid_ ? kDensity * solid_->volume : 0;
    if (!kMasses.contains(mass) || body_.mass > kMasses.most) {
      return refuse(error + "; or make the model <static>");
    }
    body_.mass = mass;
    take_all();
    say(error + "; its shapes at " + shortest_text(kDensity) +
        " kg/m³ are used: " + in_digits(mass) + " kg, " + brief(principal(body_.I_B)));
  }

  Matrix3 of_solid() const { return body_.mass / solid_->volume * solid_->moments; }

  void take_moments() {
    body_.I_B = of_solid();
    if (const auto error = find_inertia_error(body_.I_B, nullptr)) {
      refuse("its shapes have " + *error);
    }
  }

  void take_all() {
    take_moments();
    const Vector3 to_centre = solid_->centre;
    body_.X_WB.p += body_.X_WB.R * to_centre;
    body_.p_BS -= to_centre;
    for (CollisionDescription& collision : body_.collisions) collision.X_BG.p -= to_centre;
  }

  Place place() const { return place_of(inertial_ ? inertial_ : link_.Element()); }
  void say(const std::string& what) { diagnostics_.approximate(place(), what); }
  void refuse(const std::string& what) { diagnostics_.refuse(place(), what); }

  const sdf::Link& link_;
  sdf::ElementPtr inertial_;  ///< Null: the file has none.
  const std::optional<Solid>& solid_;
  BodyDescription& body_;
  Diagnostics& diagnostics_;
};

}  // namespace

void read_inertia(const sdf::Link& link, const std::optional<Solid>& solid_B, BodyDescription& body,
                  Diagnostics& diagnostics) {
  InertiaReader(link, solid_B, body, diagnostics).read();
}

}  // namespace hlm::ve
