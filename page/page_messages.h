// What a page is sent, as JSON or, for ticks, as bytes: docs/page_messages.md.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "hlm/common/tool_description.h"
#include "hlm/geometry/mesh.h"
#include "hlm/geometry/shape.h"
#include "hlm/page/live_settings.h"
#include "hlm/page/scene_summary.h"
#include "hlm/protocol/messages.h"

namespace hlm::ve {

using geometry::Mesh;
using geometry::Shape;

/// What is seen of a body, in its frame.
struct PageShape {
  std::variant<Shape, std::shared_ptr<const Mesh>> geometry;
  Pose X_BG{};
};
struct PageBody {
  std::string name{};  ///< Empty: it has none.
  bool fixed = false;  ///< It never moves.
  bool is_tool = false;
  Pose X_WB{};
  std::vector<PageShape> shapes{};
};

/// A tool as a session has it.
struct PageTool {
  ToolDescription description{};
  Configuration q{};          ///< Initial configuration.
  std::vector<int> bodies{};  ///< Body of each link.
  std::vector<Pose> X_LB{};   ///< Body frame in each link's frame.
  bool gripper = false;       ///< A servo drives joints of it.
};

/// A world and its tool, as they begin.
struct PageWorld {
  std::vector<PageBody> bodies{};
  PageTool tool{};
  std::string scene{};                 ///< What is played; empty: it has no name.
  std::vector<SceneSummary> scenes{};  ///< What may be played, this one included.
  std::vector<std::string> starts{};   ///< Places where the tool may begin.
  std::string start{};                 ///< The one where it began; empty: where the world has it.
  bool environment = true;             ///< Pages may set what is the client's (kEnvironmentRanges).
  const protocol::Welcome* welcome = nullptr;  ///< Null before the server has answered.
};
/// The message `world`.
std::string world_message(const PageWorld& world);

/// What a frame shows.
struct PageFrame {
  std::vector<Pose> X_WB{};        ///< Of the bodies that are not fixed, in the order of the world.
  const PageTool* tool = nullptr;  ///< Never null.
  bool connected = false;
  double round_trip = 0;                           ///< s.
  const protocol::ProxyState* state = nullptr;     ///< Latest one of the session, null at first.
  const protocol::LocalState* contacts = nullptr;  ///< Latest contacts, null without telemetry.
  std::size_t reported = 0;                        ///< Contacts of the tool sent with this frame.
  double epsilon = 0;                              ///< ε of this frame, m.
  LiveSettings settings{};
  double world_time = 0;  ///< s.
  bool held = false;      ///< A page holds the hand.
  /// Why the server gives no session; empty in one, and before it has said.
  std::optional<protocol::Reject> rejected{};
  std::string recording{};  ///< Name of the latest flight recording; empty: none is known here.
};
std::string frame_message(const PageFrame& frame);

std::string refused_message(const std::string& field, const std::string& value,
                            const std::string& text);

/// Rows of consecutive steps: a float32 for each of kTickColumns, after a header of 16 bytes.
class TickBatch {
 public:
  void add(const protocol::Ticks& ticks);
  bool empty() const { return count_ == 0; }
  /// Whether these ticks follow those that are in it.
  bool continues(const protocol::Ticks& ticks) const {
    return count_ == 0 || ticks.first_step == first_step_ + count_;
  }
  /// The message, and none is left.
  std::string take();

 private:
  std::uint64_t first_step_ = 0;
  std::uint64_t count_ = 0;
  std::string rows_;
};

}  // namespace hlm::ve
