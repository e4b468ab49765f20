// Contacts for engines whose own are late, few or nameless: shapes once, their poses in each step.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "hlm/common/contact.h"
#include "hlm/geometry/contact_finder.h"
#include "hlm/geometry/select.h"
#include "hlm/geometry/shape_parts.h"
#include "hlm/geometry/skin_contacts.h"

namespace hlm {

/// A shape of the world, of a link of the tool or of a movable body. A mesh is the world's or a
/// body's.
struct BodyShape {
  geometry::AnyShape shape;
  ContactSide side;
};

/// Shapes that are fixed to each other make one surface: those of one link or body, and all shapes
/// of the world that have not moved since the first call.
class ShapeContacts {
 public:
  /// Whether two shapes may touch, by their places in the list. Those of one side never do, nor do
  /// links of the tool.
  using MayTouch = std::function<bool(std::size_t a, std::size_t b)>;

  struct Found {
    ReportedContact contact;  ///< Velocity and load are 0, friction is the server's.
    std::size_t shape_a = 0;  ///< Places in the list.
    std::size_t shape_b = 0;
  };

  /// Throws std::invalid_argument, which names the shape by its place, if one cannot be used.
  explicit ShapeContacts(std::vector<BodyShape> shapes, MayTouch may_touch = {});
  ShapeContacts(const ShapeContacts&) = delete;
  ShapeContacts& operator=(const ShapeContacts&) = delete;

  /// Contacts within epsilon (m, >= 0), with the shapes' frames at these poses: those of the tool
  /// with all other shapes, on all axes of each pair; then those of the bodies that the tool
  /// touches, and of the bodies that these touch. If there are more than kMaxContacts, the ones
  /// that say most about where the tool or body can go. A shape whose pose is not finite or beyond
  /// 1e7 m, or whose rotation is of length 0, has none. The first call, and any in which a shape
  /// moves relative to what it was fixed to, arranges all surfaces anew. Valid until the next call.
  std::span<const Found> find(std::span<const Pose> X_WS, double epsilon);

 private:
  /// A shape, and where it is fixed.
  struct Entry {
    ContactSide side;
    geometry::ShapeParts parts;
    std::uint32_t first = 0;  ///< Number of its first piece among all.
    int body = 0;
    int first_of_body = 0;   ///< And among those of its body.
    Pose X_FS;               ///< In the body, or in the world if that is fixed.
    bool has_moved = false;  ///< Of the world: it does not stand still.
    bool is_loose = false;   ///< It has moved against its body: it is one of its own.
  };

  /// Shapes that move as one.
  struct Body {
    ContactSide side;
    std::size_t shape = 0;  ///< That whose frame is the body's.
    bool is_fixed = false;
    bool is_placed = false;  ///< Its pose is finite.
  };

  void add(std::size_t place, BodyShape shape);
  void arrange(std::span<const Pose> X_WS);
  void make_finder();
  bool place(std::span<const Pose> X_WS);
  bool may_touch(const geometry::CollisionId& a, const geometry::CollisionId& b) const;
  std::size_t shape_of(const geometry::CollisionId& piece) const;
  std::uint32_t number_of(const geometry::CollisionId& piece) const;
  geometry::FoundContact named(geometry::FoundContact contact) const;
  std::vector<geometry::FoundContact> contacts_of(std::span<const int> bodies,
                                                  const geometry::ContactFinder::Search& search);
  void find_of_tool(double epsilon);
  void find_of_bodies(double epsilon);
  void report(const geometry::FoundContact& contact);

  std::vector<Entry> shapes_;
  MayTouch may_touch_;
  std::vector<Body> bodies_;
  std::vector<std::vector<std::size_t>> shape_of_;  ///< [body][piece].
  std::unique_ptr<geometry::Pieces> pieces_;
  std::unique_ptr<geometry::ContactFinder> finder_;
  geometry::ContactSelection selection_;
  geometry::ContactSelection selection_of_bodies_;
  geometry::SkinContacts skin_contacts_;
  std::vector<Pose> X_WB_;
  std::vector<Found> found_;
};

}  // namespace hlm
