// A vendor's sentence that can be read in two ways, and the choice among the two readings.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdio>
#include <string>
#include <string_view>

namespace {  // Each fake is one source: two of them in a process share nothing.

struct Sentence {
  const char* name;
  const char* first;  // The likelier answer.
  const char* second;
  const char* first_means;
  const char* second_means;
  const char* source;
};

// Which sentences are read in the second way, after "NAME:ANSWER,…"; "first" and "second" stand for
// all, and later words win. False, with a line on stderr, for a word that is not known.
template <std::size_t N>
class Readings {
 public:
  explicit Readings(const std::array<Sentence, N>& sentences) : sentences_(sentences) {}

  bool second(std::size_t sentence) const { return second_[sentence]; }

  bool choose(std::string_view words) {
    second_.fill(false);
    bool known = true;
    while (!words.empty()) {
      const std::size_t comma = std::min(words.find(','), words.size());
      known = choose_one(words.substr(0, comma)) && known;
      words.remove_prefix(std::min(comma + 1, words.size()));
    }
    return known;
  }

  // "NAME:FIRST|SECOND", empty past the last.
  std::string text(int i) const {
    if (i < 0 || static_cast<std::size_t>(i) >= N) return "";
    const Sentence& s = sentences_[static_cast<std::size_t>(i)];
    return std::string(s.name) + ":" + s.first + "|" + s.second;
  }

 private:
  bool choose_one(std::string_view word) {
    if (word == "first" || word == "second") {
      second_.fill(word == "second");
      return true;
    }
    for (std::size_t i = 0; i < N; ++i) {
      const Sentence& s = sentences_[i];
      const bool first = word == std::string(s.name) + ":" + s.first;
      if (!first && word != std::string(s.name) + ":" + s.second) continue;
      second_[i] = !first;
      return true;
    }
    std::fprintf(stderr, "fake: no such reading '%.*s'\n", static_cast<int>(word.size()),
                 word.data());
    return false;
  }

  const std::array<Sentence, N>& sentences_;
  std::array<bool, N> second_{};
};

}  // namespace
