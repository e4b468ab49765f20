// What the fuzz targets share. A target gives one input to a part of the product that takes input
// from outside, and aborts where the part breaks a promise. libFuzzer calls it (scripts/fuzz), or
// replay.cc, with the corpus and a fixed number of mutations (scripts/test).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <stdexcept>
#include <string>

#include <sys/mman.h>
#include <unistd.h>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace hlm::fuzz {

/// Inputs that were good enough to be used, not only refused. A corpus without any shows nothing.
inline std::uint64_t accepted = 0;

/// Ends the program: a claim does not hold.
[[noreturn]] inline void end_at(const char* claim) {
  std::fprintf(stderr, "broken promise: %s\n", claim);
  std::abort();
}
/// What a broken promise does; a test that is not a fuzz target may throw instead.
inline void (*on_broken_promise)(const char* claim) = end_at;

/// Whatever a broken promise does, unless the claim holds.
inline void demand(bool holds, const char* claim) {
  if (!holds) on_broken_promise(claim);
}

/// Whether an error is what a person gets to read: one line, which names the file.
inline bool is_one_line_about(const std::string& file, const std::string& error) {
  return error.find('\n') == std::string::npos && error.find(file) != std::string::npos;
}

/// Reads an input from its begin; zeros follow its end.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : rest_(data, size) {}

  bool empty() const { return rest_.empty(); }
  std::uint8_t u8() { return take(1).empty() ? std::uint8_t{0} : taken_[0]; }
  std::uint16_t u16() {
    const unsigned low = u8();
    return static_cast<std::uint16_t>(low | static_cast<unsigned>(u8()) << 8);
  }
  /// As many as there are, `size` at most.
  std::span<const std::uint8_t> take(std::size_t size) {
    taken_ = rest_.first(std::min(size, rest_.size()));
    rest_ = rest_.subspan(taken_.size());
    return taken_;
  }

 private:
  std::span<const std::uint8_t> rest_;
  std::span<const std::uint8_t> taken_;
};

/// A file of these bytes that takes no place on a disk.
class MemoryFile {
 public:
  explicit MemoryFile(std::span<const std::uint8_t> bytes) : descriptor_(memfd_create("input", 0)) {
    const auto size = static_cast<ssize_t>(bytes.size());
    if (descriptor_ < 0 || write(descriptor_, bytes.data(), bytes.size()) != size) std::abort();
    path_ = "/proc/self/fd/" + std::to_string(descriptor_);
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  ~MemoryFile() { close(descriptor_); }

  const std::string& path() const { return path_; }

 private:
  int descriptor_;
  std::string path_;
};

/// One input of a target that reads files: each reader gets the path of one.
template <class... Readers>
int give_file(const std::uint8_t* data, std::size_t size, Readers... read) {
  const MemoryFile file({data, size});
  (read(file.path()), ...);
  return 0;
}

}  // namespace hlm::fuzz
