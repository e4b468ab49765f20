#include "haptic.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <pthread.h>

#include "hlm/client/contact_check.h"
#include "hlm/client/haptic_client.h"
#include "hlm/client/haptic_contact.h"
#include "hlm/client/haptic_shape.h"
#include "hlm/client/identity_tracker.h"
#include "hlm/client/own_server.h"
#include "hlm/client/session_news.h"
#include "hlm/client/surroundings.h"
#include "hlm/common/range.h"
#include "hlm/protocol/scene_offer.h"
#include "hlm/protocol/sealing/key_file.h"
#include "hlm/protocol/sealing/sealed_client_link.h"
#include "hlm/protocol/transport/udp_socket.h"
#include "hlm/protocol/wire.h"

static_assert(HAPTIC_MAX_DOF == hlm::kMaxDof && HAPTIC_MAX_CONFIGURATION == hlm::kMaxConfiguration);
static_assert(HAPTIC_MAX_CONTACTS == hlm::kMaxContacts && HAPTIC_MAX_BODIES == hlm::kMaxBodies);
static_assert(HAPTIC_MAX_POSES == hlm::kMaxPoses);
static_assert(HAPTIC_MESH == static_cast<int>(hlm::protocol::SceneShapeKind::kMesh));
static_assert(HAPTIC_SERVER_RAMPING == static_cast<int>(hlm::ServerState::kRamping));
static_assert(HAPTIC_SERVER_FAULT == static_cast<int>(hlm::ServerState::kFault));
static_assert(HAPTIC_MAX_TEXT > hlm::protocol::kMaxText);

namespace {

using namespace hlm;
using protocol::SealedClientLink;

/// In options that haptic_default_options() has made: any number that memory does not hold by
/// chance.
constexpr std::uint32_t kMadeOfDefaults = 0x48617031;

constexpr Range kDuration{0, 1e6, "s", true};  // Of a step, or of a frame's steps.
constexpr Range kEpsilon{0, 1, "m"};           // More are millimetres.
constexpr Range kPlace{-protocol::kLargestLength, protocol::kLargestLength, "m"};

/// How often the program was forked until it was this one.
std::atomic<int> forks{0};
[[maybe_unused]] const int watches_forks = pthread_atfork(nullptr, nullptr, [] { ++forks; });

template <class Error>
void refuse(const std::optional<Error>& error) {
  if (error) throw std::invalid_argument(std::string(*error));
}

void require(const void* given, const char* name) {
  if (given == nullptr) throw std::invalid_argument(std::string(name) + " must not be NULL");
}

/// A list that there is and that has at most so many.
void require_list(const void* given, std::size_t count, std::size_t most, const char* name) {
  require_at_most(most, count, name);
  if (count > 0 && given == nullptr) {
    throw std::invalid_argument(std::to_string(count) + " " + name + " must not be NULL");
  }
}

void require_unit(const char* name, double length) {
  if (std::abs(length - 1) <= kUnitTolerance) return;
  throw std::invalid_argument(std::string(name) + " must be of length 1, not " +
                              shortest_text(length));
}

void require_finite(const char* name, const double* values, Eigen::Index count) {
  for (Eigen::Index i = 0; i < count; ++i) {
    if (std::isfinite(values[i])) continue;
    throw std::invalid_argument(std::string(name) + "[" + std::to_string(i) + "] " +
                                shortest_text(values[i]) + " must be finite");
  }
}

void copy(std::string_view text, char* to, std::size_t size) {
  if (size == 0) return;
  const std::size_t length = std::min(text.size(), size - 1);
  std::copy_n(text.data(), length, to);
  to[length] = '\0';
}

Vector3 vector_of(const double (&v)[3]) { return {v[0], v[1], v[2]}; }
Vector6 vector_of(const double (&v)[6]) { return Eigen::Map<const Vector6>(v); }

template <std::size_t size, class Vector>
void store(const Vector& from, double (&to)[size]) {
  std::copy_n(from.data(), std::min<std::size_t>(size, static_cast<std::size_t>(from.size())), to);
}

Link link_of(const haptic_link& from) {
  Link link;
  link.parent = from.parent;
  link.joint = static_cast<JointType>(from.joint);
  link.X_PJ = pose_of(from.position, from.rotation);
  link.axis = vector_of(from.axis);
  link.mass = from.mass;
  link.p_LCom = vector_of(from.centre);
  link.I_LCom = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(from.inertia);
  link.lower = from.lower;
  link.upper = from.upper;
  return link;
}

/// A link of a tool, as an index that an error can name.
std::uint8_t link_index(std::int32_t link, const char* of) {
  const auto most = static_cast<std::int32_t>(kMaxLinks) - 1;
  if (link >= 0 && link <= most) return static_cast<std::uint8_t>(link);
  throw std::invalid_argument("link " + std::to_string(link) + " of " + of + " must be 0 to " +
                              std::to_string(most));
}

JointCurve curve_of(const haptic_curve& from) {
  JointCurve curve;
  curve.link = link_index(from.link, "a curve");
  curve.leader = link_index(from.leader, "a curve's leader");
  curve.armature = from.armature;
  curve.terms = Eigen::Map<const Eigen::Matrix<double, 7, kCurveTerms>>(&from.terms[0][0]);
  return curve;
}

JointDrive drive_of(const haptic_drive& from) {
  return {.link = link_index(from.link, "a drive"),
          .follows_device = from.follows_device != 0,
          .target = from.target,
          .closed = from.closed,
          .open = from.open,
          .stiffness = from.stiffness,
          .damping = from.damping,
          .most = from.most};
}

ToolDescription tool_of(const haptic_options& options) {
  if (options.link_count < 1 || options.link_count > kMaxLinks) {
    throw std::invalid_argument("link_count " + std::to_string(options.link_count) +
                                " must be 1 to " + std::to_string(kMaxLinks));
  }
  require(options.links, "links");
  ToolDescription tool;
  for (std::size_t i = 0; i < options.link_count; ++i) {
    const haptic_link& link = options.links[i];
    if (link.joint < HAPTIC_FIXED || link.joint > HAPTIC_FOLLOWING) {
      throw std::invalid_argument("link " + std::to_string(i) + ": joint " +
                                  std::to_string(link.joint) + " must be 0 to 6");
    }
    tool.links.push_back(link_of(link));
  }
  require_list(options.curves, options.curve_count, kMaxLinks, "curves");
  for (std::size_t i = 0; i < options.curve_count; ++i) {
    tool.curves.push_back(curve_of(options.curves[i]));
  }
  tool.hand_link = options.hand_link;
  tool.X_LH = pose_of(options.hand_position, options.hand_rotation);
  tool.gravity_W = vector_of(options.gravity);
  tool.length = options.length;
  refuse(find_error(tool));
  return tool;
}

HapticClientOptions client_options(const haptic_options& options,
                                   const protocol::Endpoint& server) {
  HapticClientOptions client;
  client.server = server;
  client.tool = tool_of(options);
  client.q = Eigen::Map<const Configuration>(options.q, client.tool.configuration_size());
  client.ve_rate = options.rate;
  client.epsilon = options.epsilon;
  refuse(find_error("epsilon", options.epsilon, kEpsilon));
  client.clears_fault = options.clears_fault != 0;
  return client;
}

MovableBody body_of(const haptic_body& from) {
  MovableBody body;
  body.id = from.id;
  body.p_WCom = vector_of(from.centre);
  body.V_W = vector_of(from.velocity);
  body.W = Eigen::Map<const Matrix6>(from.inverse_inertia);
  body.A_W = vector_of(from.acceleration);
  body.roundness = static_cast<Roundness>(from.round);
  body.axis_W = vector_of(from.axis);
  return body;
}

/// What `most` holds of a list.
template <class Items, class From, class Make>
Items items_of(const From* from, std::size_t count, Make make) {
  Items items;
  for (std::size_t i = 0; i < count && items.size() < items.capacity(); ++i) {
    items.push_back(make(from[i]));
  }
  return items;
}

ReportedContacts contacts_of(const haptic_contact* from, std::size_t count) {
  return items_of<ReportedContacts>(from, count, contact_of);
}
MovableBodies bodies_of(const haptic_body* from, std::size_t count) {
  return items_of<MovableBodies>(from, count, body_of);
}

constexpr haptic_material kNoMaterial{.friction = -1, .rule = HAPTIC_MINIMUM, .priority = 0};

/// Throws what is wrong with where the body is said to be.
BodyPose body_pose_of(const haptic_body_pose& from) {
  BodyPose made{.body = from.body, .X_WB = pose_of(from.pose), .V_W = vector_of(from.velocity)};
  if (!made.X_WB.p.allFinite() || !made.V_W.allFinite()) {
    throw std::invalid_argument("a number is not finite");
  }
  require_unit("its rotation", made.X_WB.R.norm());
  made.X_WB.R.normalize();
  made.kept = from.kept != 0;
  return made;
}

/// bodies: those that have shapes. Throws what is wrong with it; the rest the scene says.
BodyInertia inertia_of(const haptic_dynamics& from, const std::set<std::uint32_t>& bodies) {
  const std::string name = "dynamics of body " + std::to_string(from.body) + ": ";
  if (!bodies.contains(from.body)) {
    throw std::invalid_argument(name + "a shape of it must be offered, too");
  }
  if (from.joint != HAPTIC_FREE && from.joint != HAPTIC_REVOLUTE &&
      from.joint != HAPTIC_PRISMATIC) {
    throw std::invalid_argument(name + "joint " + std::to_string(from.joint) +
                                " must be 1 (revolute), 2 (prismatic) or 4 (free)");
  }
  BodyInertia made{.body = from.body,
                   .mass = from.mass,
                   .p_BCom = vector_of(from.centre),
                   .gravity_W = vector_of(from.gravity),
                   .damping = from.damping,
                   .angular_damping = from.angular_damping};
  made.I_BCom = Eigen::Map<const Matrix3>(from.inertia);
  if (!made.I_BCom.isApprox(made.I_BCom.transpose(), 1e-6)) {
    throw std::invalid_argument(name + "its inertia must be symmetric");
  }
  return made;
}

BodyJoint joint_of(const haptic_dynamics& from) {
  return {.body = from.body,
          .parent = from.parent,
          .type = static_cast<JointType>(from.joint),
          .X_PJ = pose_of(from.in_parent),
          .X_BJ = pose_of(from.in_body),
          .axis = vector_of(from.axis),
          .lower = from.lower,
          .upper = from.upper,
          .stiffness = from.stiffness,
          .reference = from.reference,
          .damping = from.joint_damping,
          .friction = from.friction,
          .armature = from.armature};
}

/// bodies: those that have shapes.
void add_dynamics(std::size_t index, const haptic_dynamics& from,
                  const std::set<std::uint32_t>& bodies, protocol::SceneOffer& offer) {
  const BodyInertia inertia = inertia_of(from, bodies);
  if (std::ranges::find(offer.inertias, inertia.body, &BodyInertia::body) != offer.inertias.end()) {
    throw std::invalid_argument("dynamics " + std::to_string(index) + ": body " +
                                std::to_string(inertia.body) + " has earlier ones, too");
  }
  offer.inertias.push_back(inertia);
  if (from.joint != HAPTIC_FREE) offer.joints.push_back(joint_of(from));
}

/// There is no session, and no force.
void set_off(haptic_state& state) {
  state.server = HAPTIC_SERVER_OFF;
  state.active = state.predicted = 0;
  state.grip = 0;
  std::fill_n(state.command, 6, 0.0);
  std::fill_n(state.contact_wrench, 6, 0.0);
}

void store(const Pose& from, haptic_pose& to) {
  store(from.p, to.position);
  const Eigen::Vector4d wxyz(from.R.w(), from.R.x(), from.R.y(), from.R.z());
  store(wxyz, to.rotation);
}

void store(const protocol::ProxyState& proxy, haptic_state& state) {
  state.step = proxy.step;
  state.acknowledged = proxy.acknowledged;
  state.q_count = static_cast<std::int32_t>(proxy.q.size());
  state.v_count = static_cast<std::int32_t>(proxy.v.size());
  store(proxy.q, state.q);
  store(proxy.v, state.v);
  store(proxy.F_env, state.contact_wrench);
  store(proxy.F_command, state.command);
  store(proxy.X_WD.p, state.device_position);
  const Quaternion& R = proxy.X_WD.R;
  store(Eigen::Vector4d(R.w(), R.x(), R.y(), R.z()), state.device_rotation);
  state.server = static_cast<std::int32_t>(proxy.server);
  state.active = proxy.active_contacts;
  state.predicted = proxy.predicted_contacts;
  state.buttons = proxy.buttons;
  state.gripper = proxy.gripper;
  state.grip = proxy.grip;
}

/// A sentence on the end of a session's own server.
std::string end_of(int status) {
  std::string ended = "the server that this session started has ended";
  if (status != OwnProgram::kUnknown) ended += ", with status " + std::to_string(status);
  if (status == 0) ended += ": it was stopped, or the thread that opened the session ended";
  if (status == 1 || status == 2) ended += ": its reason, if it gave one, is on standard error";
  return ended;
}

}  // namespace

struct haptic_session {
  explicit haptic_session(const haptic_options& options)
      : surroundings(surroundings_at(options.server == nullptr ? usual_server() : options.server,
                                     1 / options.rate)),
        client_options_(client_options(options, surroundings->server())),
        tool(client_options_.tool) {
    std::optional<protocol::noise::Key> key;
    if (options.key_file != nullptr) key = protocol::read_key(options.key_file);
    if (options.server == nullptr && !surroundings->may_have_server()) start_own(options);
    if (key) sealed.emplace(surroundings->link(), client_options_.server, *key);
    client.emplace(sealed ? static_cast<protocol::DatagramLink&>(*sealed) : surroundings->link(),
                   client_options_);
    news.emplace(own ? to_string(client_options_.server) : surroundings->name(),
                 options.key_file == nullptr ? "" : options.key_file);
    tool.set_configuration(client_options_.q);
    update.q_VE = client_options_.q;
    update.v_VE = Velocity::Zero(tool.dof());
  }

  void start_own(const haptic_options& options) {
    const std::string nobody = "no server listens at " + to_string(client_options_.server);
    try {
      own.emplace(
          OwnServerOptions{.planar = client_options_.tool.links[0].joint == JointType::kPlanar,
                           .key_file = options.key_file == nullptr ? "" : options.key_file});
    } catch (const std::runtime_error& failure) {
      throw std::runtime_error(nobody + ", and " + failure.what());
    }
    client_options_.server = own->endpoint();
    started = nobody + ": started " + own->program() + " at " + to_string(own->endpoint()) +
              " with a simulated device, until this session ends or: kill " +
              std::to_string(own->process());
  }

  /// What is to be said to a person.
  std::string message() const {
    if (own && !client->connected()) {
      if (const auto status = own->status()) return end_of(*status);
    }
    return news->text();
  }

  /// Whether this is what a fork copied: the session goes on in the process that opened it.
  bool is_copy() const { return process != forks.load(std::memory_order_relaxed); }

  int process = forks;    ///< Of which it is.
  std::atomic_flag busy;  ///< While a thread is in a call.
  std::unique_ptr<Surroundings> surroundings;
  HapticClientOptions client_options_;
  ToolModel tool;                        ///< Tool at the latest sample.
  protocol::ContactUpdate update;        ///< Update of the latest sample, to be checked.
  mutable std::optional<OwnServer> own;  ///< It is asked whether it has ended.
  std::string started;                   ///< What was; empty if nothing was.
  std::optional<SealedClientLink> sealed;
  std::optional<HapticClient> client;
  IdentityTracker tracker;
  std::set<std::uint32_t> sent;          ///< Bodies that were reported to the server.
  BodyPoses poses;                       ///< Where bodies are, for the next update.
  std::set<std::uint32_t> offered;       ///< Bodies that have shapes at the server,
  std::set<std::uint32_t> once_offered;  ///< or had once.
  std::optional<SessionNews> news;
  std::string error;     ///< Of the latest call that failed.
  bool sampled = false;  ///< There is a configuration that contacts are of.
};

namespace {

/// The session that another thread was in when this one called it, until a call fails otherwise.
thread_local const haptic_session* found_busy = nullptr;

/// What `call` returns; or `refusal`, with haptic_error(), if it throws or the session cannot be
/// used here.
template <class Result, class Call>
Result in_session(haptic_session* session, Result refusal, Call call) noexcept {
  if (session == nullptr || session->is_copy()) return refusal;
  if (session->busy.test_and_set(std::memory_order_acquire)) {
    found_busy = session;
    return refusal;
  }
  Result result = refusal;
  try {
    result = call();
  } catch (const std::exception& failure) {
    session->error = failure.what();
    found_busy = nullptr;
  }
  session->busy.clear(std::memory_order_release);
  return result;
}

}  // namespace

int haptic_abi(void) { return HAPTIC_ABI; }

haptic_link haptic_box(double mass, const double size[3]) {
  haptic_link link{};
  link.parent = -1;
  link.joint = HAPTIC_FREE;
  link.rotation[0] = 1;
  link.axis[2] = 1;
  link.mass = mass;
  for (int i = 0; i < 3 && size != nullptr; ++i) {
    const double b = size[(i + 1) % 3];
    const double c = size[(i + 2) % 3];
    link.inertia[4 * i] = mass * (b * b + c * c) / 12;
  }
  link.lower = -kNoLimit;
  link.upper = kNoLimit;
  return link;
}

haptic_options haptic_default_options(void) {
  constexpr double kEdge = 0.1;  // m
  static const double size[3] = {kEdge, kEdge, kEdge};
  static const haptic_link link = haptic_box(1, size);
  haptic_options options{};
  options.links = &link;
  options.link_count = 1;
  options.hand_rotation[0] = 1;
  options.length = kEdge;
  options.q[3] = 1;
  options.rate = 60;
  options.epsilon = 0.005;
  options.clears_fault = 1;
  options.made_of_defaults = kMadeOfDefaults;
  return options;
}

haptic_session* haptic_open(const haptic_options* options, char* error, std::size_t error_size) {
  try {
    require(options, "options");
    if (options->made_of_defaults != kMadeOfDefaults) {
      throw std::invalid_argument(
          "options must be begun with haptic_default_options(): what is in them otherwise is "
          "chance");
    }
    return new haptic_session(*options);
  } catch (const std::exception& failure) {
    if (error != nullptr) copy(failure.what(), error, error_size);
    return nullptr;
  }
}

void haptic_close(haptic_session* session) {
  if (session == nullptr) return;
  if (!session->is_copy()) {
    while (session->busy.test_and_set(std::memory_order_acquire)) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    session->client->close(session->surroundings->now());
  } else if (session->busy.test_and_set()) {
    return;  // It was copied amid a call of a thread that is not here.
  }
  delete session;
}

namespace {

void take_news(haptic_session& session, haptic_state& state) {
  HapticClient& client = *session.client;
  const double now = session.surroundings->begin_frame();
  const HapticClient::Inbox inbox = client.poll(now);
  state.connected = client.connected();
  state.began = inbox.welcomed;
  state.lost = inbox.lost;
  state.fresh = inbox.state != nullptr;
  state.round_trip = client.round_trip();
  state.servo_rate = client.connected() ? client.welcome().servo_rate : 0;
  state.scene = client.has_scene() ? 1 : 0;
  state.holds = client.holds() ? 1 : 0;
  session.news->hear(now, client, inbox);
  copy(session.message(), state.message, HAPTIC_MAX_TEXT);
  if (!state.connected) set_off(state);
  if (inbox.state != nullptr) store(*inbox.state, state);
}

}  // namespace

void haptic_poll(haptic_session* session, haptic_state* state) {
  const bool polled = in_session(session, false, [&] {
    require(state, "state");
    take_news(*session, *state);
    return true;
  });
  if (polled || state == nullptr) return;
  *state = {};
  copy(haptic_error(session), state->message, HAPTIC_MAX_TEXT);
}

double haptic_now(const haptic_session* session) {
  return session == nullptr || session->is_copy() ? 0 : session->surroundings->now();
}

std::uint64_t haptic_session_id(const haptic_session* session) {
  return session == nullptr || session->is_copy() ? 0 : session->client->session_id();
}

int haptic_take_steps(haptic_session* session, double step) {
  return in_session(session, -1, [&] {
    refuse(find_error("step", step, kDuration));
    return session->client->take_steps(step);
  });
}

int haptic_tool_pushes(haptic_session* session) {
  return in_session(session, 1, [&] { return session->client->tool_pushes() ? 1 : 0; });
}

std::size_t haptic_take_held(haptic_session* session, haptic_held_body* bodies) {
  return in_session(session, std::size_t{0}, [&] {
    require(bodies, "bodies");
    std::size_t count = 0;
    for (const HeldPlace& held : session->client->take_held()) {
      // Whatever a server says, it can move no body that was not offered to it.
      const auto& known = is_held(held.number) ? session->offered : session->once_offered;
      if (!known.contains(held.body) || count == HAPTIC_MAX_POSES) continue;
      haptic_held_body& to = bodies[count++];
      to.body = held.body;
      to.let_go = is_held(held.number) ? 0 : 1;
      store(held.X_WB, to.pose);
      store(held.V_W, to.velocity);
      to.q = held.joint.q;
      to.v = held.joint.v;
    }
    return count;
  });
}

std::size_t haptic_take_impulses(haptic_session* session, double period, haptic_impulse* impulses) {
  return in_session(session, std::size_t{0}, [&] {
    refuse(find_error("period", period, kDuration));
    require(impulses, "impulses");
    std::size_t count = 0;
    for (const protocol::BodyImpulse& due : session->client->take_impulses(period)) {
      // Whatever a server says, it can push no body that was not reported to it.
      if (!session->sent.contains(due.body)) continue;
      impulses[count] = {.body = due.body, .reserved = 0, .impulse = {}};
      store(due.P_W, impulses[count].impulse);
      ++count;
    }
    return count;
  });
}

int haptic_sample(haptic_session* session, const double* q, const double* v, double period) {
  return in_session(session, -1, [&] {
    const ToolDescription& tool = session->tool.description();
    require(q, "q");
    require(v, "v");
    require_finite("q", q, tool.configuration_size());
    require_finite("v", v, tool.dof());
    refuse(find_error("period", period, kDuration));
    Configuration configuration = Eigen::Map<const Configuration>(q, tool.configuration_size());
    const Velocity velocity = Eigen::Map<const Velocity>(v, tool.dof());
    if (tool.links[0].joint == JointType::kFree) {
      auto rotation = configuration.segment<4>(3);
      require_unit("q: its quaternion", rotation.norm());
      rotation.normalize();
    }
    session->tool.set_configuration(configuration);
    session->update.q_VE = configuration;
    session->update.v_VE = velocity;
    session->client->sample(session->surroundings->now(), configuration, velocity, period);
    session->sampled = true;
    return 0;
  });
}

void haptic_track(haptic_session* session, haptic_contact* contacts, std::size_t count,
                  const haptic_body* bodies, std::size_t body_count) {
  in_session(session, false, [&] {
    require_list(contacts, std::min(count, kMaxContacts), kMaxContacts, "contacts");
    require_list(bodies, body_count, kMaxBodies, "bodies");
    ReportedContacts reported = contacts_of(contacts, count);
    session->tracker.assign(session->tool, bodies_of(bodies, body_count), reported);
    for (std::size_t i = 0; i < reported.size(); ++i) contacts[i].identity = reported[i].identity;
    return true;
  });
}

namespace {

/// Throws what a list of bodies says in no known way, or leaves out.
void check(const haptic_session& session, const haptic_body& body) {
  if (body.round >= kWords<Roundness>.size()) {
    throw std::invalid_argument("body " + std::to_string(body.id) + ": round " +
                                std::to_string(body.round) + " must be 0, 1 or 2");
  }
  const bool is_placed =
      std::ranges::find(session.poses, body.id, &BodyPose::body) != session.poses.end();
  if (!is_placed && session.offered.contains(body.id)) {
    throw std::invalid_argument("body " + std::to_string(body.id) + " must have a pose, too");
  }
}

void check_planes(const haptic_contact* contacts, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    if (contacts[i].plane < kWords<PlaneOwner>.size()) continue;
    throw std::invalid_argument("contact " + std::to_string(i) + ": plane " +
                                std::to_string(contacts[i].plane) + " must be 0 or 1");
  }
}

}  // namespace

std::int64_t haptic_send(haptic_session* session, const haptic_contact* contacts, std::size_t count,
                         const haptic_body* bodies, std::size_t body_count) {
  return in_session(session, std::int64_t{-1}, [&] {
    require_list(contacts, count, kMaxContacts, "contacts");
    require_list(bodies, body_count, kMaxBodies, "bodies");
    check_planes(contacts, count);
    for (std::size_t i = 0; i < body_count; ++i) check(*session, bodies[i]);
    protocol::ContactUpdate& update = session->update;
    update.contacts = contacts_of(contacts, count);
    update.bodies = bodies_of(bodies, body_count);
    refuse(find_error(update, session->tool));
    if (!session->sampled) {
      throw std::logic_error(
          "before the first send there must be a sample: the tool's q and v, for "
          "which contacts are found");
    }
    for (const MovableBody& body : update.bodies) session->sent.insert(body.id);
    session->client->follow_accelerations(update.bodies);
    const std::uint64_t sequence = session->client->send(
        session->surroundings->now(), update.contacts, update.bodies, session->poses);
    session->poses.clear();
    return static_cast<std::int64_t>(sequence);
  });
}

int haptic_external_wrench(haptic_session* session, std::int32_t link, const double wrench[6]) {
  return in_session(session, -1, [&] {
    const int links = session->tool.links();
    if (link < 0 || link >= links) {
      throw std::invalid_argument("link " + std::to_string(link) +
                                  " of an external wrench must be 0 to " +
                                  std::to_string(links - 1));
    }
    require(wrench, "wrench");
    const auto index = static_cast<std::uint8_t>(link);
    const Wrench F_W = Eigen::Map<const Wrench>(wrench);
    const Wrench sum = session->client->external(index) + F_W;
    const Range range{-protocol::kLargestForce, protocol::kLargestForce, "N or N·m"};
    for (const double x : sum) refuse(find_error("external wrench", x, range));
    session->client->add_external(index, F_W);
    return 0;
  });
}

int haptic_drive_joints(haptic_session* session, const haptic_drive* drives, std::size_t count) {
  return in_session(session, -1, [&] {
    require_list(drives, count, kMaxDof, "drives");
    JointDrives wanted;
    for (std::size_t i = 0; i < count; ++i) wanted.push_back(drive_of(drives[i]));
    refuse(find_error(wanted, session->tool.description()));
    session->client->drive(wanted);
    return 0;
  });
}

int haptic_offer(haptic_session* session, const haptic_shape* shapes, const haptic_pose* poses,
                 const haptic_material* materials, std::size_t count, const std::uint32_t* excluded,
                 std::size_t excluded_count, const haptic_dynamics* dynamics,
                 std::size_t dynamics_count) {
  return in_session(session, -1, [&] {
    constexpr protocol::SceneLimits kLimits;
    require_list(shapes, count, kLimits.placements, "shapes");
    require_list(poses, count, count, "poses of shapes");
    require_list(excluded, excluded_count, kLimits.apart, "excluded pairs");
    require_list(dynamics, dynamics_count, kLimits.placements, "dynamics of bodies");
    protocol::SceneOffer offer;
    for (std::size_t i = 0; i < count; ++i) {
      const haptic_material material = materials == nullptr ? kNoMaterial : materials[i];
      offer.shapes.push_back(offered_shape(i, shapes[i], poses[i], material));
    }
    for (std::size_t i = 0; i < excluded_count; ++i) {
      offer.apart.emplace_back(excluded[2 * i], excluded[2 * i + 1]);
    }
    std::set<std::uint32_t> bodies;
    bool has_tool = false;
    for (const protocol::OfferedShape& shape : offer.shapes) {
      if (shape.side.kind == SideKind::kMovableBody) bodies.insert(shape.side.index);
      has_tool = has_tool || shape.side.kind == SideKind::kToolLink;
    }
    if (!has_tool) throw std::invalid_argument("a shape must be of the tool, or nothing is felt");
    for (std::size_t i = 0; i < dynamics_count; ++i) add_dynamics(i, dynamics[i], bodies, offer);
    session->client->offer_scene(std::move(offer));
    session->once_offered.insert(bodies.begin(), bodies.end());
    session->offered = std::move(bodies);
    return 0;
  });
}

namespace {

void add(const haptic_session& session, const BodyPose& pose, BodyPoses& poses) {
  if (!session.offered.contains(pose.body)) {
    throw std::invalid_argument("no shape of it was offered");
  }
  if (std::ranges::find(poses, pose.body, &BodyPose::body) != poses.end()) {
    throw std::invalid_argument("it has an earlier one, too");
  }
  poses.push_back(pose);
}

}  // namespace

int haptic_place(haptic_session* session, const haptic_body_pose* bodies, std::size_t count) {
  return in_session(session, -1, [&] {
    require_list(bodies, count, kMaxPoses, "poses");
    BodyPoses poses;
    for (std::size_t i = 0; i < count; ++i) {
      try {
        add(*session, body_pose_of(bodies[i]), poses);
      } catch (const std::invalid_argument& error) {
        throw std::invalid_argument("pose of body " + std::to_string(bodies[i].body) + ": " +
                                    error.what());
      }
    }
    session->poses = poses;
    return 0;
  });
}

int haptic_hold(haptic_session* session, const double position[3], const double rotation[4]) {
  return in_session(session, -1, [&] {
    require(position, "position of the hand");
    require(rotation, "rotation of the hand");
    protocol::Control control;
    control.holds = true;
    control.X_WTarget.p = Eigen::Map<const Vector3>(position);
    control.X_WTarget.R = Quaternion(rotation[0], rotation[1], rotation[2], rotation[3]);
    for (const double x : control.X_WTarget.p) {
      refuse(find_error("position of the hand", x, kPlace));
    }
    require_unit("rotation of the hand", control.X_WTarget.R.norm());
    control.X_WTarget.R.normalize();
    session->client->control(control);
    return 0;
  });
}

void haptic_release(haptic_session* session) {
  in_session(session, false, [&] {
    session->client->control({});
    return true;
  });
}

const char* haptic_show(haptic_session* session, std::uint16_t port, int open) {
  return in_session(session, static_cast<const char*>(nullptr), [&] {
    // An address with a token is not for the list of processes, where a browser's arguments are.
    const bool sealed = session->sealed.has_value();
    return session->client->show({.port = port, .open = open != 0 && !sealed, .token = sealed})
        .c_str();
  });
}

const char* haptic_own_server(const haptic_session* session) {
  return session == nullptr ? "" : session->started.c_str();
}

const char* haptic_error(const haptic_session* session) {
  if (session == nullptr) return "session must not be NULL";
  if (session->is_copy()) return "the session is of the process that was forked: open another here";
  if (found_busy == session) return "another thread is in a call of the session: one at a time";
  return session->error.c_str();
}
