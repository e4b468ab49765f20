// A program that this one starts and that ends with it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <spawn.h>
#include <sys/types.h>

namespace hlm {

/// The value of an environment variable; null if it is unset or empty.
const char* variable(const char* name) noexcept;

/// What the variable `named_by` names, or `name` next to this library or in PATH. Throws
/// std::runtime_error that says where it was looked for; `otherwise` ends the sentence on what
/// helps.
std::string find_program(const std::string& name, const char* named_by,
                         const std::string& otherwise = "");

/// A program started with these inherits no file from `first` on.
void close_from(posix_spawn_file_actions_t& files, int first);

/// Runs until this object ends. It is a child of this process, which should wait for other children
/// by their ids.
class OwnProgram {
 public:
  /// Number of the inherited file in the started program.
  static constexpr int kInherited = 3;

  /// arguments: those of the program, its file first. inherited: an open file that it inherits;
  /// below 0: none. Throws std::runtime_error if it cannot be started.
  explicit OwnProgram(std::vector<std::string> arguments, int inherited = -1);
  /// Asks it to end, waits up to 2 s, then kills it.
  ~OwnProgram();
  OwnProgram(const OwnProgram&) = delete;
  OwnProgram& operator=(const OwnProgram&) = delete;

  pid_t process() const noexcept { return process_; }
  /// Status of a program for which another part of this process, or the system, has waited.
  static constexpr int kUnknown = -1;
  /// Its exit status, 128 + the signal that ended it, or kUnknown; empty while it runs.
  std::optional<int> status() noexcept;

 private:
  pid_t process_ = -1;
  std::optional<int> status_;
};

}  // namespace hlm
