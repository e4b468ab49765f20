#include "hlm/common/settings/command_line.h"

#include <iostream>
#include <list>

#include <CLI/CLI.hpp>

#include "hlm/common/settings/nearest.h"

namespace hlm::settings {
namespace {

std::string prefixed(const std::string& option) { return "--" + option; }

/// The options as CLI11 finds them in the arguments, as texts.
class Arguments {
 public:
  Arguments() { app_.set_help_flag(); }

  void add(const Table& table) {
    for (const Setting& setting : table.settings()) {
      add(setting.key, setting.key, setting.count, setting.placeholder);
    }
  }
  /// `key`: what the option sets.
  void add(const std::string& option, const std::string& key, int count,
           const std::string& placeholder) {
    Found& found = found_.emplace_back(Found{option, key, {}, nullptr});
    if (count == 0) {
      found.option = app_.add_flag((option == "help" ? "-h,--" : "--") + option);
      found.option->disable_flag_override();
      return;
    }
    found.option = app_.add_option("--" + option, found.values)->type_name(placeholder);
    found.option->expected(count)->allow_extra_args(false);
    found.option->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  }
  void add_repeated(const std::string& option, const std::string& placeholder) {
    Found& found = found_.emplace_back(Found{option, option, {}, nullptr});
    found.option = app_.add_option("--" + option, found.values)->type_name(placeholder);
    found.option->expected(1)->allow_extra_args(false);
    found.option->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  }
  void add_positional(const std::string& name, std::string& value) { app_.add_option(name, value); }

  struct Found {
    std::string name;
    std::string key;
    Values values;
    CLI::Option* option;

    bool given() const { return option->count() > 0; }
  };

  /// Returns what belongs to no option. Throws UsageError.
  std::vector<std::string> parse(int argc, const char* const* argv) {
    app_.allow_extras();
    try {
      app_.parse(argc, argv);
    } catch (const CLI::ArgumentMismatch& error) {
      throw UsageError(missing_value(error.what()));
    } catch (const CLI::ParseError& error) {
      throw UsageError(error.what());
    }
    std::vector<std::string> rest = app_.remaining();
    std::erase(rest, "--");
    return rest;
  }

  const std::list<Found>& found() const { return found_; }

 private:
  /// CLI11's message begins with the option's name.
  std::string missing_value(const std::string& message) const {
    for (const Found& found : found_) {
      if (message.starts_with(found.name + " was given a disallowed flag override")) {
        return prefixed(found.name) + " takes no value: it is on where it stands";
      }
      if (!message.starts_with(prefixed(found.name) + ':')) continue;
      return prefixed(found.name) + " needs a value (" + found.option->get_type_name() + ')';
    }
    return message;
  }

  CLI::App app_;
  std::list<Found> found_;  // CLI11 keeps addresses.
};

}  // namespace

CommandLine::CommandLine(Program program) : program_(std::move(program)) {
  own_.group("General");
  own_.flag("help", help_, "Print this and end");
  if (!program_.usual.empty()) own_.flag("help-all", help_all_, "The same, with every option");
  own_.flag("version", version_, "Print the version and end");
  own_.file("config", config_, "Read settings from this file, written as --print-config does");
  own_.flag("print-config", print_config_, "Print all settings as a configuration file and end");
}

void CommandLine::positional(const std::string& name, std::string& value, const std::string& help) {
  positional_ = Positional{name, &value, help, false};
}

void CommandLine::optional_positional(const std::string& name, std::string& value,
                                      const std::string& help) {
  positional_ = Positional{name, &value, help, true};
}

void CommandLine::section(NamedSection section) { section_ = std::move(section); }

std::optional<int> CommandLine::parse(int argc, const char* const* argv,
                                      const std::function<void()>& check) {
  try {
    const std::vector<Assignment> arguments = read_arguments(argc, argv);
    if (help_ || help_all_ || version_) {
      const bool all = help_all_ || program_.usual.empty();
      std::cout << (version_ ? program_.name + " " HLM_VERSION "\n" : help(all));
      return 0;
    }
    std::vector<Assignment> assignments = read_file();
    assignments.insert(assignments.end(), arguments.begin(), arguments.end());
    apply(assignments);
    check();
    if (!print_config_) return std::nullopt;
    std::cout << configuration();
    return 0;
  } catch (const UsageError& error) {
    std::cerr << program_.name << ": " << error.what() << '\n';
    return kUsageError;
  }
}

void CommandLine::take(const std::vector<std::string>& arguments) {
  std::vector<const char*> pointers{program_.name.c_str()};
  for (const std::string& argument : arguments) pointers.push_back(argument.c_str());
  std::vector<Assignment> assignments =
      read_arguments(static_cast<int>(pointers.size()), pointers.data());
  if (help_ || help_all_ || version_ || print_config_) {
    throw UsageError("--help, --help-all, --version and --print-config are for " + program_.name +
                     " itself");
  }
  const std::vector<Assignment> of_file = read_file();
  assignments.insert(assignments.begin(), of_file.begin(), of_file.end());
  apply(assignments);
}

std::vector<Assignment> CommandLine::read_arguments(int argc, const char* const* argv) {
  Arguments arguments;
  arguments.add(own_);
  arguments.add(table_);
  if (section_) {
    for (const Shorthand& each : section_->shorthands) {
      arguments.add(each.option, each.key, 1, each.placeholder);
    }
    arguments.add_repeated(section_->option, "KEY=VALUE");
  }
  if (positional_) arguments.add_positional(positional_->name, *positional_->value);
  const std::vector<std::string> rest = arguments.parse(argc, argv);

  std::vector<Assignment> assignments;
  for (const Arguments::Found& found : arguments.found()) {
    if (!found.given()) continue;
    const bool is_flag = found.values.empty();
    const Values values =
        is_flag ? Values{found.option->as<bool>() ? "true" : "false"} : found.values;
    if (const Setting* own = own_.find(found.name)) {
      own->set(prefixed(found.name), values);
    } else if (table_.find(found.name) != nullptr) {
      assignments.push_back({"", found.key, values, prefixed(found.name), false});
    } else if (found.name == section_->option) {
      for (const std::string& value : values) assignments.push_back(for_section(value));
    } else {
      assignments.push_back({section_->name, found.key, values, prefixed(found.name), false});
    }
  }
  if (help_ || help_all_ || version_) return {};
  if (!rest.empty()) refuse_arguments(rest);
  if (positional_ && !positional_->optional && positional_->value->empty()) {
    throw UsageError(positional_->name + " is missing: " + positional_->help);
  }
  return assignments;
}

Assignment CommandLine::for_section(const std::string& key_and_value) const {
  const std::size_t equals = key_and_value.find('=');
  const std::string option = prefixed(section_->option);
  if (equals == std::string::npos) {
    throw UsageError(option + ' ' + key_and_value + " must be KEY=VALUE");
  }
  const std::string key = key_and_value.substr(0, equals);
  return {section_->name, key, {key_and_value.substr(equals + 1)}, option + ' ' + key, false};
}

std::vector<Assignment> CommandLine::read_file() const {
  return config_.empty() ? std::vector<Assignment>{} : read_configuration(config_);
}

void CommandLine::apply(const std::vector<Assignment>& assignments) {
  std::vector<Assignment> of_section;
  for (const Assignment& assignment : assignments) {
    if (section_ && assignment.table == section_->name) {
      of_section.push_back(assignment);
    } else {
      apply(assignment);
    }
  }
  if (section_) section_->section->set(of_section);
}

void CommandLine::apply(const Assignment& assignment) {
  const Setting* const setting = assignment.table.empty() ? table_.find(assignment.key) : nullptr;
  if (setting == nullptr || (assignment.from_file && !setting->in_files)) {
    if (assignment.from_file && ignore_unknown_keys_) return;
    refuse_key(assignment);
  }
  set(*setting, assignment);
}

void CommandLine::refuse_arguments(const std::vector<std::string>& arguments) const {
  for (const std::string& argument : arguments) {
    if (!argument.starts_with("--")) continue;
    const std::string option = argument.substr(0, argument.find('='));
    std::vector<std::string> known;
    for (const Table* table : {&own_, &table_}) {
      for (const std::string& key : table->keys()) known.push_back(prefixed(key));
    }
    if (section_) {
      known.push_back(prefixed(section_->option));
      for (const Shorthand& each : section_->shorthands) known.push_back(prefixed(each.option));
    }
    const std::string hint = suggestion(option, known);
    throw UsageError("unknown option " + option + (hint.empty() ? "; see --help" : hint));
  }
  throw UsageError("unexpected argument '" + arguments.front() + "'; see --help");
}

void CommandLine::refuse_key(const Assignment& assignment) const {
  const std::string place =
      assignment.name.substr(0, assignment.name.size() - assignment.key.size());
  if (!assignment.table.empty()) {
    throw UsageError(place + "unknown table [" + assignment.table + "]" +
                     (section_ ? "; there is [" + section_->name + "] only" : ""));
  }
  const std::string hint = suggestion(assignment.key, table_.keys());
  throw UsageError(place + "unknown key '" + assignment.key + "'" +
                   (hint.empty() ? "; --print-config shows all" : hint));
}

std::string CommandLine::configuration() const {
  std::string text = "# " + program_.name + " " HLM_VERSION "\n" + table_.to_toml(true);
  if (section_) text += "\n[" + section_->name + "]\n" + section_->section->to_toml(true);
  return text;
}

std::string CommandLine::help(bool all) const {
  std::string text = "Usage: " + program_.name + " [OPTIONS]";
  if (positional_) {
    text += positional_->optional ? " [" + positional_->name + ']' : ' ' + positional_->name;
  }
  text += "\n\n" + wrapped(program_.purpose);
  if (positional_) text += '\n' + help_line(positional_->name, positional_->help);
  text += help_of(own_, "--");
  std::map<std::string, std::string> additions;
  if (section_) additions[section_->group] = section_help();
  if (all) {
    text += help_of(table_, "--", additions);
  } else {
    text += "\nUsual options, of " + std::to_string(table_.settings().size()) + ":\n";
    for (const std::string& key : program_.usual) {
      if (const Setting* setting = table_.find(key)) text += help_of(*setting, "--");
    }
    if (section_) text += section_help();
  }
  return text + '\n' + program_.footer;
}

std::string CommandLine::section_help() const {
  std::string text;
  for (const Shorthand& each : section_->shorthands) {
    text += help_line(prefixed(each.option) + ' ' + each.placeholder, each.help);
  }
  return text + help_line(prefixed(section_->option) + " KEY=VALUE", section_->help);
}

}  // namespace hlm::settings
