// Where an element of an SDF file stands, for messages and rules.
#pragma once

#include <string>
#include <vector>

#include <sdf/Element.hh>

#include "hlm/ve_client/scene/diagnostics.h"

namespace hlm::ve {

/// The element and its ancestors that have names, for example "model 'a' link 'b' collision 'c'".
std::string describe(sdf::ElementPtr element);

/// Where an element stands: its line, or that of the nearest ancestor that has one.
Place place_of(const sdf::ElementPtr& element);

/// Names from <world> or the innermost <model> down: "model/link/inertial".
std::string path_of(const sdf::ElementPtr& element);

/// An element that has a name.
struct NamedElement {
  std::string type;
  std::string name;
};

/// Where the parser found something: what it says as "/sdf/model[@name="a"]/link[@name="b"]/…".
struct ParserPath {
  std::string path;                 ///< Path as path_of().
  std::vector<NamedElement> above;  ///< Those with names above the last.
  std::string last;                 ///< Name of the last element.
};
ParserPath parse_parser_path(const std::string& text);

/// "model 'a' link 'b'".
std::string describe(const std::vector<NamedElement>& elements);

}  // namespace hlm::ve
