#include "hlm/ve_client/scene/in_child.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <exception>
#include <stdexcept>

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace hlm::ve {
namespace {

/// Processor time after which it is taken for endless, s. A million triangles take less than one.
constexpr rlim_t kLongest = 20;

/// What is passed on begins with one of these.
constexpr char kMade = 'm';
constexpr char kFailed = 'f';

bool write_all(int file, const std::string& text) {
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t count = ::write(file, text.data() + done, text.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    done += static_cast<std::size_t>(count);
  }
  return true;
}

std::string read_all(int file) {
  std::string text;
  std::array<char, 65536> buffer{};
  while (true) {
    const ssize_t count = ::read(file, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return text;
    text.append(buffer.data(), static_cast<std::size_t>(count));
  }
}

[[noreturn]] void run_child(int out, const std::function<std::string()>& make) {
  // It goes with its parent, as quietly as the system lets it.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) {
    std::signal(signal, SIG_DFL);
  }
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  const rlimit time{kLongest, kLongest};
  ::setrlimit(RLIMIT_CPU, &time);
  std::string answer;
  try {
    answer = kMade + make();
  } catch (const std::exception& error) {
    answer = kFailed + std::string(error.what());
  }
  ::_exit(write_all(out, answer) ? 0 : 1);
}

std::string how_it_ended(int status) {
  const int signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  const bool long_run = signal == SIGXCPU || signal == SIGKILL;
  return long_run ? "takes the library that reads it too long, or too much memory"
                  : "crashes the library that reads it";
}

}  // namespace

std::string made_in_child(const std::function<std::string()>& make) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) return make();
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(ends[0]);
    run_child(ends[1], make);
  }
  ::close(ends[1]);
  if (child < 0) {
    ::close(ends[0]);
    return make();
  }
  std::string answer = read_all(ends[0]);
  ::close(ends[0]);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) continue;
  const bool ended = WIFEXITED(status) && WEXITSTATUS(status) == 0;
  if (!ended || answer.empty()) throw std::runtime_error(how_it_ended(status));
  const bool made = answer.front() == kMade;
  answer.erase(0, 1);
  if (!made) throw std::runtime_error(answer);
  return answer;
}

}  // namespace hlm::ve
