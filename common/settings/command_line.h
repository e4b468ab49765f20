// The one way in which the programs take their settings: from the command line or a configuration
// file, with --help, --help-all, --version, --config and --print-config.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "hlm/common/settings/configuration_file.h"
#include "hlm/common/settings/table.h"

namespace hlm::settings {

/// What a program's help says besides its options.
struct Program {
  std::string name;
  std::string purpose;  ///< A sentence.
  std::string footer;   ///< Examples and exit codes, as printed.
  /// Keys of the settings that most people need, in that order: --help shows these and --help-all
  /// the others, too. Empty: --help shows all.
  std::vector<std::string> usual = {};
};

/// A table of its own in configuration files, whose keys are known only when another of its keys
/// has been read, such as the driver in [device].
class Section {
 public:
  virtual ~Section() = default;
  /// Takes what the file says, then what the command line says. Throws UsageError.
  virtual void set(const std::vector<Assignment>& assignments) = 0;
  /// The section as lines of a configuration file.
  virtual std::string to_toml(bool described) const = 0;
};

/// An option that sets one key of a section.
struct Shorthand {
  std::string option;  ///< Without dashes.
  std::string key;
  std::string placeholder;
  std::string help;
};

/// How a section is called.
struct NamedSection {
  std::string name;    ///< [name] in files.
  std::string group;   ///< Group of the table; the section's options begin its help.
  Section* section;    ///< Must outlive the command line.
  std::string option;  ///< Sets any of its keys as KEY=VALUE, any number of times.
  std::string help;    ///< Help for that option.
  std::vector<Shorthand> shorthands;
};

class CommandLine {
 public:
  explicit CommandLine(Program program);

  /// Where options are declared. All but --config and its like are keys of configuration files too.
  Table& table() { return table_; }
  /// An argument without a name, which must be given.
  void positional(const std::string& name, std::string& value, const std::string& help);
  /// One that may be left out.
  void optional_positional(const std::string& name, std::string& value, const std::string& help);
  void section(NamedSection section);
  /// Keys of configuration files that are not known here are another program's.
  void ignore_unknown_keys() { ignore_unknown_keys_ = true; }

  /// Sets what the arguments and the configuration file say, the arguments last, then calls
  /// `check`, which throws UsageError if settings do not go together. Empty if the program shall go
  /// on; otherwise its exit code: 0 after --help, --version or --print-config, kUsageError after
  /// one line on standard error.
  std::optional<int> parse(
      int argc, const char* const* argv, const std::function<void()>& check = [] {});

  /// Sets what the arguments alone say, of a program that is part of another. Throws UsageError.
  void take(const std::vector<std::string>& arguments);

  /// all: with every setting; otherwise the usual ones.
  std::string help(bool all) const;
  /// Whether --print-config was given.
  bool prints_configuration() const { return print_config_; }

 private:
  struct Positional {
    std::string name;
    std::string* value = nullptr;
    std::string help;
    bool optional = false;
  };

  std::vector<Assignment> read_arguments(int argc, const char* const* argv);
  std::vector<Assignment> read_file() const;
  void apply(const std::vector<Assignment>& assignments);
  void apply(const Assignment& assignment);
  Assignment for_section(const std::string& key_and_value) const;
  [[noreturn]] void refuse_arguments(const std::vector<std::string>& arguments) const;
  [[noreturn]] void refuse_key(const Assignment& assignment) const;
  std::string section_help() const;
  std::string configuration() const;

  Program program_;
  Table table_;
  std::optional<Positional> positional_;
  std::optional<NamedSection> section_;
  Table own_;  ///< --config and its like.
  std::string config_;
  bool print_config_ = false;
  bool help_ = false;
  bool help_all_ = false;
  bool version_ = false;
  bool ignore_unknown_keys_ = false;
};

}  // namespace hlm::settings
