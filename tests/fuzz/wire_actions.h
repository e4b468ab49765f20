// What happens on the wire between sealed links: the input of the target `sealing`.
#pragma once

#include <cstdint>
#include <vector>

namespace hlm::fuzz {

enum class WireAction : std::uint8_t {
  kSay,       ///< Client `whom` sends a text of `size` bytes.
  kAnswer,    ///< The server sends a text of `size` bytes to the peer that it heard last.
  kPass,      ///< Packet `which` of all that were sent arrives where it was sent to.
  kAlter,     ///< So it does with `size` bytes cut or added, and the byte at `place` changed.
  kRedirect,  ///< It arrives at the server from the address of client `whom`.
  kReflect,   ///< It arrives at client `whom`.
  kInvent,  ///< So does a packet of the `size` bytes that follow at the server, from client `whom`.
  kWait,    ///< For 4 ms times `place`.
  kKeep,    ///< The server's session is with the peer that it heard last.
  kForget,  ///< Client `whom`, or the server, forgets the other.
};
inline constexpr std::uint8_t kWireActions = 10;

/// As bytes: the fields in this order, and of kInvent as many more as `size`.
struct WireStep {
  WireAction action{};
  std::uint8_t whom = 0;
  std::uint8_t which = 0;  ///< Counted back from the latest: 0.
  std::uint8_t size = 0;
  std::uint8_t place = 0;

  void write_to(std::vector<std::uint8_t>& bytes) const {
    bytes.insert(bytes.end(), {static_cast<std::uint8_t>(action), whom, which, size, place});
  }
};

}  // namespace hlm::fuzz
