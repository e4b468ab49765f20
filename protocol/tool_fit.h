// Whether a message belongs to the session's tool: lengths, unit quaternions, links.
#pragma once

#include <cstddef>
#include <optional>

#include "hlm/common/sentence.h"
#include "hlm/common/tool_description.h"
#include "hlm/common/tool_model.h"
#include "hlm/protocol/messages.h"

namespace hlm::protocol {

/// Makes the quaternion in q of a free root exactly unit where it nearly is.
void normalize(const ToolDescription& tool, Configuration& q) noexcept;
/// Whether q has the tool's length and, of a free root, a unit quaternion.
bool fits(const ToolDescription& tool, const Configuration& q) noexcept;
/// The part of an update that does not fit the tool: its q or v as a whole, or one contact, which
/// the local model then leaves out.
struct UpdateMisfit {
  UpdateError error = UpdateError::kNone;
  bool whole = true;
  std::size_t contact = 0;  ///< The first one, if not `whole`.
};
std::optional<UpdateMisfit> find_misfit(const ToolDescription& tool,
                                        const ContactUpdate& update) noexcept;
/// Removes poses of a body that has one before them; the index of the first, empty if there is
/// none.
std::optional<std::size_t> leave_out_copies(BodyPoses& poses) noexcept;
bool fits(const ToolDescription& tool, const ProxyState& state) noexcept;

/// Why a hello cannot be used, naming the value and what is allowed; empty if it can. Allocates
/// nothing.
std::optional<Sentence> find_error(const Hello& hello);

}  // namespace hlm::protocol
