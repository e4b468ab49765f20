// What becomes of each element of an SDF file. docs/worlds.md shows the same table to users.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "hlm/ve_client/scene/diagnostics.h"

namespace hlm::ve {

/// What becomes of an element and of all below it that has no rule of its own.
struct ElementRule {
  /// Names from <world> or <model> down, with slashes: "model/link/inertial". A nested model's
  /// begin at that model.
  std::string_view path;
  std::optional<Verdict> verdict;  ///< Empty: it is used.
  std::string_view note;           ///< What is done instead, or how to do without it.
};

/// All rules. Elements without one are named and not read, as in Gazebo: they are not part of
/// SDFormat, or misspelt. Those of our own are refused.
std::span<const ElementRule> element_rules();

/// The rule of an element, its own or the nearest above it; null if there is none. Where the
/// element above has rules for its children, an element must have its own. Elements of other
/// programs, with a colon in their names, are ignored; ours begin with "haptic:".
const ElementRule* find_rule(std::string_view path);

/// Whether an element is read.
bool is_used(std::string_view path);

/// Tag for messages: "<name>".
std::string tag(std::string_view name);

/// Text for messages: the elements that have rules besides this one, as "allowed: <a>, <b>", or how
/// that cannot be said.
std::string allowed_beside(std::string_view path);

}  // namespace hlm::ve
