#include "hlm/common/settings/directories.h"

#include <algorithm>
#include <cstdlib>
#include <string>

#include <unistd.h>

namespace hlm::settings {
namespace {

constexpr const char* kName = "haptic_server";

/// Empty if unset. systemd separates several directories by colons; the first is ours.
std::filesystem::path variable(const char* name) {
  const char* value = std::getenv(name);
  if (value == nullptr) return {};
  const std::string text = value;
  return text.substr(0, text.find(':'));
}

std::vector<std::filesystem::path> with(std::filesystem::path own, const char* of_service) {
  std::vector<std::filesystem::path> all;
  if (!own.empty()) all.push_back(std::move(own));
  if (all.empty() || all.front() != of_service) all.emplace_back(of_service);
  return all;
}

/// In no order; none of what cannot be read.
std::vector<std::filesystem::path> entries(const std::filesystem::path& directory) {
  std::vector<std::filesystem::path> all;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(directory, error), end; !error && entry != end;
       entry.increment(error)) {
    all.push_back(entry->path());
  }
  return all;
}

}  // namespace

std::filesystem::path state_directory() {
  if (const auto given = variable("STATE_DIRECTORY"); !given.empty()) return given;
  if (const auto state = variable("XDG_STATE_HOME"); !state.empty()) return state / kName;
  if (const auto home = variable("HOME"); !home.empty()) return home / ".local/state" / kName;
  return {};
}

std::filesystem::path runtime_directory() {
  if (const auto given = variable("RUNTIME_DIRECTORY"); !given.empty()) return given;
  if (const auto own = variable("XDG_RUNTIME_DIR"); !own.empty()) return own / kName;
  return geteuid() == 0 ? "/run/haptic_server" : "";
}

std::vector<std::filesystem::path> state_directories() {
  return with(state_directory(), "/var/lib/haptic_server");
}

std::vector<std::filesystem::path> runtime_directories() {
  std::vector<std::filesystem::path> all = with(runtime_directory(), "/run/haptic_server");
  for (const std::filesystem::path& entry : entries("/run")) {
    // Those of haptic_server@.service.
    if (entry.filename().string().starts_with(std::string(kName) + '@')) all.push_back(entry);
  }
  for (const std::filesystem::path& user : entries("/run/user")) all.push_back(user / kName);
  return all;
}

std::vector<std::filesystem::path> find_recordings(const std::filesystem::path& directory) {
  std::vector<std::filesystem::path> recordings;
  for (const std::filesystem::path& file : entries(directory)) {
    const std::string name = file.filename();
    if (name.starts_with(kRecordingPrefix) && name.ends_with(kRecordingSuffix)) {
      recordings.push_back(file);
    }
  }
  std::sort(recordings.begin(), recordings.end());
  return recordings;
}

std::optional<std::filesystem::path> find_newest_recording(
    const std::vector<std::filesystem::path>& directories) {
  std::optional<std::filesystem::path> newest;
  for (const std::filesystem::path& directory : directories) {
    const auto found = find_recordings(directory);
    if (found.empty()) continue;
    if (!newest || newest->filename() < found.back().filename()) newest = found.back();
  }
  return newest;
}

}  // namespace hlm::settings
