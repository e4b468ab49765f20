// A program that this one starts, and that ends with it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <spawn.h>
#include <sys/types.h>

namespace hlm {

/// The value of an environment variable that is set to something; otherwise null.
const char* variable(const char* name) noexcept;

/// What the variable `named_by` names, or `name` next to this library or in PATH. Throws
/// std::runtime_error that says where it was looked for; `otherwise` ends the sentence on what
/// helps.
std::string find_program(const std::string& name, const char* named_by,
                         const std::string& otherwise = "");

/// No file from `first` on is the program's that is started with these.
void close_from(posix_spawn_file_actions_t& files, int first);

/// Runs until this object ends. A child of the program, which should wait for others by their ids.
class OwnProgram {
 public:
  /// Number of the inherited file in the program.
  static constexpr int kInherited = 3;

  /// arguments: of the program, its file first. inherited: an open file that it gets; below 0:
  /// none. Throws std::runtime_error if it cannot be started.
  explicit OwnProgram(std::vector<std::string> arguments, int inherited = -1);
  /// Asks it to end, and waits for that up to 2 s; then it is killed.
  ~OwnProgram();
  OwnProgram(const OwnProgram&) = delete;
  OwnProgram& operator=(const OwnProgram&) = delete;

  pid_t process() const noexcept { return process_; }
  /// Where the program, or the system for it, has waited for it elsewhere.
  static constexpr int kUnknown = -1;
  /// What it ended with, 128 + the signal that ended it, or kUnknown; empty while it runs.
  std::optional<int> status() noexcept;

 private:
  pid_t process_ = -1;
  std::optional<int> status_;
};

}  // namespace hlm
