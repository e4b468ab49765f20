// The codec: any bytes as the parts of a message.
#include "tests/fuzz/promises.h"

/// A datagram, or several, each after its size (2 bytes, little-endian).
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace hlm;
  fuzz::Input input(data, size);
  std::vector<protocol::DatagramBytes> parts;
  while (!input.empty() && parts.size() < protocol::kMaxParts) {
    const std::size_t length = std::min<std::size_t>(input.u16(), protocol::kMaxDatagram);
    protocol::DatagramBytes& part = parts.emplace_back();
    for (const std::uint8_t byte : input.take(length)) part.push_back(std::byte{byte});
    static_cast<void>(protocol::read_stable_part(protocol::view(part)));
  }
  if (!parts.empty() && fuzz::demand_decodes(parts)) ++fuzz::accepted;
  return 0;
}
