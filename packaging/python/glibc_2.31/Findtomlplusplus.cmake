# toml++ from its headers alone: its library needs a newer system.
add_library(tomlplusplus::tomlplusplus INTERFACE IMPORTED)
set(tomlplusplus_FOUND TRUE)
