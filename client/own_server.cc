#include "hlm/client/own_server.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

#include <dlfcn.h>
#include <fcntl.h>
#include <link.h>
#include <netinet/in.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "hlm/transport/udp_socket.h"

namespace hlm {
namespace {

namespace fs = std::filesystem;

constexpr const char* kName = "haptic_server";
constexpr const char* kVariable = "HAPTIC_SERVER_PROGRAM";
constexpr std::chrono::seconds kPatience{2};  // Longest wait for its end.
constexpr std::chrono::milliseconds kLook{2};

/// A UDP port of this machine, until it is closed.
class Port {
 public:
  explicit Port(const protocol::Endpoint& at) noexcept
      : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    if (at.port != 0) {
      const int others_may_ask = 1;
      setsockopt(socket_, SOL_SOCKET, SO_REUSEADDR, &others_may_ask, sizeof others_may_ask);
    }
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(at.address);
    address.sin_port = htons(at.port);
    bound_ = bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  }
  ~Port() {
    if (socket_ >= 0) close(socket_);
  }
  Port(const Port&) = delete;
  Port& operator=(const Port&) = delete;

  bool bound() const noexcept { return bound_; }
  protocol::Endpoint endpoint() const noexcept {
    sockaddr_in address{};
    socklen_t size = sizeof address;
    getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size);
    return {ntohl(address.sin_addr.s_addr), ntohs(address.sin_port)};
  }

 private:
  int socket_;
  bool bound_ = false;
};

bool is_program(const fs::path& file) {
  std::error_code error;
  return fs::is_regular_file(file, error) && access(file.c_str(), X_OK) == 0;
}

/// The value of a variable that is set to something; otherwise null.
const char* variable(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr || *value == '\0' ? nullptr : value;
}

/// bin/ next to the folder of the library or program that this code is in, or one above.
std::vector<fs::path> places_beside() {
  Dl_info here{};
  link_map* map = nullptr;
  if (dladdr1(reinterpret_cast<const void*>(&usual_server), &here, reinterpret_cast<void**>(&map),
              RTLD_DL_LINKMAP) == 0) {
    return {};
  }
  std::error_code error;
  const bool is_program = *map->l_name == '\0';
  const fs::path file = fs::canonical(is_program ? "/proc/self/exe" : map->l_name, error);
  if (error) return {};
  const fs::path above = file.parent_path().parent_path();
  return {above / "bin" / kName, above.parent_path() / "bin" / kName};
}

std::vector<fs::path> places_in_path() {
  const char* const value = variable("PATH");
  const std::string path = value == nullptr ? "" : value;
  std::vector<fs::path> places;
  for (std::size_t begin = 0; begin < path.size();) {
    const std::size_t end = std::min(path.find(':', begin), path.size());
    places.push_back(fs::path(path.substr(begin, end - begin)) / kName);
    begin = end + 1;
  }
  return places;
}

std::string find_program() {
  std::vector<fs::path> places;
  std::string searched;
  const auto look_in = [&](const std::vector<fs::path>& more) {
    places.insert(places.end(), more.begin(), more.end());
  };
  if (const char* const named = variable(kVariable)) {
    look_in({named});
    searched = named;
  } else {
    look_in(places_beside());
    for (const fs::path& place : places) searched += place.string() + ", ";
    searched += "PATH";
    look_in(places_in_path());
  }
  const auto found = std::ranges::find_if(places, is_program);
  if (found != places.end()) return found->string();
  throw std::runtime_error(std::string("there is no ") + kName + " to start: looked for " +
                           searched + ". Install it, set " + kVariable +
                           " to its file, or name a server that runs");
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
/// of the program's but its standard error.
pid_t start(std::vector<std::string> arguments) {
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
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  if (fcntl(STDERR_FILENO, F_GETFD) < 0) {
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  }
  posix_spawn_file_actions_addclosefrom_np(&files, STDERR_FILENO + 1);
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

std::string usual_server() {
  const char* const named = variable("HAPTIC_SERVER");
  return named != nullptr ? named : "127.0.0.1:47800";
}

bool may_listen(const protocol::Endpoint& server) noexcept { return !Port(server).bound(); }

OwnServer::OwnServer(const OwnServerOptions& options) : program_(find_program()) {
  std::vector<std::string> arguments;
  {
    const Port free({INADDR_LOOPBACK, 0});
    if (!free.bound()) throw std::runtime_error("no port is free for a server");
    endpoint_ = free.endpoint();
    arguments = {program_,
                 "--listen",
                 to_string(endpoint_),
                 "--parent",
                 std::to_string(getpid()),
                 "--device",
                 "simulated",
                 "--device-option",
                 "friction=0",
                 "--device-option",
                 options.planar ? "freedom=planar" : "freedom=spatial",
                 "--status",
                 "false",
                 "--log-level",
                 "error"};
    if (!options.key_file.empty()) {
      arguments.insert(arguments.end(), {"--key-file", options.key_file});
    }
  }
  process_ = start(std::move(arguments));
}

OwnServer::~OwnServer() {
  if (status()) return;
  kill(process_, SIGTERM);
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!status()) {
    if (std::chrono::steady_clock::now() > end) kill(process_, SIGKILL);
    std::this_thread::sleep_for(kLook);
  }
}

std::optional<int> OwnServer::status() noexcept {
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
