// The person at haptic_doctor, who is asked to do things and answers in lines.
#pragma once

#include <array>
#include <cstddef>
#include <string>

namespace hlm::server {

/// Texts go to standard error, so that standard output is the report alone. What is noexcept is for
/// a loop: it never waits.
class Person {
 public:
  /// answers: descriptor that they come from.
  explicit Person(int answers) noexcept;

  /// A paragraph.
  void say(const std::string& text) const;
  /// Takes what has come; whether a whole line is there.
  bool has_answered() noexcept;
  /// Nothing more will come, and no line is left.
  bool is_gone() const noexcept { return ended_ && size_ == 0; }
  /// The line in lower case, without blanks at its ends, which is then forgotten.
  std::string answer();
  bool is_at_terminal() const noexcept { return is_terminal_; }
  /// Whether answers come from a terminal or a pipe, whose end shows: a file's end does not.
  bool may_consent() const noexcept { return may_consent_; }
  /// Whether force shall end: whoever writes the answers has ended, also where some are still
  /// unread, or Enter was pressed at a terminal. Takes none.
  bool intervenes() const noexcept;

 private:
  int answers_;
  bool is_terminal_;
  bool may_consent_;
  std::array<char, 256> line_{};
  std::size_t size_ = 0;  ///< What is longer is cut.
  bool whole_ = false;
  bool ended_ = false;
};

}  // namespace hlm::server
