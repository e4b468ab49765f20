// What a person should know of a session: why there is none, what was refused, what has ended.
#pragma once

#include <optional>
#include <string>

#include "hlm/client/haptic_client.h"

namespace hlm {

class SessionNews {
 public:
  /// server: "HOST:PORT". key_file: the key's; empty: none.
  SessionNews(std::string server, std::string key_file)
      : server_(std::move(server)), key_file_(std::move(key_file)) {}

  /// Call after each poll of the client, with the same `now`.
  void hear(double now, const HapticClient& client, const HapticClient::Inbox& inbox);
  /// One line, without a line break; empty if there is nothing to say. It stays until there is
  /// other news or a session begins.
  const std::string& text() const noexcept { return text_; }

 private:
  std::string silence() const;

  std::string server_;
  std::string key_file_;
  std::string text_;
  std::optional<double> asked_at_;  ///< When nobody had answered first, s.
  bool had_session_ = false;
};

}  // namespace hlm
