#include "experiments/cell.h"

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <stdexcept>

#include <spdlog/fmt/fmt.h>
#include <sys/resource.h>
#include <unistd.h>

namespace hlm::experiments {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

constexpr const char* kInputs = "inputs";  ///< Folder of the files that values name.

std::string text_of(const Input& input) {
  const auto* number = std::get_if<double>(&input.value);
  return number ? fmt::format("{}", *number) : std::get<std::string>(input.value);
}

std::string read_text(const fs::path& path) {
  if (fs::exists(path) && !fs::is_regular_file(path)) {
    throw std::runtime_error(path.string() + " must be a file");
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(fmt::format("{}: {}", path.string(), std::strerror(errno)));
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string host() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "unknown";
}

/// At once: whoever reads it sees nothing or all.
void write_text(const fs::path& path, const std::string& text) {
  // The cell may run twice at the same time, where a cluster takes a node for lost.
  const fs::path part = fmt::format("{}.{}.{}.part", path.string(), host(), getpid());
  errno = 0;
  std::ofstream file(part, std::ios::binary);
  file << text << std::flush;
  file.close();
  if (file) {
    fs::rename(part, path);
    return;
  }
  const int reason = errno;
  std::error_code ignored;
  fs::remove(part, ignored);
  throw std::runtime_error(
      fmt::format("{}: cannot be written: {}", path.string(), std::strerror(reason)));
}

void copy_into(const fs::path& folder, const std::vector<fs::path>& files) {
  fs::create_directories(folder);
  for (const fs::path& file : files) write_text(folder / file.filename(), read_text(file));
}

// JSON has no numbers that are not finite.
constexpr std::array<std::pair<const char*, double>, 3> kNotFinite{
    {{"NaN", std::numeric_limits<double>::quiet_NaN()},
     {"Infinity", std::numeric_limits<double>::infinity()},
     {"-Infinity", -std::numeric_limits<double>::infinity()}}};

void name_not_finite(json& value) {
  if (value.is_structured()) {
    for (json& part : value) name_not_finite(part);
  } else if (value.is_number_float() && !std::isfinite(value.get<double>())) {
    const auto number = value.get<double>();
    value = std::isnan(number) ? "NaN" : number > 0 ? "Infinity" : "-Infinity";
  }
}

void restore_not_finite(json& value) {
  if (value.is_structured()) {
    for (json& part : value) restore_not_finite(part);
  } else if (value.is_string()) {
    for (const auto& [name, number] : kNotFinite) {
      if (value == name) value = number;
    }
  }
}

json to_object(const Inputs& inputs) {
  json object = json::object();
  for (const Input& input : inputs) {
    std::visit([&](const auto& value) { object[input.name] = value; }, input.value);
  }
  name_not_finite(object);
  return object;
}

/// "compiler 'GCC 12.2.0', here 'Clang 16'"; empty if they are the same.
std::string difference(const Program& theirs) {
  const json a = theirs;
  const json b = program();
  for (const auto& [key, value] : a.items()) {
    if (value != b[key]) {
      return fmt::format("{} '{}', this program has '{}'", key, value.get<std::string>(),
                         b[key].get<std::string>());
    }
  }
  return {};
}

/// Of a file that is JSON, whole, and has these keys.
std::optional<json> read_whole(const fs::path& path, std::initializer_list<const char*> keys) {
  if (!fs::exists(path)) return {};
  json object = json::parse(read_text(path), nullptr, false);
  for (const char* key : keys) {
    if (!object.is_object() || !object.contains(key)) return {};
  }
  return object;
}

double peak_memory_MB() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

}  // namespace

Inputs operator+(Inputs a, const Inputs& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

std::string text_of(const Inputs& inputs, std::string_view name) {
  for (const Input& input : inputs) {
    if (input.name == name) return text_of(input);
  }
  return {};
}

std::string Cell::condition() const {
  std::string text;
  for (const Input& input : inputs) {
    if (input.name == "method" || input.name == "seed") continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", input.name, text_of(input));
  }
  return text;
}

std::vector<std::string> SweepFolder::open() {
  const fs::path path = folder_ / "sweep.json";
  if (!fs::exists(path)) throw std::runtime_error(folder_.string() + " holds no sweep");
  try {
    const json found = json::parse(read_text(path));
    const std::string different = difference(found.at("program").get<Program>());
    if (!different.empty()) {
      throw std::runtime_error(
          fmt::format("{} was begun by another program: {}; --replace removes it", folder_.string(),
                      different));
    }
    for (const auto& [name, hash] : found.at("files").items()) {
      if (hash_of(read_text(folder_ / kInputs / name)) != hash) {
        throw std::runtime_error(
            fmt::format("{} was changed since", (folder_ / kInputs / name).string()));
      }
    }
    return arguments_ = found.at("arguments").get<std::vector<std::string>>();
  } catch (const json::exception&) {
    throw std::runtime_error(path.string() + " is damaged; the sweep's own command mends it");
  }
}

void SweepFolder::begin(const std::vector<std::string>& arguments,
                        const std::vector<fs::path>& files, bool replaces) {
  const fs::path path = folder_ / "sweep.json";
  json wanted{{"arguments", arguments}, {"program", program()}, {"files", json::object()}};
  for (const fs::path& file : files) {
    const std::string name = file.filename().string();
    const std::string hash = hash_of(read_text(file));
    if (wanted["files"].value(name, hash) != hash) {
      throw std::runtime_error(fmt::format("{} must not be called as another file", file.string()));
    }
    wanted["files"][name] = hash;
  }
  if (fs::exists(path)) {
    const json found = json::parse(read_text(path), nullptr, false);
    if (found == wanted) {
      copy_into(folder_ / kInputs, files);
      open();
      return;
    }
    const bool is_ours = found.contains("arguments") && found.contains("program");
    if (!found.is_discarded() && !is_ours) {
      throw std::runtime_error(path.string() + " is not of a sweep: it must be another folder");
    }
    // One that was cut is written again: each cell says which sweep it is of.
    if (!found.is_discarded() && !replaces) refuse_other(arguments);
    if (replaces) clear();
  } else if (fs::exists(folder_) && !fs::is_empty(folder_)) {
    throw std::runtime_error(folder_.string() +
                             " holds something else than a sweep: it must be another folder");
  }
  copy_into(folder_ / kInputs, files);
  write_text(path, wanted.dump(1) + "\n");
  arguments_ = arguments;
}

void SweepFolder::refuse_other(const std::vector<std::string>& arguments) {
  if (open() == arguments) {
    throw std::runtime_error(
        fmt::format("{} holds a sweep with other content of its files: it must "
                    "be another folder, or --replace removes it",
                    folder_.string()));
  }
  throw std::runtime_error(fmt::format(
      "{} holds a sweep with the arguments '{}', not '{}': it must be another folder, or --replace "
      "removes it",
      folder_.string(), fmt::join(arguments_, " "), fmt::join(arguments, " ")));
}

void SweepFolder::clear() const {
  for (const char* name :
       {"sweep.json", "cells", "inputs", "program", "jobs", "logs", "sweep.tar", "report.html"}) {
    fs::remove_all(folder_ / name);
  }
  remove_tables();
  for (const auto& entry : fs::directory_iterator(folder_)) {
    if (entry.path().extension() == ".tar") fs::remove(entry.path());
  }
}

void SweepFolder::remove_tables() const {
  for (const auto& entry : fs::directory_iterator(folder_)) {
    if (entry.path().extension() == ".csv") fs::remove(entry.path());
  }
}

fs::path SweepFolder::file_of(const Cell& cell) const {
  return folder_ / "cells" / cell.experiment / (cell.name + ".json");
}

std::optional<SweepFolder::Result> SweepFolder::read(const Cell& cell) const {
  const fs::path path = file_of(cell);
  auto object = read_whole(path, {"inputs", "arguments", "program", "seconds"});
  if (!object || object->contains("results") == object->contains("error")) return {};
  try {
    return result_in(std::move(*object), cell, path);
  } catch (const json::exception&) {  // Of other types: no cell has written it.
    return {};
  }
}

SweepFolder::Result SweepFolder::result_in(json object, const Cell& cell,
                                           const fs::path& path) const {
  const std::string different = difference(object.at("program").get<Program>());
  if (!different.empty()) {
    throw std::runtime_error(
        fmt::format("{} was written by another program: {}", path.string(), different));
  }
  if (object.at("inputs") != to_object(cell.inputs) || object.at("arguments") != arguments_) {
    throw std::runtime_error(fmt::format("{} is of another sweep: {} {}", path.string(),
                                         object.at("arguments").dump(),
                                         object.at("inputs").dump()));
  }
  Result result{.seconds = object.at("seconds").get<double>()};
  if (object.contains("error")) {
    result.error = object.at("error").get<std::string>();
  } else {
    result.value = std::move(object.at("results"));
    restore_not_finite(result.value);
  }
  return result;
}

void SweepFolder::write(const Cell& cell, const Result& result) const {
  json object{{"cell", cell.name},
              {"experiment", cell.experiment},
              {"inputs", to_object(cell.inputs)},
              {"arguments", arguments_},
              {"program", program()},
              {"host", host()},
              {"seconds", result.seconds},
              {"peak_memory_MB", peak_memory_MB()}};
  if (result.error) {
    object["error"] = *result.error;
  } else {
    object["results"] = result.value;
    name_not_finite(object["results"]);
  }
  const fs::path path = file_of(cell);
  fs::create_directories(path.parent_path());
  write_text(path, object.dump() + "\n");
}

}  // namespace hlm::experiments
