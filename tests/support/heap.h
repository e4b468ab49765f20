// Scenes in which very much overlaps: shapes of one kind in one place.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "hlm/haptic_server/local_model/local_model.h"
#include "hlm/haptic_server/scene/scene.h"
#include "tests/support/random.h"

namespace hlm::test {

inline geometry::AnyShape random_shape(Random& random, int kind, double size) {
  switch (kind) {
    case 0:
      return geometry::Shape(geometry::Box{Vector3::Constant(size)});
    case 1:
      return geometry::Shape(geometry::Cylinder{size / 2, size});
    case 2: {
      geometry::Hull hull;
      for (int i = random.integer(8, 300); i > 0; --i) {
        hull.vertices.push_back(size / 2 * random.direction());
      }
      return geometry::Shape(hull);
    }
    case 3:
      return geometry::Shape(geometry::Ellipsoid{{size / 2, size / 3, size / 4}});
    case 4:
      return geometry::Shape(geometry::Capsule{size / 4, size});
    default:
      return geometry::Shape(geometry::Sphere{size / 2});
  }
}

/// Shapes of one size, turned and moved at random about one place.
class Heap {
 public:
  static constexpr ContactSide kWorld{SideKind::kWorld, 0};
  static constexpr ContactSide kTool{SideKind::kToolLink, 0};

  Heap(Random& random, int kind, double size, double spread)
      : random_(random), kind_(kind), size_(size), spread_(spread) {}

  void add(const ContactSide& side, int count) {
    for (int i = 0; i < count; ++i) {
      const auto shape = random_shape(random_, kind_, size_);
      shapes.push_back(
          {.shape = std::make_shared<const geometry::ShapeParts>(parts_of(shape, "of the test")),
           .side = side,
           .X_BS = {random_.vector(spread_), rotation_from_vector(3 * random_.direction())}});
    }
  }

  std::vector<server::PlacedShape> shapes;

 private:
  Random& random_;
  int kind_;
  double size_;    ///< m.
  double spread_;  ///< m, to each side.
};

/// A tool and movable bodies of up to 90 and 20 shapes each among up to 90, a quarter of them in
/// millimetres for metres.
struct RandomHeap {
  explicit RandomHeap(Random& random)
      : unit(random.integer(0, 3) == 0 ? 1000 : 1),
        kind(random.integer(0, 5)),
        heap(random, kind, 0.1 * unit, unit * 0.3 * std::pow(10, random.uniform(-2, 0))) {
    heap.add(Heap::kWorld, random.integer(1, 90));
    heap.add(Heap::kTool, random.integer(1, 90));
    const int count = random.integer(0, 2) == 0 ? random.integer(1, 8) : 0;
    for (int id = 0; id < count; ++id) {
      heap.add({SideKind::kMovableBody, static_cast<std::uint32_t>(id)}, random.integer(1, 20));
      MovableBody& body = bodies.emplace_back();
      body.id = static_cast<std::uint32_t>(id);
      body.W.diagonal() << Vector3::Constant(3), Vector3::Constant(3000);
      poses.push_back({.body = body.id, .X_WB = {body.p_WCom, Quaternion::Identity()}});
    }
  }

  double unit;  ///< Lengths are multiplied by it.
  int kind;
  Heap heap;
  MovableBodies bodies;
  BodyPoses poses;
};

}  // namespace hlm::test
