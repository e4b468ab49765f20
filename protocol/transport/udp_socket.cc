// The one file that touches Boost.Asio. Boost 1.74 needs <utility> before it in C++20.
#include "hlm/protocol/transport/udp_socket.h"

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <ctime>
#include <stdexcept>
#include <utility>

#include <arpa/inet.h>
#include <boost/asio/ip/udp.hpp>
#include <netinet/in.h>
#include <sys/socket.h>

namespace hlm::protocol {
namespace {

namespace asio = boost::asio;
using asio::ip::udp;
using boost::system::error_code;

/// Asked of the system for received datagrams, bytes: some 200 datagrams of any size. More lets
/// more of a flood wait in front of the client's updates; less loses datagrams when the receiver
/// is held up for tens of milliseconds.
constexpr int kReceiveBuffer = 256 * 1024;

/// Errors skipped in one receive: each is a late report about a datagram sent before, such as
/// an unreachable port.
constexpr int kErrorsSkipped = 8;

udp::endpoint to_asio(const Endpoint& endpoint) noexcept {
  return {asio::ip::address_v4(endpoint.address), endpoint.port};
}

Endpoint from_asio(const udp::endpoint& endpoint) noexcept {
  if (!endpoint.address().is_v4()) return {};
  return {static_cast<std::uint32_t>(endpoint.address().to_v4().to_ulong()), endpoint.port()};
}

/// Whether an address names many machines rather than one, and how; null if it does not.
const char* describe_group(const Endpoint& endpoint) {
  if (asio::ip::address_v4(endpoint.address).is_multicast()) return "multicast";
  if (endpoint.address == 0) return nullptr;  // Every address of this machine.
  // Only the system knows the broadcast addresses of its networks: it connects to none unasked.
  asio::io_context context;
  udp::socket probe(context);
  error_code error;
  probe.open(udp::v4(), error);
  if (!error) probe.connect({asio::ip::address_v4(endpoint.address), 1}, error);
  constexpr std::uint32_t kEveryMachine = 0xFFFFFFFF;  // Without a route there is no denial.
  const bool broadcast = error == asio::error::access_denied || endpoint.address == kEveryMachine;
  return broadcast ? "broadcast" : nullptr;
}

std::uint16_t parse_port(const std::string& host_port, const std::string& port,
                         std::uint16_t lowest) {
  std::uint32_t value = 0;
  const char* const end = port.data() + port.size();
  const auto [parsed_to, error] = std::from_chars(port.data(), end, value);
  if (error != std::errc{} || parsed_to != end || value < lowest || value > 65535) {
    throw std::runtime_error("port \"" + port + "\" of \"" + host_port + "\" must be a number of " +
                             std::to_string(lowest) + " to 65535");
  }
  return static_cast<std::uint16_t>(value);
}

/// Seconds since the kernel stamped the datagram's arrival; 0 where it did not, or where the clock
/// was set since.
double waited_since_arrival(msghdr& message) noexcept {
  for (cmsghdr* item = CMSG_FIRSTHDR(&message); item != nullptr;
       item = CMSG_NXTHDR(&message, item)) {
    if (item->cmsg_level != SOL_SOCKET || item->cmsg_type != SCM_TIMESTAMPNS) continue;
    timespec arrival{};
    std::memcpy(&arrival, CMSG_DATA(item), sizeof arrival);
    timespec now{};
    clock_gettime(CLOCK_REALTIME, &now);
    const double waited = static_cast<double>(now.tv_sec - arrival.tv_sec) +
                          1e-9 * static_cast<double>(now.tv_nsec - arrival.tv_nsec);
    constexpr double kLongest = 1.0;  // Longer waits are a clock that was set.
    return waited >= 0 && waited <= kLongest ? waited : 0;
  }
  return 0;
}

/// This machine's address to which the datagram came, host byte order; 0 where it is not said.
std::uint32_t asked_address(msghdr& message) noexcept {
  for (cmsghdr* item = CMSG_FIRSTHDR(&message); item != nullptr;
       item = CMSG_NXTHDR(&message, item)) {
    if (item->cmsg_level != IPPROTO_IP || item->cmsg_type != IP_PKTINFO) continue;
    in_pktinfo information{};
    std::memcpy(&information, CMSG_DATA(item), sizeof information);
    return ntohl(information.ipi_spec_dst.s_addr);
  }
  return 0;
}

/// The address from which a datagram goes out, in the message's control buffer.
void send_from(std::uint32_t address, std::span<char> control, msghdr& message) noexcept {
  in_pktinfo information{};
  information.ipi_spec_dst.s_addr = htonl(address);
  message.msg_control = control.data();
  message.msg_controllen = CMSG_SPACE(sizeof information);
  cmsghdr* const item = CMSG_FIRSTHDR(&message);
  item->cmsg_level = IPPROTO_IP;
  item->cmsg_type = IP_PKTINFO;
  item->cmsg_len = CMSG_LEN(sizeof information);
  std::memcpy(CMSG_DATA(item), &information, sizeof information);
}

}  // namespace

struct UdpSocket::Socket {
  asio::io_context context;
  udp::socket socket{context};
  /// One byte longer than any of ours, to tell what is too long.
  std::array<std::byte, kMaxDatagram + 1> buffer;
};

UdpSocket::UdpSocket(const Endpoint& local) {
  error_code error;
  try {  // Asio's contexts have descriptors of their own.
    if (const char* const group = describe_group(local)) {
      throw std::runtime_error("cannot open UDP socket at " + to_string(local) + ": it is a " +
                               group + " address; give one of this machine, or 0.0.0.0 for all");
    }
    socket_ = std::make_unique<Socket>();
  } catch (const boost::system::system_error& failure) {
    throw std::runtime_error("cannot open UDP socket at " + to_string(local) + ": " +
                             failure.code().message());
  }
  udp::socket& socket = socket_->socket;
  socket.open(udp::v4(), error);
  if (!error) socket.bind(to_asio(local), error);
  if (!error) socket.non_blocking(true, error);
  if (error) {
    throw std::runtime_error("cannot open UDP socket at " + to_string(local) + ": " +
                             error.message());
  }
  // Where the system allows less, less will do.
  error_code ignored;
  socket.set_option(asio::socket_base::receive_buffer_size(kReceiveBuffer), ignored);
  const int on = 1;
  setsockopt(socket.native_handle(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  // One bound to an address is asked there, and answers from there.
  if (local.address == 0) {
    setsockopt(socket.native_handle(), IPPROTO_IP, IP_PKTINFO, &on, sizeof on);
  }
  local_ = from_asio(socket.local_endpoint());
}

UdpSocket::~UdpSocket() = default;

bool UdpSocket::receive(Datagram& datagram) noexcept {
  // Asio gives no control messages, and so no time of arrival and no address that was asked.
  alignas(cmsghdr) std::array<char, 128> control;
  sockaddr_in sender{};
  iovec part{socket_->buffer.data(), socket_->buffer.size()};
  for (int errors = 0; errors < kErrorsSkipped; ++errors) {
    msghdr message{};
    message.msg_name = &sender;
    message.msg_namelen = sizeof sender;
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t size = recvmsg(socket_->socket.native_handle(), &message, MSG_DONTWAIT);
    if (size < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return false;
    if (size < 0) continue;
    datagram.peer = {.address = ntohl(sender.sin_addr.s_addr),
                     .port = ntohs(sender.sin_port),
                     .asked = asked_address(message)};
    const auto received = static_cast<std::size_t>(size);
    const std::size_t kept = received <= kMaxDatagram ? received : 0;
    copy({socket_->buffer.data(), kept}, datagram.bytes);
    datagram.waited = waited_since_arrival(message);
    return true;
  }
  return false;
}

void UdpSocket::send(const Endpoint& to, std::span<const std::byte> bytes) noexcept {
  sockaddr_in receiver{};
  receiver.sin_family = AF_INET;
  receiver.sin_addr.s_addr = htonl(to.address);
  receiver.sin_port = htons(to.port);
  iovec part{const_cast<std::byte*>(bytes.data()), bytes.size()};  // Only read.
  msghdr message{};
  message.msg_name = &receiver;
  message.msg_namelen = sizeof receiver;
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(in_pktinfo))> control{};
  if (to.asked != 0) send_from(to.asked, control, message);
  sendmsg(socket_->socket.native_handle(), &message, MSG_NOSIGNAL);
}

Endpoint resolve(const std::string& host_port, std::uint16_t lowest_port) {
  const std::size_t colon = host_port.rfind(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == host_port.size()) {
    throw std::runtime_error("\"" + host_port + "\" must be HOST:PORT");
  }
  const std::string host = host_port.substr(0, colon);
  if (host.find(':') != std::string::npos) {
    throw std::runtime_error(
        "\"" + host_port +
        "\" looks like an IPv6 address, and only IPv4 is "
        "spoken: it must be HOST:PORT, HOST an IPv4 address or a name that has one");
  }
  const std::uint16_t port = parse_port(host_port, host_port.substr(colon + 1), lowest_port);
  asio::io_context context;
  udp::resolver resolver(context);
  error_code error;
  const auto found = resolver.resolve(udp::v4(), host, "", error);
  if (error || found.empty()) {
    throw std::runtime_error("host \"" + host + "\" has no known IPv4 address (" + error.message() +
                             ")");
  }
  return {from_asio(found.begin()->endpoint()).address, port};
}

bool is_loopback(const Endpoint& endpoint) noexcept {
  return asio::ip::address_v4(endpoint.address).is_loopback();
}

bool is_own_address(const Endpoint& endpoint) {
  try {
    UdpSocket({endpoint.address, 0});
    return true;
  } catch (const std::runtime_error&) {
    return false;
  }
}

std::string to_string(const Endpoint& endpoint) {
  return asio::ip::address_v4(endpoint.address).to_string() + ":" + std::to_string(endpoint.port);
}

}  // namespace hlm::protocol
