// A tool's session with its server: the socket, what is around it, and what is said of it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "hlm/client/haptic_client.h"
#include "hlm/protocol/sealing/sealed_client_link.h"
#include "hlm/protocol/transport/capture.h"
#include "hlm/protocol/transport/impaired_link.h"
#include "hlm/protocol/transport/recording_link.h"
#include "hlm/protocol/transport/udp_socket.h"
#include "hlm/ve_client/run/settings.h"
#include "hlm/ve_client/run/status.h"

namespace hlm::ve {

/// The endpoint that an option gives; `example` is one. Throws UsageError with one line.
protocol::Endpoint resolved(const char* option, const std::string& value, const char* example);

class ToolSession {
 public:
  /// What all sessions of a run have in common.
  struct Common {
    std::optional<protocol::noise::Key> key;
    std::string key_file;
    double connect_timeout = 0;    ///< s; 0: for ever.
    bool tool_may_change = false;  ///< A page can choose another scene.
    bool alone = true;             ///< It is the only session.
    std::function<double()> now;   ///< s since the start.
  };

  /// seed: of the network's conditions. Throws std::runtime_error with one line if the capture file
  /// cannot be begun.
  ToolSession(const ToolSettings& settings, const protocol::Endpoint& server, std::uint64_t seed,
              Common common);

  /// A session for the tool, as it is; one that there is ends. `options`: without the server.
  void begin(HapticClientOptions options, const ToolAssembly& tool);
  /// After a frame: says what happened. Throws as Connection::watch() does.
  void report(const FrameResult& result, const VirtualTool& tool, const Proximity& proximity);
  /// Ends the session: the goodbye is not held back.
  void close();
  /// The run is over. Throws as Connection::end() does.
  void require_connected() const { connection_.end(now_()); }

  HapticClient& client() { return *client_; }
  ImpairedLink& link() { return link_; }

 private:
  /// A capture file and the link whose datagrams it gets.
  struct Recording {
    Recording(const std::string& path, protocol::DatagramLink& passed,
              const protocol::Endpoint& local)
        : file(path), link(passed, local) {}

    protocol::CaptureWriter file;
    protocol::RecordingLink link;
  };

  /// The socket, sealed and recorded as the settings say.
  protocol::DatagramLink& wire(const ToolSettings& settings,
                               const std::optional<protocol::noise::Key>& key);

  std::function<double()> now_;
  protocol::Endpoint server_;
  protocol::UdpSocket socket_{protocol::Endpoint{}};
  std::optional<protocol::SealedClientLink> sealed_;
  std::optional<Recording> recording_;
  ImpairedLink link_;
  std::optional<HapticClient> client_;
  Connection connection_;
  Status status_;
  std::string scene_problem_;  ///< As it was said last.
};

}  // namespace hlm::ve
