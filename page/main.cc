// haptic_page: serves the page of a session of another program, which starts this one and tells it
// what the session does (client/session_page.h).
#include <cerrno>
#include <csignal>
#include <exception>
#include <iostream>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "hlm/client/own_program.h"
#include "hlm/common/steady_seconds.h"
#include "hlm/page/followed_session.h"
#include "hlm/page/live_page.h"
#include "hlm/page/page_root.h"
#include "hlm/page/web/page_token.h"

namespace hlm::ve {
namespace {

using page_wire::Kind;

constexpr double kFrame = 1.0 / 60;  // s
constexpr double kRepeat = 0.1;      // s: the session lets go of a hand that is not held again

struct Options {
  int session = -1;
  pid_t parent = 0;
  std::uint16_t port = 0;
  bool open = false;
  bool token = false;
};

/// Whether there was room for it.
bool send(int session, const page_wire::Packet& packet) {
  return ::send(session, packet.data(), packet.size(), MSG_DONTWAIT | MSG_NOSIGNAL) >= 0;
}

void say(int session, Kind kind, const std::string& text) {
  send(session, page_wire::packet(kind, std::as_bytes(std::span(text))));
}

/// What the desktop opens addresses with, where it has something.
void open_in_browser(std::string address) {
  std::string program = "xdg-open";
  char* words[] = {program.data(), address.data(), nullptr};
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  close_from(files, STDERR_FILENO + 1);
  pid_t process = -1;
  posix_spawnp(&process, program.c_str(), &files, nullptr, words, environ);
  posix_spawn_file_actions_destroy(&files);
}

class Viewer {
 public:
  explicit Viewer(const Options& options)
      : session_(options.session),
        token_(options.token ? PageToken::random() : ""),
        page_({.port = options.port,
               .root = page_beside_program(),
               .token = token_,
               .own_user_only = token_.empty()}),
        followed_(page_) {}

  std::string address() const {
    const std::string query = token_.empty() ? "" : "?token=" + token_;
    return "http://127.0.0.1:" + std::to_string(page_.port()) + "/" + query;
  }

  /// Until the session's program has ended.
  void run() {
    double next = steady_seconds();
    while (take_packets(next)) {
      if (!followed_.has_tool()) continue;
      if (followed_.world_changed()) page_.show_world(followed_.world());
      take_requests();
      show();
    }
  }

 private:
  /// Those that come until then, s; it is moved on by a frame. False: there are no more.
  bool take_packets(double& until) {
    std::vector<std::byte> packet(page_wire::kMost);
    for (;;) {
      const double left = until - steady_seconds();
      pollfd waiting{.fd = session_, .events = POLLIN, .revents = 0};
      const int came = poll(&waiting, 1, left > 0 ? static_cast<int>(1000 * left) + 1 : 0);
      if (came < 0 && errno != EINTR) return false;
      if (came <= 0 && left <= 0) break;
      if (came <= 0) continue;
      const ssize_t size = recv(session_, packet.data(), packet.size(), 0);
      if (size <= 0) return false;
      followed_.take(std::span(packet).first(static_cast<std::size_t>(size)));
      if (left < -kFrame) break;  // Pages are shown something, however much comes.
    }
    until = std::max(until, steady_seconds() - kFrame) + kFrame;
    return true;
  }

  void take_requests() {
    if (const auto welcome = followed_.take_welcome()) {
      page_.forget_session();
      // What no page has changed is as the server was started.
      settings_.tuning = carried_over(settings_.tuning, own_, welcome->tuning);
      own_ = welcome->tuning;
    }
    LiveSettings at_start;
    at_start.tuning = own_;
    page_.take_requests(steady_seconds(), settings_, at_start);
    const protocol::Control control = page_.control(settings_, own_);
    const double now = steady_seconds();
    if (control == told_ && now - told_at_ < kRepeat) return;
    if (!send(session_, page_wire::packet(control, {.session = 1, .sequence = ++sent_}))) return;
    told_ = control;
    told_at_ = now;
  }

  void show() {
    PageFrame frame = followed_.frame();
    if (!frame.connected && connected_) page_.forget_session();
    connected_ = frame.connected;
    frame.settings = settings_;
    page_.show_frame(std::move(frame));
  }

  int session_;
  std::string token_;
  LivePage page_;
  FollowedSession followed_;
  LiveSettings settings_;
  Tuning own_;  ///< What the server was started with.
  protocol::Control told_;
  double told_at_ = 0;  ///< s
  std::uint64_t sent_ = 0;
  bool connected_ = false;
};

bool is_socket(int file) {
  int type = 0;
  socklen_t size = sizeof type;
  return getsockopt(file, SOL_SOCKET, SO_TYPE, &type, &size) == 0;
}

int serve(const Options& options) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  std::signal(SIGCHLD, SIG_IGN);  // Nobody waits for the browser.
  if (options.parent != 0 && getppid() != options.parent) return EXIT_FAILURE;  // It has ended.
  try {
    Viewer viewer(options);
    say(options.session, Kind::kAddress, viewer.address());
    if (options.open) open_in_browser(viewer.address());
    viewer.run();
    return EXIT_SUCCESS;
  } catch (const std::exception& failure) {
    say(options.session, Kind::kTrouble, failure.what());
    return EXIT_FAILURE;
  }
}

}  // namespace
}  // namespace hlm::ve

int main(int argc, char** argv) {
  hlm::ve::Options options;
  CLI::App app(
      "Serves the page of a session. The client library starts it: haptic_show() in C, "
      "Session.show() in Python.",
      "haptic_page");
  app.add_option("--session", options.session,
                 "Open socket over which the session tells what it does")
      ->required();
  app.add_option("--parent", options.parent, "Process of the session: it ends with that");
  app.add_option("--port", options.port, "Of 127.0.0.1; 0: any free one");
  app.add_flag("--open", options.open, "Show the page in a browser");
  app.add_flag("--token", options.token,
               "Ask whoever opens the page for a token, which its address has");
  app.set_version_flag("--version", "haptic_page " HLM_VERSION);
  CLI11_PARSE(app, argc, argv);
  if (!hlm::ve::is_socket(options.session)) {
    std::cerr << "haptic_page: --session " << options.session
              << " must be an open socket: the client library starts this program\n";
    return 2;
  }
  return hlm::ve::serve(options);
}
