// What SDFormat's parser has to say, as one line instead of many on stderr.
#pragma once

#include <mutex>
#include <sstream>
#include <streambuf>
#include <string>

#include <sdf/Types.hh>

namespace hlm::ve {

/// While it lives, what anyone writes to std::cerr is kept instead of printed: the parser prints
/// its details there and leaves them out of its errors.
class CapturedMessages {
 public:
  CapturedMessages();
  ~CapturedMessages();
  CapturedMessages(const CapturedMessages&) = delete;
  CapturedMessages& operator=(const CapturedMessages&) = delete;

  /// Forgets what was said so far.
  void clear() { text_.str(""); }
  /// The first error since, without its source position; empty if there is none.
  std::string first_error() const;

 private:
  static std::mutex mutex_;  ///< std::cerr is one for all threads: one of them captures at a time.
  std::lock_guard<std::mutex> lock_;
  std::ostringstream text_;
  std::streambuf* original_;
};

/// Throws std::runtime_error with the first of the parser's errors; returns if there is none.
void require_none(const sdf::Errors& errors);

}  // namespace hlm::ve
