// What a session has around it: a clock, and a link to its server.
#pragma once

#include <memory>
#include <string>

#include "hlm/protocol/datagram_link.h"

namespace hlm {

class Surroundings {
 public:
  virtual ~Surroundings() = default;

  /// The time as a frame begins, s, any steady origin.
  virtual double begin_frame() = 0;
  /// The time within it, s.
  virtual double now() = 0;
  virtual protocol::DatagramLink& link() = 0;
  /// Where the server is on that link.
  virtual protocol::Endpoint server() const = 0;
  /// How a person knows it.
  virtual std::string name() const = 0;
  /// Whether a server may be there already; if not, the session starts its own.
  virtual bool may_have_server() const = 0;
};

/// Those of a session with the server at an address, of frames of `period` seconds. Each library
/// with the C interface has its own. Throws std::runtime_error or std::invalid_argument if there is
/// no such server.
std::unique_ptr<Surroundings> surroundings_at(const std::string& address, double period);
/// The machine's clock, and a UDP socket. Throws std::runtime_error.
std::unique_ptr<Surroundings> real_surroundings(const std::string& address);

}  // namespace hlm
