#include "hlm/client/own_program.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <thread>

#include <dlfcn.h>
#include <fcntl.h>
#include <link.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace hlm {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kPatience{2};  // Longest wait for its end.
constexpr std::chrono::milliseconds kLook{2};

bool is_program(const fs::path& file) {
  std::error_code error;
  return fs::is_regular_file(file, error) && access(file.c_str(), X_OK) == 0;
}

/// In bin/ next to the folder of the library or program that this code is in, or one above.
std::vector<fs::path> places_beside(const std::string& name) {
  Dl_info here{};
  link_map* map = nullptr;
  if (dladdr1(reinterpret_cast<const void*>(&places_beside), &here, reinterpret_cast<void**>(&map),
              RTLD_DL_LINKMAP) == 0) {
    return {};
  }
  std::error_code error;
  const bool is_program = *map->l_name == '\0';
  const fs::path file = fs::canonical(is_program ? "/proc/self/exe" : map->l_name, error);
  if (error) return {};
  const fs::path above = file.parent_path().parent_path();
  return {above / "bin" / name, above.parent_path() / "bin" / name};
}

std::vector<fs::path> places_in_path(const std::string& name) {
  const char* const value = variable("PATH");
  const std::string path = value == nullptr ? "" : value;
  std::vector<fs::path> places;
  for (std::size_t begin = 0; begin < path.size();) {
    const std::size_t end = std::min(path.find(':', begin), path.size());
    places.push_back(fs::path(path.substr(begin, end - begin)) / name);
    begin = end + 1;
  }
  return places;
}

/// Without what systemd asks of the program that it started.
std::vector<char*> environment() {
  std::vector<char*> kept;
  for (char** each = environ; each != nullptr && *each != nullptr; ++each) {
    const std::string_view text(*each);
    if (!text.starts_with("NOTIFY_SOCKET=") && !text.starts_with("WATCHDOG_"))
      kept.push_back(*each);
  }
  kept.push_back(nullptr);
  return kept;
}

/// Starts it in its own session, so that Ctrl-C is for the program, which may go on; it has nothing
/// of the program's but its standard error, and `inherited` as file OwnProgram::kInherited.
pid_t start(std::vector<std::string>& arguments, int inherited) {
  std::vector<char*> words;
  words.reserve(arguments.size() + 1);
  for (std::string& argument : arguments) words.push_back(argument.data());
  words.push_back(nullptr);
  sigset_t none;
  sigset_t all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_t how;
  posix_spawnattr_init(&how);
  posix_spawnattr_setsigmask(&how, &none);
  posix_spawnattr_setsigdefault(&how, &all);
  posix_spawnattr_setflags(&how,
                           POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  if (inherited >= 0) posix_spawn_file_actions_adddup2(&files, inherited, OwnProgram::kInherited);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  if (fcntl(STDERR_FILENO, F_GETFD) < 0) {
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  }
  close_from(files, inherited >= 0 ? OwnProgram::kInherited + 1 : OwnProgram::kInherited);
  pid_t process = -1;
  const int error =
      posix_spawn(&process, words[0], &files, &how, words.data(), environment().data());
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&how);
  if (error == 0) return process;
  throw std::runtime_error(arguments[0] +
                           " cannot be started: " + std::generic_category().message(error));
}

}  // namespace

void close_from(posix_spawn_file_actions_t& files, int first) {
#if __GLIBC_PREREQ(2, 34)
  posix_spawn_file_actions_addclosefrom_np(&files, first);
#else
  for (const fs::directory_entry& entry : fs::directory_iterator("/proc/self/fd")) {
    const int file = std::stoi(entry.path().filename());
    if (file >= first) posix_spawn_file_actions_addclose(&files, file);
  }
#endif
}

const char* variable(const char* name) noexcept {
  const char* const value = std::getenv(name);
  return value == nullptr || *value == '\0' ? nullptr : value;
}

std::string find_program(const std::string& name, const char* named_by,
                         const std::string& otherwise) {
  std::vector<fs::path> places;
  std::string searched;
  const auto look_in = [&](const std::vector<fs::path>& more) {
    places.insert(places.end(), more.begin(), more.end());
  };
  if (const char* const named = variable(named_by)) {
    look_in({named});
    searched = named;
  } else {
    look_in(places_beside(name));
    for (const fs::path& place : places) searched += place.string() + ", ";
    searched += "PATH";
    look_in(places_in_path(name));
  }
  const auto found = std::ranges::find_if(places, is_program);
  if (found != places.end()) return found->string();
  throw std::runtime_error("there is no " + name + " to start: looked for " + searched +
                           ". Install it, set " + named_by + " to its file" + otherwise);
}

OwnProgram::OwnProgram(std::vector<std::string> arguments, int inherited)
    : process_(start(arguments, inherited)) {}

OwnProgram::~OwnProgram() {
  if (status()) return;
  // A program that gave up its rights since may not end it, and must not wait for it.
  if (kill(process_, SIGTERM) != 0) return;
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!status()) {
    if (std::chrono::steady_clock::now() > end) kill(process_, SIGKILL);
    std::this_thread::sleep_for(kLook);
  }
}

std::optional<int> OwnProgram::status() noexcept {
  if (status_) return status_;
  int how = 0;
  const pid_t ended = waitpid(process_, &how, WNOHANG);
  if (ended == process_) {
    status_ = WIFSIGNALED(how) ? 128 + WTERMSIG(how) : WEXITSTATUS(how);
  } else if (ended < 0 && errno == ECHILD) {
    status_ = kUnknown;
  }
  return status_;
}

}  // namespace hlm
