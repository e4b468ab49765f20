// What a world file holds that is not used as it stands: refused, approximated or ignored.
#pragma once

#include <functional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace hlm::ve {

/// What becomes of something in a file.
enum class Verdict {
  kRefused,       ///< The world cannot be used with it.
  kApproximated,  ///< Something similar is used instead.
  kIgnored,       ///< It has no effect here.
};

/// Where something stands in a file.
struct Place {
  std::string file;
  int line = 0;         ///< Line from 1 on; 0: not known.
  std::string element;  ///< Element with its named ancestors: "model 'a' link 'b'"; may be empty.
};

/// "FILE:LINE: ELEMENT", without what is not known.
std::string to_string(const Place& place);

struct Finding {
  Verdict verdict = Verdict::kRefused;
  Place place;       ///< The first, if there are several.
  std::string what;  ///< What it is, its value, and what is allowed or done instead. One line.
  int count = 1;     ///< How often it was found. What is refused is listed each time.
};

/// "FILE:LINE: ELEMENT: WHAT", with the count if it is not 1.
std::string to_string(const Finding& finding);

/// How what takes long goes on. Both are called by the thread that loads; either may be empty.
struct Progress {
  std::function<void(const std::string&)> say;  ///< Takes one line, at most one each second.
  std::function<bool()> stopped;                ///< Whether nobody wants the result any more.
};

/// Collects what is found while a world is read, so that one run tells everything.
class Diagnostics {
 public:
  explicit Diagnostics(Progress progress = {}) : progress_(std::move(progress)) {}

  /// Once for each place and `what`.
  void refuse(const Place& place, const std::string& what);
  /// One finding for all with the same `what`.
  void approximate(const Place& place, const std::string& what);
  /// One finding for all with the same `what`.
  void ignore(const Place& place, const std::string& what);

  /// The findings in the order in which they were found first.
  const std::vector<Finding>& findings() const { return findings_; }
  int count(Verdict verdict) const;
  bool usable() const { return count(Verdict::kRefused) == 0; }
  const Progress& progress() const { return progress_; }

 private:
  void add_to_kind(Verdict verdict, const Place& place, const std::string& what);

  std::vector<Finding> findings_;
  Progress progress_;
};

/// A world that cannot be used. what() is one line: the first of what is refused, and how much more
/// there is.
class RefusedWorld : public std::runtime_error {
 public:
  explicit RefusedWorld(Diagnostics diagnostics);
  const Diagnostics& diagnostics() const { return diagnostics_; }

 private:
  Diagnostics diagnostics_;
};

}  // namespace hlm::ve
