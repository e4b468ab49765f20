#include "haptic_server/options.h"

#include <fstream>
#include <iterator>
#include <sstream>

#include "haptic_server/device/hand_script.h"
#include "haptic_server/device/replay_device.h"

namespace hlm::server {
namespace {

/// An option that takes one of an enumeration's names.
template <class Enum>
void add_choice(CLI::App& app, const std::string& option, Enum& value, const std::string& help) {
  std::string names;
  for (const Word<Enum>& word : kWords<Enum>) {
    names += (names.empty() ? "" : ", ") + std::string(word.name);
  }
  const auto set = [&value](const std::string& name) { value = *value_of<Enum>(name); };
  const auto check = [names](const std::string& name) {
    return value_of<Enum>(name) ? std::string() : name + " must be one of " + names;
  };
  app.add_option_function<std::string>(option, set, help + ": " + names)
      ->check(CLI::Validator(check, "", option))
      ->default_str(std::string(name_of(value)))
      ->run_callback_for_default(false)
      ->type_name("WORD");
}

void add_number(CLI::App& app, const std::string& name, double& value, const std::string& help) {
  std::ostringstream text;
  text.precision(17);
  text << value;
  app.add_option(name, value, help)->default_str(text.str());
}

void add_contact_options(CLI::App& app, LocalModelParameters& p) {
  add_choice(app, "--update-rule", p.update_rule, "How contacts carry over an update");
  add_choice(app, "--collision-rule", p.collision_rule, "How simultaneous collisions are resolved");
  add_choice(app, "--contact-step", p.contact_step, "How contact forces are integrated");
  add_number(app, "--stiffness", p.stiffness, "Stiffness of each contact, N/m");
  add_number(app, "--damping", p.damping, "Damping of each contact, N·s/m");
  add_number(app, "--restitution", p.restitution,
             "Coefficient of restitution of the proxy, 0 to 1; without a proxy (direct coupling "
             "and the rivals) nothing collides but the device itself");
  add_number(app, "--static-friction", p.static_friction, "Coefficient of static friction");
  add_number(app, "--kinetic-friction", p.kinetic_friction, "Coefficient of kinetic friction");
  add_number(app, "--release-step", p.release_step,
             "Largest step of a contact's force while retained load is released, N");
  app.add_option("--recovery-steps", p.recovery_steps,
                 "Steps over which rule plane_recovery ramps a contact to its reported place")
      ->capture_default_str();
  add_number(app, "--max-hand-stiffness", p.max_hand_stiffness,
             "Largest stiffness of all contacts together at the hand, N/m");
  add_number(app, "--max-hand-angular-stiffness", p.max_hand_angular_stiffness,
             "Largest angular stiffness of all contacts together at the hand, N·m/rad");
  add_number(app, "--max-contact-frequency", p.max_contact_frequency,
             "Largest natural frequency of the proxy on its contacts, rad/s");
}

void add_control_options(CLI::App& app, ServoOptions& o) {
  add_number(app, "--rate", o.rate, "Rate of local model and device control, Hz, 100 to 8000");
  add_choice(app, "--controller", o.controller,
             "Controller between device and proxy, or a rival to compare with");
  add_number(app, "--coupling-stiffness", o.gains.stiffness, "K_c, translation, N/m");
  add_number(app, "--coupling-damping", o.gains.damping, "B_c, translation, N·s/m");
  add_number(app, "--coupling-angular-stiffness", o.gains.angular_stiffness,
             "K_c, rotation, N·m/rad");
  add_number(app, "--coupling-angular-damping", o.gains.angular_damping,
             "B_c, rotation, N·m·s/rad");
  add_number(app, "--force-limit", o.limits.max_force, "Largest force on the device, N");
  add_number(app, "--torque-limit", o.limits.max_torque, "Largest torque on the device, N·m");
  add_number(app, "--fade-time", o.limits.fade_time, "From full force to none and back, s");
  add_number(app, "--silence-time", o.silence_time,
             "Force fades when the client has been silent for this long, s");
  add_number(app, "--max-gap", o.max_gap, "A longer gap between two ticks is a fault, s");
}

void add_device_options(CLI::App& app, PhysicsOptions& options) {
  SimulatedDeviceOptions& d = options.simulated;
  add_choice(app, "--device", options.device, "Haptic device");
  add_choice(app, "--device-freedom", d.freedom, "How the simulated device moves");
  app.add_option("--hand", options.hand, "Hand script of the simulated device, a TOML file");
  app.add_option("--device-log", options.device_log, "Tick log that the replay device plays, CSV");
  add_number(app, "--device-mass", d.mass, "Simulated device: mass, kg");
  add_number(app, "--device-inertia", d.inertia, "Simulated device: inertia, kg·m²");
  add_number(app, "--device-damping", d.damping, "Simulated device: damping, N·s/m");
  add_number(app, "--device-angular-damping", d.angular_damping,
             "Simulated device: angular damping, N·m·s/rad");
  add_number(app, "--device-friction", d.dry_friction, "Simulated device: dry friction, N");
  add_number(app, "--device-friction-torque", d.dry_friction_torque,
             "Simulated device: dry friction torque, N·m");
  add_number(app, "--device-max-force", d.max_force, "Simulated device: rated force, N");
  add_number(app, "--device-max-torque", d.max_torque, "Simulated device: rated torque, N·m");
  add_number(app, "--device-max-force-rate", d.max_force_rate,
             "Simulated device: rated change of force, N/s");
  add_number(app, "--device-max-torque-rate", d.max_torque_rate,
             "Simulated device: rated change of torque, N·m/s");
  add_number(app, "--device-max-stiffness", d.max_stiffness,
             "Simulated device: rated stiffness, N/m");
  add_number(app, "--device-max-angular-stiffness", d.max_angular_stiffness,
             "Simulated device: rated angular stiffness, N·m/rad");
  add_number(app, "--device-position-step", d.position_step,
             "Simulated device: encoder step, m; 0: exact");
  add_number(app, "--device-angle-step", d.angle_step,
             "Simulated device: encoder step, rad; 0: exact");
  add_number(app, "--device-velocity-cutoff", d.velocity_cutoff,
             "Simulated device: cut-off of the velocity filter, Hz");
  app.add_option("--device-delay", d.delay, "Simulated device: delay of a command, ticks")
      ->capture_default_str();
  app.add_option("--device-measures-hand", d.measures_hand_wrench,
                 "Simulated device: whether it measures the hand's wrench")
      ->default_str(d.measures_hand_wrench ? "true" : "false");
}

std::string file_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

void add_options(CLI::App& app, PhysicsOptions& options) {
  add_contact_options(app, options.servo.local_model);
  add_control_options(app, options.servo);
  add_device_options(app, options);
}

void add_options(CLI::App& app, ServerOptions& options) {
  app.add_option("--listen", options.listen, "Where to wait for the client, ADDRESS:PORT")
      ->capture_default_str();
  add_choice(app, "--realtime", options.realtime.policy, "What happens without real-time rights");
  app.add_option("--priority", options.realtime.priority, "SCHED_FIFO priority, 1 to 99")
      ->capture_default_str();
  add_number(app, "--final-spin", options.loop.final_spin,
             "Last part of each wait that is spent spinning, s");
  app.add_option("--record", options.record, "Write all datagrams to this capture file (pcap)");
  app.add_option("--log", options.log, "Write every tick's signals to this file (CSV)");
  add_number(app, "--duration", options.duration, "End after this long, s; 0: until stopped");
  app.add_option("--log-level", options.log_level, "trace, debug, info, warn, error or off")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"}))
      ->capture_default_str();
  app.add_option("--status", options.status, "Whether to show the live status line")
      ->default_str(options.status ? "true" : "false");
  add_options(app, options.physics);
}

void add_configuration_file(CLI::App& app, bool& print_config) {
  app.set_config("--config", "", "File with any of these options, as printed by --print-config");
  app.allow_config_extras(CLI::config_extras_mode::error);
  app.add_flag("--print-config", print_config, "Print the effective configuration and end")
      ->configurable(false);
}

std::optional<std::string> find_error(const PhysicsOptions& options) {
  if (auto error = find_error(PeriodicLoopOptions{.rate = options.servo.rate})) return error;
  if (auto error = find_error(options.servo)) return error;
  if (options.device == DeviceKind::kReplay && options.device_log.empty()) {
    return "--device replay needs --device-log FILE";
  }
  return find_error(options.simulated);
}

std::optional<std::string> find_error(const ServerOptions& options) {
  if (auto error = find_error(options.physics)) return error;
  PeriodicLoopOptions loop = options.loop;
  loop.rate = options.physics.servo.rate;
  if (auto error = find_error(loop)) return error;
  if (!(options.duration >= 0)) {
    return "duration " + std::to_string(options.duration) + " must be >= 0 s";
  }
  return find_error(options.realtime);
}

std::uint64_t fingerprint(const PhysicsOptions& options) {
  // An application bound to the present values prints them as its defaults. Where a file lies does
  // not matter, what it says does.
  PhysicsOptions copy = options;
  copy.hand.clear();
  copy.device_log.clear();
  copy.device = DeviceKind::kSimulated;
  CLI::App app;
  add_options(app, copy);
  const std::string text = app.config_to_str(true, false) + file_text(options.hand);

  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return hash;
}

std::unique_ptr<Device> make_device(const PhysicsOptions& options) {
  const double dt = 1 / options.servo.rate;
  HandScript hand;
  if (!options.hand.empty()) hand = read_hand_script(options.hand);
  auto simulated = std::make_unique<SimulatedDevice>(options.simulated, std::move(hand), dt);
  if (options.device == DeviceKind::kSimulated) return simulated;
  return std::make_unique<ReplayDevice>(read_recorded_steps(options.device_log),
                                        simulated->ratings());
}

}  // namespace hlm::server
