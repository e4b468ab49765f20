#include "hlm/haptic_server/device/amplifier.h"

#include <cerrno>
#include <new>
#include <stdexcept>
#include <system_error>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

namespace hlm::server {
namespace {

void* shared_memory(const std::string& file) {
  constexpr int kAccess = PROT_READ | PROT_WRITE;
  constexpr std::size_t kSize = sizeof(Amplifier::Memory);
  if (file.empty()) return mmap(nullptr, kSize, kAccess, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  const int descriptor = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (descriptor < 0) return MAP_FAILED;
  void* memory = MAP_FAILED;
  if (ftruncate(descriptor, kSize) == 0) {
    memory = mmap(nullptr, kSize, kAccess, MAP_SHARED, descriptor, 0);
  }
  const int error = errno;
  close(descriptor);
  errno = error;
  return memory;
}

}  // namespace

Amplifier::Amplifier(const std::string& file) {
  void* const memory = shared_memory(file);
  if (memory == MAP_FAILED) {
    throw std::runtime_error((file.empty() ? "shared memory" : file) +
                             " cannot be mapped: " + std::generic_category().message(errno));
  }
  memory_.reset(new (memory) Memory);
}

void Amplifier::Unmap::operator()(Memory* memory) const noexcept { munmap(memory, sizeof(Memory)); }

Wrench Amplifier::give(const Wrench& F) noexcept {
  const Wrench given = memory_->halted != 0 ? Wrench::Zero() : F;
  for (std::size_t i = 0; i < 6; ++i) memory_->F[i] = given[static_cast<Eigen::Index>(i)];
  ++memory_->commands;
  return given;
}

void Amplifier::halt() noexcept {
  memory_->halted = 1;
  for (std::atomic<double>& F : memory_->F) F = 0;
}

}  // namespace hlm::server
