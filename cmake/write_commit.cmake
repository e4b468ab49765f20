# Writes a header with the commit of the sources: cmake -D SOURCE=… -D HEADER=… -P write_commit.cmake
# It is written anew only where it changes.
execute_process(COMMAND git describe --always --dirty --abbrev=12 WORKING_DIRECTORY ${SOURCE}
  OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE status)
if(NOT status EQUAL 0)
  set(commit unknown)
endif()
file(CONFIGURE OUTPUT ${HEADER} CONTENT "#pragma once
namespace hlm::experiments {
inline constexpr const char* kCommit = \"${commit}\";
}
")
