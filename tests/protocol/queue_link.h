// A link whose other side is the test: it delivers datagrams from any peer and sees what was sent.
#pragma once

#include <cstddef>
#include <deque>
#include <span>
#include <stdexcept>
#include <vector>

#include "hlm/protocol/codec.h"
#include "hlm/protocol/datagram_link.h"

namespace hlm::test {

class QueueLink final : public protocol::DatagramLink {
 public:
  QueueLink() {
    // More than a test sends, so that sending does not allocate.
    constexpr std::size_t kSent = 4096;
    sent_.reserve(kSent);
  }

  bool receive(protocol::Datagram& datagram) noexcept override {
    if (waiting_.empty()) return false;
    datagram = waiting_.front();
    datagram.waited = waited_;
    waiting_.pop_front();
    return true;
  }
  void send(const protocol::Endpoint& to, std::span<const std::byte> bytes) noexcept override {
    sent_.push_back({.peer = to, .bytes = {bytes.begin(), bytes.end()}});
  }

  void deliver(const protocol::Endpoint& from, const protocol::DatagramBytes& bytes) {
    waiting_.push_back({.peer = from, .bytes = bytes});
  }
  /// All parts of a message.
  template <class Message>
  void deliver(const protocol::Endpoint& from, const protocol::Envelope& envelope,
               const Message& message) {
    for (std::uint8_t part = 0; part < protocol::part_count(message); ++part) {
      deliver(from, protocol::encode(envelope, message, part));
    }
  }

  /// How long every datagram has waited when it is received, s.
  void set_waited(double waited) { waited_ = waited; }
  std::size_t waiting() const { return waiting_.size(); }
  const std::vector<protocol::Datagram>& sent() const { return sent_; }
  /// Header of a sent datagram; the test fails elsewhere if it is refused.
  protocol::Header sent_header(std::size_t index) const {
    protocol::Header header;
    static_cast<void>(protocol::decode_header(protocol::view(sent_.at(index).bytes), header));
    return header;
  }
  /// The latest sent datagram as a message of type Message, which it must be.
  template <class Message>
  Message last_sent() const {
    Message message;
    if (sent_.empty() || protocol::decode(protocol::view(sent_.back().bytes), message)) {
      throw std::logic_error("the latest datagram is not the expected message");
    }
    return message;
  }
  void forget_sent() { sent_.clear(); }

 private:
  double waited_ = 0;
  std::deque<protocol::Datagram> waiting_;
  std::vector<protocol::Datagram> sent_;
};

}  // namespace hlm::test
