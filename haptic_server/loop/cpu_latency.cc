#include "hlm/haptic_server/loop/cpu_latency.h"

#include <cerrno>
#include <cstdint>
#include <system_error>

#include <fcntl.h>
#include <spdlog/fmt/fmt.h>
#include <unistd.h>

namespace hlm::server {
namespace {

constexpr const char* kFile = "/dev/cpu_dma_latency";

/// The kernel's file, which limits nothing until it is written; -1 where that is refused.
int open_file() noexcept { return open(kFile, O_WRONLY | O_CLOEXEC); }

}  // namespace

std::string CpuLatencyLimit::find_refusal() {
  const int file = open_file();
  if (file >= 0) {
    close(file);
    return {};
  }
  return fmt::format(
      "wake-ups are later than they need be, as idle processors may sleep: the system refuses {} "
      "({}); run as root, or let a group write it with the udev rule "
      "'KERNEL==\"cpu_dma_latency\", GROUP=\"realtime\", MODE=\"0660\"'",
      kFile, std::generic_category().message(errno));
}

void CpuLatencyLimit::set(bool wanted) noexcept {
  if (wanted == wanted_) return;
  wanted_ = wanted;
  if (file_ >= 0) close(file_);
  file_ = -1;
  if (!wanted) return;
  const std::int32_t limit = 0;  // µs.
  file_ = open_file();
  if (file_ >= 0 && write(file_, &limit, sizeof limit) != sizeof limit) {
    close(file_);
    file_ = -1;
  }
}

}  // namespace hlm::server
