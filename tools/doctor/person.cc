#include "hlm/tools/doctor/person.h"

#include <cctype>
#include <iostream>

#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include "hlm/common/settings/table.h"

namespace hlm::server {
namespace {

/// What poll() says of the descriptor right now.
short events_of(int descriptor) noexcept {
  pollfd input{.fd = descriptor, .events = POLLIN, .revents = 0};
  return ::poll(&input, 1, 0) > 0 ? input.revents : short{0};
}

bool is_pipe(int descriptor) noexcept {
  struct stat status {};
  return fstat(descriptor, &status) == 0 && S_ISFIFO(status.st_mode);
}

}  // namespace

Person::Person(int answers) noexcept
    : answers_(answers),
      is_terminal_(isatty(answers) != 0),
      may_consent_(is_terminal_ || is_pipe(answers)) {}

void Person::say(const std::string& text) const {
  std::cerr << settings::wrapped(text) << std::flush;
}

bool Person::has_answered() noexcept {
  while (!whole_ && !ended_ && events_of(answers_) != 0) {
    char c = 0;
    const ssize_t count = read(answers_, &c, 1);
    if (count <= 0) {
      ended_ = true;
    } else if (c == '\n') {
      whole_ = true;
    } else if (size_ < line_.size()) {
      line_[size_++] = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
  }
  return whole_ || (ended_ && size_ > 0);
}

std::string Person::answer() {
  const std::string line(line_.data(), size_);
  size_ = 0;
  whole_ = false;
  constexpr const char* kBlank = " \t\r";
  const std::size_t begin = line.find_first_not_of(kBlank);
  if (begin == std::string::npos) return "";
  return line.substr(begin, line.find_last_not_of(kBlank) + 1 - begin);
}

bool Person::intervenes() const noexcept {
  const int events = events_of(answers_);
  if (ended_ || (events & ~POLLIN) != 0) return true;
  return is_terminal_ && events != 0;
}

}  // namespace hlm::server
