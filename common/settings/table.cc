#include "hlm/common/settings/table.h"

#include <algorithm>
#include <charconv>
#include <sstream>

#include "hlm/common/settings/nearest.h"

namespace hlm::settings {
namespace {

/// The whole text as a number.
template <class Number>
std::optional<Number> parsed(const std::string& text) {
  Number value{};
  const char* const begin = text.data() + (text.starts_with('+') ? 1 : 0);
  const char* const end = text.data() + text.size();
  const auto [parsed_to, error] = std::from_chars(begin, end, value);
  if (error != std::errc{} || parsed_to != end) return std::nullopt;
  return value;
}

std::string must_be(const std::string& name, const std::string& value, const std::string& what) {
  return name + ' ' + (value.empty() ? "''" : value) + " must be " + what;
}

std::string joined(const std::vector<std::string>& words, const std::string& between) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

std::string text_of(bool value) { return value ? "true" : "false"; }

/// Sets `value`, or says what is wrong with `text`.
std::optional<std::string> read(const std::string& name, const std::string& text,
                                const Range& range, double& value) {
  const auto given = parsed<double>(text);
  if (!given) return must_be(name, text, "a number, " + to_string(range));
  if (auto error = find_error(name, *given, range)) return error;
  value = *given + 0.0;  // Zero has no sign.
  return std::nullopt;
}

/// The text as a TOML string.
std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (code < 0x20 || code == 0x7F) {
      constexpr std::string_view kDigits = "0123456789ABCDEF";
      result += {'\\', 'u', '0', '0', kDigits[code >> 4], kDigits[code & 0xF]};
      continue;
    }
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result + '"';
}

/// Characters of a UTF-8 text.
std::size_t width(const std::string& text) {
  return static_cast<std::size_t>(
      std::ranges::count_if(text, [](char c) { return (c & '\xc0') != '\x80'; }));
}

/// The setting's value as TOML.
std::string value_text(const Setting& setting) {
  Values values = setting.get();
  if (setting.quoted) std::ranges::transform(values, values.begin(), quoted);
  return setting.count > 1 ? '[' + joined(values, ", ") + ']' : joined(values, "");
}

}  // namespace

std::string Table::key_of(std::string name) {
  std::ranges::replace(name, ' ', '-');
  return name;
}

Setting& Table::add(const std::string& key, const std::string& help) {
  Setting setting;
  setting.key = key;
  setting.group = group_;
  setting.help = help;
  settings_.push_back(std::move(setting));
  return settings_.back();
}

Setting& Table::add_number(const std::string& key, const Range& range, const std::string& help) {
  Setting& setting = add(key, help);
  setting.placeholder = *range.unit != '\0' ? range.unit : "NUMBER";
  setting.allowed = to_string(range);
  return setting;
}

void Table::number(const std::string& key, double& value, const Range& range,
                   const std::string& help) {
  Setting& setting = add_number(key, range, help);
  setting.set = [&value, range](const std::string& name, const Values& given) {
    return read(name, given.front(), range, value);
  };
  setting.get = [&value] { return Values{shortest_text(value)}; };
  setting.initial = setting.get();
}

void Table::number(const std::string& key, std::optional<double>& value, const Range& range,
                   const std::string& help) {
  Setting& setting = add_number(key, range, help);
  setting.set = [&value, range](const std::string& name, const Values& given) {
    double number = 0;
    auto error = read(name, given.front(), range, number);
    if (!error) value = number;
    return error;
  };
  setting.get = [&value] { return value ? Values{shortest_text(*value)} : Values{}; };
  setting.initial = setting.get();
}

void Table::add_whole(const std::string& key, const Range& range, const std::string& help,
                      std::function<std::int64_t()> get, std::function<void(std::int64_t)> set) {
  Setting& setting = add(key, help);
  setting.placeholder = "COUNT";
  setting.allowed = to_string(range);
  setting.set = [set = std::move(set), range](const std::string& name,
                                              const Values& given) -> std::optional<std::string> {
    const auto number = parsed<std::int64_t>(given.front());
    if (!number) return must_be(name, given.front(), "a whole number, " + to_string(range));
    if (auto error = find_error(name, static_cast<double>(*number), range)) return error;
    set(*number);
    return std::nullopt;
  };
  setting.get = [get = std::move(get)] { return Values{std::to_string(get())}; };
  setting.initial = setting.get();
}

void Table::interval(const std::string& key, std::vector<double>& values, const Range& range,
                     const std::string& help) {
  Setting& setting = add(key, help);
  setting.placeholder = "LOW HIGH";
  setting.allowed = to_string(range);
  setting.count = 2;
  setting.set = [&values, range](const std::string& name,
                                 const Values& given) -> std::optional<std::string> {
    std::vector<double> numbers(given.size());
    for (std::size_t i = 0; i < given.size(); ++i) {
      if (auto error = read(name, given[i], range, numbers[i])) return error;
    }
    if (numbers.size() == 2 && numbers[0] > numbers[1]) {
      return must_be(name, joined(given, " "), "LOW HIGH, with LOW not above HIGH");
    }
    values = std::move(numbers);
    return std::nullopt;
  };
  setting.get = [&values] {
    Values texts;
    for (const double value : values) texts.push_back(shortest_text(value));
    return texts;
  };
  setting.initial = setting.get();
}

void Table::text(const std::string& key, std::string& value, const std::string& placeholder,
                 const std::string& help) {
  Setting& setting = add(key, help);
  setting.placeholder = placeholder;
  setting.quoted = true;
  setting.set = [&value](const std::string&, const Values& given) -> std::optional<std::string> {
    value = given.front();
    return std::nullopt;
  };
  setting.get = [&value] { return Values{value}; };
  setting.initial = setting.get();
}

void Table::file(const std::string& key, std::string& value, const std::string& help) {
  text(key, value, "FILE", help);
  settings_.back().is_file = true;
}

void Table::choice(const std::string& key, std::string& value,
                   const std::vector<std::string>& allowed, const std::string& help) {
  add_choice(
      key, allowed, help, [&value] { return value; },
      [&value](const std::string& name) { value = name; });
}

void Table::add_choice(const std::string& key, std::vector<std::string> names,
                       const std::string& help, std::function<std::string()> get,
                       std::function<void(const std::string&)> set) {
  Setting& setting = add(key, help);
  setting.placeholder = "WORD";
  setting.allowed = joined(names, ", ");
  setting.quoted = true;
  setting.set = [set = std::move(set), names = std::move(names)](
                    const std::string& name, const Values& given) -> std::optional<std::string> {
    if (std::ranges::find(names, given.front()) == names.end()) {
      return must_be(name, given.front(), "one of " + joined(names, ", "));
    }
    set(given.front());
    return std::nullopt;
  };
  setting.get = [get = std::move(get)] { return Values{get()}; };
  setting.initial = setting.get();
}

void Table::yes_no(const std::string& key, bool& value, const std::string& help) {
  Setting& setting = add(key, help);
  setting.placeholder = "BOOLEAN";
  setting.allowed = "true, false";
  setting.set = [&value](const std::string& name,
                         const Values& given) -> std::optional<std::string> {
    if (given.front() != "true" && given.front() != "false") {
      return must_be(name, given.front(), "true or false");
    }
    value = given.front() == "true";
    return std::nullopt;
  };
  setting.get = [&value] { return Values{text_of(value)}; };
  setting.initial = setting.get();
}

void Table::flag(const std::string& key, bool& value, const std::string& help) {
  yes_no(key, value, help);
  Setting& setting = settings_.back();
  setting.count = 0;
  setting.placeholder.clear();
  setting.allowed.clear();
  setting.initial.clear();
}

const Setting* Table::find(std::string_view key) const {
  const auto found = std::ranges::find(settings_, key, &Setting::key);
  return found == settings_.end() ? nullptr : &*found;
}

std::vector<std::string> Table::keys() const {
  std::vector<std::string> keys;
  for (const Setting& setting : settings_) keys.push_back(setting.key);
  return keys;
}

std::string Table::to_toml(bool described) const {
  std::string text;
  std::string group;
  for (const Setting& setting : settings_) {
    const bool is_unset = setting.count == 1 && setting.get().empty();
    if (!setting.in_files || is_unset) continue;
    if (described && setting.group != group) text += "\n## " + setting.group + "\n\n";
    group = setting.group;
    if (described) text += "# " + description_of(setting) + '\n';
    text += setting.key + " = " + value_text(setting) + '\n';
  }
  return text;
}

std::string description_of(const Setting& setting) {
  std::string text = setting.help;
  if (!setting.allowed.empty()) text += ": " + setting.allowed;
  const std::string initial = joined(setting.initial, " ");
  return initial.empty() ? text : text + " (default " + initial + ')';
}

std::string wrapped(const std::string& text, std::size_t indent) {
  constexpr std::size_t kWidth = 96;
  const std::string margin(indent, ' ');
  std::string lines;
  std::string line = margin;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    if (line.size() > indent && width(line) + 1 + width(word) > kWidth) {
      lines += line + '\n';
      line = margin;
    }
    line += (line.size() > indent ? " " : "") + word;
  }
  return lines + line + '\n';
}

std::string help_line(const std::string& name, const std::string& description) {
  constexpr std::size_t kColumn = 30;
  const std::string head = "  " + name;
  const std::string body = wrapped(description, kColumn);
  if (width(head) + 2 > kColumn) return head + '\n' + body;
  return head + body.substr(width(head));
}

std::string help_of(const Setting& setting, const std::string& prefix) {
  const std::string name = prefix + setting.key;
  return help_line(setting.count == 0 ? name : name + ' ' + setting.placeholder,
                   description_of(setting));
}

std::string help_of(const Table& table, const std::string& prefix,
                    const std::map<std::string, std::string>& additions) {
  std::string text;
  std::string group;
  for (const Setting& setting : table.settings()) {
    if (setting.group != group) {
      group = setting.group;
      const auto addition = additions.find(group);
      text += '\n' + group + ":\n" + (addition == additions.end() ? "" : addition->second);
    }
    text += help_of(setting, prefix);
  }
  return text;
}

}  // namespace hlm::settings
