// What holds of every datagram that the codec accepts, and of every one that a program sends.
#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "hlm/protocol/codec.h"
#include "hlm/protocol/wire.h"
#include "tests/fuzz/fuzz.h"

namespace hlm::fuzz {

template <class Message>
void demand_in_range(const Message&) {}

inline void demand_in_range(const protocol::ProxyState& state) {
  demand(state.age >= 0 && state.hold >= 0, "a state's times are not negative");
  demand(std::abs(state.X_WD.R.norm() - 1) <= 1e-12, "a state's quaternion is unit");
  demand(state.q.allFinite() && state.v.allFinite() && state.F_command.allFinite(),
         "a state is finite");
}

inline void demand_in_range(const protocol::ContactUpdate& update) {
  demand(update.compute_time >= 0 && update.q_VE.allFinite(), "an update is finite");
  for (const ReportedContact& contact : update.contacts) {
    demand(std::abs(contact.n_W.norm() - 1) <= 1e-12, "a normal is unit");
    demand(std::abs(contact.separation) <= protocol::kLargestLength &&
               contact.p_WC.cwiseAbs().maxCoeff() <= protocol::kLargestLength &&
               contact.v_WC.cwiseAbs().maxCoeff() <= protocol::kLargestSpeed,
           "a contact is where things are");
    demand(std::isfinite(contact.friction) && contact.load >= 0, "friction and load are usable");
  }
  for (const BodyPose& pose : update.poses) {
    demand(std::abs(pose.X_WB.R.norm() - 1) <= 1e-12 &&
               pose.X_WB.p.cwiseAbs().maxCoeff() <= protocol::kLargestLength &&
               pose.V_W.cwiseAbs().maxCoeff() <= protocol::kLargestSpeed,
           "a pose is where things are");
  }
}

inline void demand_in_range(const protocol::SceneChunk& chunk) {
  demand(!chunk.data.empty(), "a chunk has data");
}

template <class Message>
std::vector<protocol::DatagramBytes> all_parts(const protocol::Envelope& envelope,
                                               const Message& message) {
  std::vector<protocol::DatagramBytes> parts;
  for (std::uint8_t part = 0; part < part_count(message); ++part) {
    parts.push_back(encode(envelope, message, part));
  }
  return parts;
}

/// Of all parts of a message, if they are one of this type: values in range, and what is encoded
/// again is decoded as the same.
template <class Message>
bool demand_decodes(std::span<const protocol::DatagramBytes> parts,
                    const protocol::Header& header) {
  Message message;
  if (decode(parts, message)) return false;
  demand_in_range(message);
  const std::vector<protocol::DatagramBytes> again = all_parts(header.envelope, message);
  Message second;
  demand(!decode(again, second), "what was decoded can be encoded");
  demand(all_parts(header.envelope, second) == again, "what is encoded is decoded as the same");
  return true;
}

/// Whether the codec takes these parts as a message.
inline bool demand_decodes(std::span<const protocol::DatagramBytes> parts) {
  using protocol::MessageType;
  protocol::Header header;
  if (decode_header(protocol::view(parts[0]), header)) return false;
  switch (header.type) {
    case MessageType::kHello:
      return demand_decodes<protocol::Hello>(parts, header);
    case MessageType::kWelcome:
      return demand_decodes<protocol::Welcome>(parts, header);
    case MessageType::kReject:
      return demand_decodes<protocol::Reject>(parts, header);
    case MessageType::kContactUpdate:
      return demand_decodes<protocol::ContactUpdate>(parts, header);
    case MessageType::kProxyState:
      return demand_decodes<protocol::ProxyState>(parts, header);
    case MessageType::kGoodbye:
      return demand_decodes<protocol::Goodbye>(parts, header);
    case MessageType::kControl:
      return demand_decodes<protocol::Control>(parts, header);
    case MessageType::kTicks:
      return demand_decodes<protocol::Ticks>(parts, header);
    case MessageType::kLocalState:
      return demand_decodes<protocol::LocalState>(parts, header);
    case MessageType::kRefusal:
      return demand_decodes<protocol::Refusal>(parts, header);
    case MessageType::kImpulses:
      return demand_decodes<protocol::Impulses>(parts, header);
    case MessageType::kSceneChunk:
      return demand_decodes<protocol::SceneChunk>(parts, header);
    case MessageType::kSceneState:
      return demand_decodes<protocol::SceneState>(parts, header);
    case MessageType::kHeldBodies:
      return demand_decodes<protocol::HeldBodies>(parts, header);
  }
  return false;
}

/// A program sends whole messages that the other side takes.
inline void demand_sent_well(const std::vector<protocol::Datagram>& sent) {
  std::vector<protocol::DatagramBytes> parts;
  for (const protocol::Datagram& datagram : sent) {
    protocol::Header header;
    demand(!decode_header(protocol::view(datagram.bytes), header), "what is sent has a header");
    demand(header.part == parts.size(), "parts are sent in order");
    parts.push_back(datagram.bytes);
    if (header.part + 1 < header.parts) continue;
    demand(demand_decodes(parts), "what is sent can be decoded");
    parts.clear();
  }
}

}  // namespace hlm::fuzz
