// Configuration files of both programs. What is taken and printed is read back as the same.
#include <iostream>
#include <sstream>
#include <string>

#include "hlm/haptic_server/options.h"
#include "hlm/ve_client/run/settings.h"
#include "tests/fuzz/fuzz.h"

namespace hlm::fuzz {
namespace {

/// What the programs print while it lives.
class Printed {
 public:
  Printed() : out_(std::cout.rdbuf(text_.rdbuf())), error_(std::cerr.rdbuf(text_.rdbuf())) {}
  Printed(const Printed&) = delete;
  Printed& operator=(const Printed&) = delete;
  ~Printed() {
    std::cout.rdbuf(out_);
    std::cerr.rdbuf(error_);
  }

  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
  std::streambuf* out_;
  std::streambuf* error_;
};

struct Outcome {
  int code = 0;
  std::string text;  ///< The configuration, or the error.
};

using Program = int (*)(const std::string& path);

int run_server(const std::string& path) {
  server::ServerOptions options;
  settings::CommandLine command_line({.name = "haptic_server", .purpose = "", .footer = ""});
  add_options(command_line, options);
  const char* const arguments[] = {"haptic_server", "--config", path.c_str(), "--print-config"};
  return command_line.parse(4, arguments, [&] { check(options); }).value_or(0);
}

int run_client(const std::string& path) {
  const char* const arguments[] = {"ve_client", "--config", path.c_str(), "--print-config"};
  return ve::parse_arguments(4, arguments).exit_code;
}

Outcome run(Program program, const std::string& path) {
  const Printed printed;
  const int code = program(path);
  return {code, printed.text()};
}

void read(Program program, const std::string& path) {
  const Outcome first = run(program, path);
  if (first.code != 0) {
    demand(first.code == settings::kUsageError, "a bad configuration is wrong usage");
    demand(first.text.find('\n') + 1 == first.text.size(), "an error is one line");
    return;
  }
  ++accepted;
  const auto* const text = reinterpret_cast<const std::uint8_t*>(first.text.data());
  const MemoryFile file({text, first.text.size()});
  const Outcome second = run(program, file.path());
  demand(second.code == 0 && second.text == first.text, "a printed configuration reads as itself");
}

}  // namespace
}  // namespace hlm::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace hlm::fuzz;
  return give_file(
      data, size, [](const std::string& path) { read(run_server, path); },
      [](const std::string& path) { read(run_client, path); });
}
