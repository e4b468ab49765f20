#include "hlm/tools/doctor/machine.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <thread>

#include <sched.h>
#include <spdlog/fmt/fmt.h>
#include <sys/utsname.h>
#include <sys/xattr.h>
#include <unistd.h>

#include "hlm/haptic_server/loop/cpu_latency.h"
#include "hlm/haptic_server/loop/periodic_loop.h"
#include "hlm/haptic_server/loop/realtime.h"
#include "hlm/haptic_server/report/histogram.h"

namespace hlm::server {
namespace {

constexpr double kMicroseconds = 1e6;

/// The first line; empty if it cannot be read.
std::string line_of(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

std::filesystem::path program_folder() {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
}

/// Whether a program's file grants SCHED_FIFO and locked memory (capabilities(7)).
bool file_grants_rights(const std::filesystem::path& program) {
  constexpr std::uint32_t kSysNice = 1u << 23;
  constexpr std::uint32_t kIpcLock = 1u << 14;
  std::array<std::uint32_t, 6> data{};  // Version and flags, permitted, inheritable, …
  const ssize_t size = getxattr(program.c_str(), "security.capability", data.data(), sizeof data);
  return size >= 12 && (data[1] & kSysNice) != 0 && (data[1] & kIpcLock) != 0;
}

Finding rights(const RealtimeGrant& grant, int priority) {
  const std::filesystem::path server = program_folder() / "haptic_server";
  if (grant.fifo && grant.locked_memory) {
    return {Verdict::kGood, "rights",
            fmt::format("SCHED_FIFO priority {} and locked memory are granted", priority), ""};
  }
  const std::string refused =
      !grant.fifo && !grant.locked_memory
          ? fmt::format("SCHED_FIFO priority {} nor locked memory", priority)
      : grant.fifo ? "locked memory"
                   : fmt::format("SCHED_FIFO priority {}", priority);
  if (file_grants_rights(server)) {
    return {Verdict::kNote, "rights",
            "haptic_doctor gets no " + refused + ", but haptic_server does, by its file",
            fmt::format("to test the loop as it will be: setcap cap_sys_nice,cap_ipc_lock+ep {}",
                        (program_folder() / "haptic_doctor").string())};
  }
  return {Verdict::kProblem, "rights", "the system grants no " + refused,
          fmt::format("run haptic_server as root or as the service, or: setcap "
                      "cap_sys_nice,cap_ipc_lock+ep {}",
                      server.string())};
}

Finding rights_of(const RunningServer& running) {
  const int policy = sched_getscheduler(running.process) & ~SCHED_RESET_ON_FORK;
  if (policy == SCHED_FIFO) {
    return {Verdict::kGood, "rights", "the loop of the running haptic_server has SCHED_FIFO", ""};
  }
  return {Verdict::kProblem, "rights", "the running haptic_server has no real-time rights",
          "its log says what was refused; run it as root or as the service"};
}

Finding kernel() {
  utsname name{};
  uname(&name);
  const std::string version = name.version;
  if (line_of("/sys/kernel/realtime") == "1" || version.find("PREEMPT_RT") != std::string::npos) {
    return {Verdict::kGood, "kernel", std::string(name.release) + ", PREEMPT_RT", ""};
  }
  return {Verdict::kNote, "kernel",
          std::string(name.release) + " is not PREEMPT_RT: now and then a tick is late by more",
          "on Debian: apt install linux-image-rt-amd64"};
}

Finding processors() {
  const unsigned count = std::thread::hardware_concurrency();
  if (count >= 2) return {Verdict::kGood, "processors", std::to_string(count), ""};
  return {Verdict::kWarning, "processors", "one alone: the loop waits for everything else",
          "use a machine with two or more"};
}

Finding governor() {
  std::set<std::string> governors;
  std::error_code error;
  for (std::filesystem::directory_iterator cpu("/sys/devices/system/cpu", error), end;
       !error && cpu != end; cpu.increment(error)) {
    const std::string name = line_of(cpu->path() / "cpufreq/scaling_governor");
    if (!name.empty()) governors.insert(name);
  }
  if (governors.empty()) {
    return {Verdict::kNote, "governor", "this system does not set the processors' frequency", ""};
  }
  if (governors == std::set<std::string>{"performance"}) {
    return {Verdict::kGood, "governor", "performance", ""};
  }
  return {Verdict::kWarning, "governor",
          fmt::format("{}: processors slow down when they have little to do",
                      fmt::join(governors, ", ")),
          "cpupower frequency-set -g performance"};
}

Finding idle_states() {
  double longest = 0;  // µs.
  for (int i = 0;; ++i) {
    const std::string latency =
        line_of(fmt::format("/sys/devices/system/cpu/cpu0/cpuidle/state{}/latency", i));
    if (latency.empty()) break;
    longest = std::max(longest, std::atof(latency.c_str()));
  }
  const std::string sleep = fmt::format("idle processors take up to {} µs to wake", longest);
  if (const std::string refusal = CpuLatencyLimit::find_refusal(); !refusal.empty()) {
    return {longest > 0 ? Verdict::kWarning : Verdict::kNote, "idle states",
            sleep + "; /dev/cpu_dma_latency cannot be written from here",
            "let the group of haptic_server write it, with packaging/60-haptic_server.rules"};
  }
  return {Verdict::kGood, "idle states", sleep + ", and are kept awake while a session runs", ""};
}

Finding clock_source() {
  const std::string source =
      line_of("/sys/devices/system/clocksource/clocksource0/current_clocksource");
  for (const char* slow : {"hpet", "acpi_pm", "jiffies", "refined-jiffies"}) {
    if (source != slow) continue;
    return {Verdict::kWarning, "clock", source + ", which takes about a microsecond to read",
            "see dmesg for why the processor's own clock (tsc) is not used"};
  }
  return {Verdict::kGood, "clock", source.empty() ? "unknown" : source, ""};
}

Finding timers() {
  timespec resolution{};
  clock_getres(CLOCK_MONOTONIC, &resolution);
  if (resolution.tv_sec == 0 && resolution.tv_nsec == 1) {
    return {Verdict::kGood, "timers", "of high resolution", ""};
  }
  return {Verdict::kProblem, "timers",
          fmt::format("they fire every {} ms only", 1e-6 * static_cast<double>(resolution.tv_nsec)),
          "boot without highres=off, or use a kernel with CONFIG_HIGH_RES_TIMERS"};
}

struct LoopTest {
  RealtimeGrant grant;
  Histogram lateness;
  std::uint64_t missed = 0;
};

/// Tests the loop on a thread of its own, as the server's.
LoopTest test_loop(const MachineOptions& options) {
  LoopTest result;
  std::thread([&] {
    result.grant =
        enter_realtime({.policy = RealtimePolicy::kPrefer, .priority = options.priority});
    CpuLatencyLimit latency;
    latency.set(true);
    PeriodicLoop loop({.rate = options.rate});
    loop.run([&](const Timing& timing) noexcept {
      result.lateness.record(timing.lateness);
      result.missed = timing.overruns;
      if (timing.begin >= options.loop_time) loop.stop();
    });
  }).join();
  return result;
}

Finding loop_finding(double rate, double ticks, double missed, double p99, double largest) {
  const std::string text = fmt::format(
      "{:.0f} ticks at {} Hz: 99 % at most {:.1f} µs late, the worst {:.1f} µs, {:.0f} missed",
      ticks, rate, kMicroseconds * p99, kMicroseconds * largest, missed);
  constexpr double kEndured = 1e-3;  // Share of ticks that may be missed.
  if (missed > kEndured * ticks || p99 > 0.5 / rate) {
    return {Verdict::kProblem, "loop", text,
            "give the loop real-time rights and free processors, or take a lower --rate"};
  }
  if (missed > 0 || largest > 0.5 / rate) {
    return {Verdict::kWarning, "loop", text, "end what else runs here, or use a PREEMPT_RT kernel"};
  }
  return {Verdict::kGood, "loop", text, ""};
}

}  // namespace

Examination examine_machine(const MachineOptions& options,
                            const std::optional<RunningServer>& running) {
  Examination examination{"Can this machine keep the rate?", {}};
  std::vector<Finding>& findings = examination.findings;
  if (running && running->session) {
    findings = {rights_of(*running), loop_finding(running->rate, running->ticks, running->missed,
                                                  running->lateness_p99, running->lateness_max)};
    findings.back().text += " in the last second of the running haptic_server";
  } else {
    const LoopTest test = test_loop(options);
    findings = {rights(test.grant, options.priority),
                loop_finding(options.rate, static_cast<double>(test.lateness.count()),
                             static_cast<double>(test.missed), test.lateness.quantile(0.99),
                             test.lateness.max())};
  }
  for (const auto& examine : {kernel, processors, governor, idle_states, clock_source, timers}) {
    findings.push_back(examine());
  }
  return examination;
}

}  // namespace hlm::server
