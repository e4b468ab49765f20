// Named settings bound to a program's own variables: one declaration gives the command-line option,
// the key of the configuration file, the check of its range, the help and the printed
// configuration.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "hlm/common/one_line.h"
#include "hlm/common/range.h"
#include "hlm/common/vocabulary.h"

namespace hlm::settings {

/// What the user has asked for cannot be: one line that names the thing, its value and what is
/// allowed. Programs end with kUsageError.
struct UsageError : std::runtime_error {
  explicit UsageError(const std::string& what) : std::runtime_error(one_line(what)) {}
};
inline constexpr int kUsageError = 2;

using Values = std::vector<std::string>;

struct Setting {
  std::string key;          ///< "release-step"; its option is --release-step.
  std::string group;        ///< Heading in the help.
  std::string placeholder;  ///< What stands for its value in the help: "N/m".
  std::string help;         ///< One clause.
  std::string allowed;      ///< "0 to 1 N"; empty where anything is.
  int count = 1;            ///< Values; 0: a flag.
  bool quoted = false;      ///< The value is text.
  bool is_file = false;     ///< The value names a file whose content matters.
  bool in_files = true;     ///< A key of configuration files too.
  /// Takes values that are called `name` in the error that it returns. They replace earlier ones.
  std::function<std::optional<std::string>(const std::string& name, const Values&)> set;
  std::function<Values()> get;  ///< Present values, as set() takes them.
  Values initial;               ///< get() when it was declared.
};

/// Variables must outlive the table and stay where they are.
class Table {
 public:
  Table() = default;
  Table(const Table&) = delete;
  Table& operator=(const Table&) = delete;

  /// Heading of what is declared from here on; none at first.
  void group(std::string title) { group_ = std::move(title); }

  void number(const std::string& key, double& value, const Range& range, const std::string& help);
  /// A number that may be left to the program.
  void number(const std::string& key, std::optional<double>& value, const Range& range,
              const std::string& help);
  /// One number of a structure; its key is its name with dashes for spaces.
  template <class Owner>
  void number(Owner& owner, const NumberOf<Owner>& number_of) {
    number(key_of(number_of.name), owner.*number_of.number, number_of, number_of.help);
  }
  template <class Owner, std::size_t n>
  void numbers(Owner& owner, const std::array<NumberOf<Owner>, n>& all) {
    for (const NumberOf<Owner>& each : all) number(owner, each);
  }
  template <std::integral Integer>
  void whole(const std::string& key, Integer& value, const Range& range, const std::string& help) {
    add_whole(
        key, range, help, [&value] { return static_cast<std::int64_t>(value); },
        [&value](std::int64_t given) { value = static_cast<Integer>(given); });
  }
  /// Two numbers, the second not below the first, or none.
  void interval(const std::string& key, std::vector<double>& values, const Range& range,
                const std::string& help);
  void text(const std::string& key, std::string& value, const std::string& placeholder,
            const std::string& help);
  void file(const std::string& key, std::string& value, const std::string& help);
  void choice(const std::string& key, std::string& value, const std::vector<std::string>& allowed,
              const std::string& help);
  template <class Enum>
  void choice(const std::string& key, Enum& value, const std::string& help) {
    std::vector<std::string> names;
    for (const Word<Enum>& word : kWords<Enum>) names.emplace_back(word.name);
    add_choice(
        key, std::move(names), help, [&value] { return std::string(name_of(value)); },
        [&value](const std::string& name) { value = *value_of<Enum>(name); });
  }
  void yes_no(const std::string& key, bool& value, const std::string& help);
  void flag(const std::string& key, bool& value, const std::string& help);
  /// Leaves the latest setting to the command line alone.
  void not_in_files() { settings_.back().in_files = false; }

  const std::vector<Setting>& settings() const { return settings_; }
  /// Null if there is none of that key.
  const Setting* find(std::string_view key) const;
  std::vector<std::string> keys() const;

  /// The settings as lines of a configuration file, "key = value", each group under a comment; if
  /// `described`, each with its own comment. A number that is read back is the same number.
  std::string to_toml(bool described) const;

 private:
  static std::string key_of(std::string name);
  Setting& add(const std::string& key, const std::string& help);
  Setting& add_number(const std::string& key, const Range& range, const std::string& help);
  void add_whole(const std::string& key, const Range& range, const std::string& help,
                 std::function<std::int64_t()> get, std::function<void(std::int64_t)> set);
  void add_choice(const std::string& key, std::vector<std::string> names, const std::string& help,
                  std::function<std::string()> get, std::function<void(const std::string&)> set);

  std::string group_;
  std::vector<Setting> settings_;
};

/// What a setting says of itself: "HELP: ALLOWED (default VALUE)".
std::string description_of(const Setting& setting);

/// The text in lines that fit a terminal, each after this many spaces.
std::string wrapped(const std::string& text, std::size_t indent = 0);

/// One entry of a help text.
std::string help_line(const std::string& name, const std::string& description);

/// The entry of one setting. prefix: of its name, "--" or "".
std::string help_of(const Setting& setting, const std::string& prefix);
/// The entries of a table under their groups' headings. prefix: of each name, "--" or "".
/// additions: entries that begin the group of that heading.
std::string help_of(const Table& table, const std::string& prefix,
                    const std::map<std::string, std::string>& additions = {});

}  // namespace hlm::settings
