#include "hlm/page/followed_session.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "hlm/common/tool_model.h"

namespace hlm::ve {

using namespace geometry;

namespace {

using page_wire::Kind;
using protocol::SceneShape;
using protocol::SceneShapeKind;

std::shared_ptr<const Mesh> mesh_of(const SceneShape& shape) {
  auto mesh = std::make_shared<Mesh>();
  mesh->points = shape.vertices;
  for (const auto& [a, b, c] : shape.triangles) {
    mesh->triangles.push_back({static_cast<int>(a), static_cast<int>(b), static_cast<int>(c)});
  }
  return mesh;
}

PageShape shape_of(const SceneShape& shape) {
  const Vector3& size = shape.size;
  switch (shape.kind) {
    case SceneShapeKind::kSphere:
      return {Sphere{size[0]}};
    case SceneShapeKind::kCapsule:
      return {Capsule{size[0], size[1]}};
    case SceneShapeKind::kCylinder:
      return {Cylinder{size[0], size[1]}};
    case SceneShapeKind::kBox:
      return {Box{size}};
    case SceneShapeKind::kEllipsoid:
      return {Ellipsoid{size}};
    case SceneShapeKind::kHull:
      return {Hull{shape.vertices}};
    case SceneShapeKind::kHalfSpace:
      return {HalfSpace{}};
    case SceneShapeKind::kMesh:
      return {mesh_of(shape)};
  }
  return {Sphere{0}};
}

}  // namespace

void FollowedSession::take(std::span<const std::byte> packet) {
  if (packet.empty()) return;
  const std::span<const std::byte> bytes = packet.subspan(1);
  switch (static_cast<Kind>(packet.front())) {
    case Kind::kMessage:
      return take_message(bytes);
    case Kind::kSceneBegin:
      return begin_scene();
    case Kind::kScene:
      return take_scene(bytes);
    case Kind::kSceneEnd:
      return end_scene();
    case Kind::kStatus:
      if (bytes.size() == sizeof status_) std::memcpy(&status_, bytes.data(), sizeof status_);
      return;
    case Kind::kAddress:
    case Kind::kTrouble:
      return;
  }
}

void FollowedSession::take_message(std::span<const std::byte> bytes) {
  const std::vector<protocol::DatagramBytes> parts = page_wire::parts_of(bytes);
  protocol::Header header;
  if (parts.empty() || protocol::decode_header(protocol::view(parts.front()), header)) return;
  using protocol::MessageType;
  switch (header.type) {
    case MessageType::kHello:
      return take_as<protocol::Hello>(parts);
    case MessageType::kWelcome:
      return take_as<protocol::Welcome>(parts);
    case MessageType::kReject:
      return take_as<protocol::Reject>(parts);
    case MessageType::kProxyState:
      return take_as<protocol::ProxyState>(parts);
    case MessageType::kContactUpdate:
      return take_as<protocol::ContactUpdate>(parts);
    case MessageType::kTicks:
      return take_as<protocol::Ticks>(parts);
    case MessageType::kLocalState:
      return take_as<protocol::LocalState>(parts);
    default:
      return;
  }
}

template <class Message>
void FollowedSession::take_as(std::span<const protocol::DatagramBytes> parts) {
  const auto message = std::make_unique<Message>();  // Some are large.
  if (!protocol::decode(parts, *message)) take(*message);
}

void FollowedSession::take(const protocol::Hello& hello) {
  const std::size_t links = hello.tool.links.size();
  tool_ = {.description = hello.tool,
           .q = hello.q,
           .X_LB = std::vector<Pose>(links),
           .gripper = !hello.tool.curves.empty()};
  for (int link = 0; link < static_cast<int>(links); ++link) tool_.bodies.push_back(link);
  ToolModel model(hello.tool);
  model.set_configuration(hello.q);
  X_WL_.clear();
  for (int link = 0; link < model.links(); ++link) X_WL_.push_back(model.X_WL(link));
  epsilon_ = hello.epsilon;
  world_changed_ = true;
}

void FollowedSession::take(const protocol::Welcome& welcome) {
  welcome_ = begun_ = welcome;
  rejected_.reset();
  world_changed_ = true;
}

void FollowedSession::take(const protocol::ContactUpdate& update) {
  if (!has_tool() || tool_.description.configuration_size() != update.q_VE.size()) return;
  ToolModel model(tool_.description);
  model.set_configuration(update.q_VE);
  for (int link = 0; link < model.links(); ++link) {
    X_WL_[static_cast<std::size_t>(link)] = model.X_WL(link);
  }
  for (const BodyPose& pose : update.poses) {
    world_changed_ = X_WB_.insert_or_assign(pose.body, pose.X_WB).second || world_changed_;
  }
  reported_ = static_cast<std::size_t>(std::ranges::count(
      update.contacts, SideKind::kToolLink, [](const auto& contact) { return contact.a.kind; }));
}

void FollowedSession::take(protocol::LocalState state) {
  for (protocol::LocalContactReport& contact : state.contacts) {
    if (contact.b.kind != SideKind::kMovableBody) continue;
    const auto place = place_of(contact.b.index);
    contact.b = place ? ContactSide{SideKind::kMovableBody, *place} : ContactSide{};
  }
  telemetry_.observe(state);
}

void FollowedSession::begin_scene() {
  reader_ = protocol::SceneRecordReader();
  coming_.clear();
  coming_geometries_.clear();
}

void FollowedSession::take_scene(std::span<const std::byte> records) {
  reader_.feed(records);
  while (auto record = reader_.next()) {
    if (const auto* const shape = std::get_if<SceneShape>(&*record)) {
      coming_geometries_.insert_or_assign(shape->hash, shape_of(*shape));
    } else if (const auto* const placement = std::get_if<protocol::ScenePlacement>(&*record)) {
      coming_.push_back(*placement);
    }
  }
}

void FollowedSession::end_scene() {
  placements_ = std::exchange(coming_, {});
  geometries_ = std::exchange(coming_geometries_, {});
  X_WB_.clear();
  world_changed_ = true;
}

std::vector<PageShape> FollowedSession::shapes_of(SideKind kind, std::uint32_t index) const {
  std::vector<PageShape> shapes;
  for (const protocol::ScenePlacement& placement : placements_) {
    if (placement.side.kind != kind || placement.side.index != index) continue;
    const auto geometry = geometries_.find(placement.shape);
    if (geometry == geometries_.end()) continue;
    shapes.push_back({geometry->second.geometry, placement.X_BS});
  }
  return shapes;
}

/// For a tool whose shapes are not known: a ball of its size.
std::vector<PageShape> FollowedSession::stand_in() const {
  return {{Sphere{tool_.description.length / 2}, tool_.description.X_LH}};
}

std::optional<std::uint32_t> FollowedSession::place_of(std::uint32_t body) const {
  const auto known = X_WB_.find(body);
  if (known == X_WB_.end()) return std::nullopt;
  const auto before = std::distance(X_WB_.begin(), known);
  return static_cast<std::uint32_t>(X_WL_.size() + 1 + static_cast<std::size_t>(before));
}

PageWorld FollowedSession::world() const {
  PageWorld world{.tool = tool_, .environment = false};
  world.welcome = welcome_ ? &*welcome_ : nullptr;
  for (std::uint32_t link = 0; link < X_WL_.size(); ++link) {
    PageBody body{.is_tool = true, .X_WB = X_WL_[link]};
    body.shapes = shapes_of(SideKind::kToolLink, link);
    const bool in_hand = static_cast<int>(link) == tool_.description.hand_link;
    if (placements_.empty() && in_hand) body.shapes = stand_in();
    world.bodies.push_back(std::move(body));
  }
  world.bodies.push_back({.fixed = true, .shapes = shapes_of(SideKind::kWorld, 0)});
  for (const auto& [number, X_WB] : X_WB_) {
    world.bodies.push_back({.X_WB = X_WB, .shapes = shapes_of(SideKind::kMovableBody, number)});
  }
  return world;
}

PageFrame FollowedSession::frame() {
  PageFrame frame;
  frame.X_WB = X_WL_;
  for (const auto& [number, X_WB] : X_WB_) frame.X_WB.push_back(X_WB);
  frame.connected = status_.connected;
  frame.round_trip = status_.round_trip;
  frame.state = state_ ? &*state_ : nullptr;
  frame.reported = reported_;
  frame.epsilon = epsilon_;
  frame.rejected = std::exchange(rejected_, std::nullopt);
  return frame;
}

}  // namespace hlm::ve
