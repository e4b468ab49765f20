// A child process of a test: its output, its exit, and that it does not outlive the test.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <sys/types.h>

namespace hlm::test {

/// Waits up to `timeout` s until the condition holds; whether it does.
bool wait_until(double timeout, const std::function<bool()>& condition);

class Process {
 public:
  /// Starts a program; its standard output and error go to files of their own.
  explicit Process(const std::vector<std::string>& arguments);
  /// Ends it if it still runs.
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t id() const { return pid_; }
  void send_signal(int signal) const;
  /// Waits up to `timeout` s; the exit code, 128 + the signal that ended it, or -1 if it still
  /// runs.
  int wait(double timeout);
  bool running();
  std::string output() const { return read(output_file_); }
  std::string error() const { return read(error_file_); }
  /// Waits up to `timeout` s until standard error holds `text`.
  bool wait_for_error(const std::string& text, double timeout) const;

 private:
  static std::string read(const std::string& path);

  pid_t pid_ = -1;
  int exit_code_ = -1;
  std::string output_file_;
  std::string error_file_;
};

/// Runs a program to its end.
struct Finished {
  int exit_code;
  std::string output;
  std::string error;
};
Finished run(const std::vector<std::string>& arguments, double timeout = 20);

/// A new empty directory that goes with its owner.
class TemporaryDirectory {
 public:
  TemporaryDirectory();
  ~TemporaryDirectory();
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;

  std::string file(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

/// A UDP port of loopback that was free just now.
int free_port();

}  // namespace hlm::test
