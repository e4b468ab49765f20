// Work on files that may crash a library.
#pragma once

#include <functional>
#include <string>

namespace hlm::ve {

/// What `make` returns, made in a process of its own: where a library crashes or never ends, that
/// process does, and this one goes on. Throws std::runtime_error with what `make` threw, or one
/// line about how it ended. `make` must not start threads nor write to files. Where no process can
/// be had it runs in this one.
std::string made_in_child(const std::function<std::string()>& make);

}  // namespace hlm::ve
