#include "hlm/common/settings/configuration_file.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <toml++/toml.h>

namespace hlm::settings {
namespace {

class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path) {}

  std::vector<Assignment> read() {
    std::error_code none;
    if (std::filesystem::is_directory(path_, none)) {
      throw UsageError("configuration file " + path_ + ": is a folder");
    }
    // The parser looks for the end of a file first, which a pipe does not have.
    std::ifstream file(path_, std::ios::binary);
    if (!file) throw UsageError("configuration file " + path_ + ": " + std::strerror(errno));
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    try {
      add("", toml::parse(text, path_));
    } catch (const toml::parse_error& error) {
      const auto line = error.source().begin.line;
      throw UsageError((line > 0 ? path_ + ':' + std::to_string(line) + ": "
                                 : "configuration file " + path_ + ": ") +
                       std::string(error.description()));
    }
    return std::move(assignments_);
  }

 private:
  std::string place(const toml::node& node) const {
    return path_ + ':' + std::to_string(node.source().begin.line) + ": ";
  }

  void add(const std::string& name, const toml::table& table) {
    for (const auto& [key, node] : table) {
      const std::string word(key.str());
      if (!node.is_table()) {
        assignments_.push_back({name, word, values(word, node), place(node) + word, true});
      } else if (name.empty()) {
        add(word, *node.as_table());
      } else {
        throw UsageError(place(node) + '[' + name + '.' + word + "] is a table within a table");
      }
    }
  }

  Values values(const std::string& key, const toml::node& node) const {
    const toml::array* const array = node.as_array();
    if (array == nullptr) return {text(key, node)};
    Values all;
    for (const toml::node& element : *array) all.push_back(text(key, element));
    return all;
  }

  std::string text(const std::string& key, const toml::node& node) const {
    if (const auto* value = node.as_string()) return value->get();
    if (const auto* value = node.as_integer()) return std::to_string(value->get());
    if (const auto* value = node.as_floating_point()) return shortest_text(value->get());
    if (const auto* value = node.as_boolean()) return value->get() ? "true" : "false";
    throw UsageError(place(node) + key +
                     " must be a number, a text, true, false or a list of these");
  }

  const std::string& path_;
  std::vector<Assignment> assignments_;
};

}  // namespace

void set(const Setting& setting, const Assignment& assignment) {
  const std::size_t given = assignment.values.size();
  const auto wanted = static_cast<std::size_t>(std::max(setting.count, 1));
  const bool may_be_none = wanted > 1 && given == 0;
  if (given != wanted && !may_be_none) {
    const std::string values = wanted == 1 ? "one value" : std::to_string(wanted) + " values";
    throw UsageError(assignment.name + " needs " + values + ", not " + std::to_string(given));
  }
  if (const auto error = setting.set(assignment.name, assignment.values)) throw UsageError(*error);
}

std::vector<Assignment> read_configuration(const std::string& path) { return Reader(path).read(); }

}  // namespace hlm::settings
