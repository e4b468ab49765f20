// Where the programs keep what outlives a run, and what belongs to a running one.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

namespace hlm::settings {

/// What outlives a run of haptic_server: $STATE_DIRECTORY, which systemd gives a service, else
/// $XDG_STATE_HOME/haptic_server, else ~/.local/state/haptic_server. Empty without any of them.
std::filesystem::path state_directory();

/// What belongs to a running haptic_server: $RUNTIME_DIRECTORY, which systemd gives a service, else
/// $XDG_RUNTIME_DIR/haptic_server, else, for root alone, /run/haptic_server. Empty without any.
std::filesystem::path runtime_directory();

/// Where servers on this machine may keep the same: those of this user, of the service and, for
/// what runs, of the service's instances and of other users.
std::vector<std::filesystem::path> state_directories();
std::vector<std::filesystem::path> runtime_directories();

/// Begin and end of a flight recording's file name. Between them is the time, UTC: the last name is
/// the latest.
inline constexpr const char* kRecordingPrefix = "flight-";
inline constexpr const char* kRecordingSuffix = ".csv";

/// The flight recordings in a directory, oldest first; none if it cannot be read.
std::vector<std::filesystem::path> find_recordings(const std::filesystem::path& directory);

/// The latest of several directories.
std::optional<std::filesystem::path> find_newest_recording(
    const std::vector<std::filesystem::path>& directories);

}  // namespace hlm::settings
