#include "hlm/ve_client/run/status.h"

#include <stdexcept>

#include "tests/support/catch.h"

namespace hlm::ve {
namespace {

HapticClient::Inbox rejection(protocol::RejectReason reason) {
  HapticClient::Inbox inbox;
  inbox.reject.emplace();
  inbox.reject->reason = reason;
  inbox.reject->version = protocol::kProtocolVersion;
  return inbox;
}

TEST_CASE("A hello that was damaged on its way, and so refused, does not end the client") {
  const auto reason = GENERATE(protocol::RejectReason::kVersion, protocol::RejectReason::kTool);
  const auto refused = rejection(reason);
  const auto busy = rejection(protocol::RejectReason::kBusy);
  Connection connection("127.0.0.1:47800", "", 0, false);
  connection.watch(0.1, refused, false);
  connection.watch(0.2, busy, false);
  connection.watch(0.3, refused, false);
  HapticClient::Inbox welcome;
  welcome.welcomed = true;
  connection.watch(0.4, welcome, true);
  connection.watch(0.5, refused, false);
  CHECK_THROWS_AS(connection.watch(0.6, refused, false), std::runtime_error);
}

}  // namespace
}  // namespace hlm::ve
