#include "experiments/body_trial.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <span>
#include <stdexcept>

#include "experiments/over.h"
#include "hlm/common/uniform.h"
#include "hlm/protocol/codec.h"
#include "hlm/protocol/layout.h"
#include "tests/support/virtual_session.h"

namespace hlm::experiments {
namespace {

int index_of(const ve::WorldDescription& world, const std::string& name) {
  for (std::size_t i = 0; i < world.bodies.size(); ++i) {
    if (world.bodies[i].name == name) return static_cast<int>(i);
  }
  throw std::runtime_error("there is no body '" + name + "'");
}

test::VirtualSessionOptions session_options(const BodyTask& task, const BodyConditions& conditions,
                                            std::uint64_t seed) {
  test::VirtualSessionOptions options;
  options.world = task.world;
  options.tool = task.tool;
  options.hand = task.hand;
  options.device.freedom = server::DeviceFreedom::kSpatial;
  options.device.max_force = 100;  // N: what is heavy shall be felt whole.
  options.device.max_torque = 5;
  use_device(conditions.device, options.device);
  options.link = {.delay = conditions.delay, .loss = conditions.loss};
  options.rate_low = options.rate_high = conditions.ve_rate;
  options.seed = seed;
  options.servo.limits.max_force = 100;
  options.servo.limits.max_torque = 5;
  options.servo.silence_time = 2;
  options.servo.local_model.stiffness = conditions.stiffness;
  options.frame.epsilon = conditions.epsilon;
  options.frame.push_by_following = conditions.by_following;
  options.frame.shapes = conditions.shapes;
  options.server_holds = conditions.server_holds;
  if (conditions.method) {
    use(*conditions.method, conditions.stiffness, options.servo.local_model.damping, options);
  }
  return options;
}

/// Changes a message, if the bytes are one of its kind or a part of it, and leaves its size.
template <class Message, class Change>
void alter(std::span<std::byte> bytes, const Change& change) {
  protocol::Header header;
  Message message;
  if (protocol::decode_header(bytes, header) || header.type != protocol::kTypeOf<Message> ||
      protocol::decode_part(bytes, message)) {
    return;
  }
  change(message);
  const auto altered = protocol::encode(header.envelope, message, header.part);
  std::copy(altered.begin(), altered.end(), bytes.begin());
}

/// The client says what the conditions have.
void mislead(protocol::MemoryNetwork& network, const BodyConditions& conditions) {
  if (conditions.friction_scale == 1) return;
  network.set_alteration([&conditions](std::span<std::byte> bytes) {
    alter<protocol::ContactUpdate>(bytes, [&](protocol::ContactUpdate& update) {
      for (ReportedContact& contact : update.contacts) {
        contact.friction *= conditions.friction_scale;
      }
    });
  });
}

}  // namespace

Inputs inputs_of(const BodyConditions& c) {
  Inputs inputs{{"ve_rate_Hz", c.ve_rate}, {"delay_s", c.delay}, {"stiffness", c.stiffness}};
  if (c.method) {
    inputs.insert(inputs.begin(), {"method", c.method->name});
  } else {
    inputs.emplace_back("contacts", c.shapes ? "shapes" : "planes");
  }
  const BodyConditions usual;
  if (c.loss != usual.loss) inputs.emplace_back("loss", c.loss);
  if (c.epsilon != usual.epsilon) inputs.emplace_back("epsilon_m", c.epsilon);
  if (c.friction_scale != usual.friction_scale) {
    inputs.emplace_back("friction_scale", c.friction_scale);
  }
  if (c.stalls.longest > 0) inputs.emplace_back("longest_stall_s", c.stalls.longest);
  return inputs;
}

std::vector<BodySample> run(const BodyTask& task, const BodyConditions& conditions,
                            std::uint64_t seed) {
  const int body = index_of(task.world, task.body);
  std::vector<BodySample> samples;
  test::VirtualSession* running = nullptr;
  const test::VirtualSessionOptions options = session_options(task, conditions, seed);
  std::mt19937_64 random(seed);
  test::VirtualSession session(options, [&](const server::TickRecord& record) {
    if (record.step == 0) return;
    cut(conditions.outage, record, options.link, *running);
    const Stalls& stalls = conditions.stalls;
    if (stalls.longest > 0 && uniform(random, 0, 1) < 1e-3 / stalls.every) {
      const double stall = uniform(random, stalls.shortest, stalls.longest);
      running->server(0).stall(static_cast<std::uint64_t>(std::round(1e3 * stall)));
    }
    BodySample& sample = samples.emplace_back();
    sample.time = static_cast<double>(record.step) * 1e-3;
    sample.F_env = felt(conditions.method, record);
    sample.F_command = record.F_command;
    sample.X_WP = record.X_WP;
    sample.V_WP = record.V_WP;
    sample.adopted = record.adopted > 0;
    sample.colliding = record.contact_state == ProxyContactState::kColliding;
    sample.limited = record.limit != ForceLimit::kNone;
    const auto& model = running->servo().local_model();
    sample.bodies = model ? model->bodies().size() : 0;
    const ve::World& world = running->environment().world;
    sample.X_WB = world.X_WB(body);
    sample.V_WB = world.V_WB(body);
  });
  running = &session;
  mislead(session.network(), conditions);
  session.run(task.duration + 0.3 + 4 * conditions.delay);
  return samples;
}

ForceStatistics force_along(const std::vector<BodySample>& samples, const Vector3& axis,
                            double begin, double end) {
  ForceStatistics result;
  double sum = 0;
  double squares = 0;
  int count = 0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const BodySample& sample = samples[i];
    if (sample.time < begin || sample.time > end) continue;
    const double f = axis.dot(sample.F_env.head<3>());
    const Vector3 change = sample.F_env.head<3>() - samples[i - 1].F_env.head<3>();
    sum += f;
    squares += f * f;
    result.least = count == 0 ? f : std::min(result.least, f);
    result.most = count == 0 ? f : std::max(result.most, f);
    ++count;
    result.largest = std::max(result.largest, sample.F_env.head<3>().norm());
    result.step = std::max(result.step, change.norm());
    result.collisions += sample.colliding;
    result.limited += sample.limited;
    if (sample.adopted && !sample.colliding) {
      result.update_step = std::max(result.update_step, change.norm());
    }
  }
  // A session that ended meanwhile shows nothing.
  const bool whole = !samples.empty() && samples.back().time >= end;
  result.mean = whole ? sum / count : std::numeric_limits<double>::quiet_NaN();
  result.deviation = std::sqrt(std::max(0.0, squares / count - result.mean * result.mean));
  return result;
}

}  // namespace hlm::experiments
