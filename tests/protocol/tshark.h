// What tshark with the project's dissector says about a capture.
#pragma once

#include <array>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <sys/wait.h>

namespace hlm::test {

inline bool tshark_is_installed() { return std::system("tshark --version > /dev/null 2>&1") == 0; }

/// What a command prints. Throws if it fails.
inline std::string output_of(const std::string& command) {
  std::FILE* const pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) throw std::runtime_error("cannot run: " + command);
  std::string output;
  std::array<char, 65536> chunk;
  while (const std::size_t count = std::fread(chunk.data(), 1, chunk.size(), pipe)) {
    output.append(chunk.data(), count);
  }
  if (pclose(pipe) != 0) throw std::runtime_error("failed: " + command);
  return output;
}

/// What `tshark <arguments>` prints about the capture. Throws if tshark fails.
inline std::string tshark(const std::filesystem::path& capture, const std::string& arguments) {
  // Names are not looked up (-n). As root tshark warns on stderr that it is.
  return output_of("tshark -n -X lua_script:" HLM_DISSECTOR " -r " + capture.string() + " " +
                   arguments + " 2> /dev/null");
}

inline std::vector<std::string> lines(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> result;
  for (std::string line; std::getline(stream, line);) result.push_back(line);
  return result;
}

/// A field without children, as the dissector shows it.
struct ShownField {
  std::string name;  ///< For example hlm.contact.separation.
  std::string text;  ///< With its label and the name of its value: "Type: hello (1)".
  std::string value;
  std::size_t position = 0;  ///< In the packet, bytes.
  std::size_t size = 0;      ///< Bytes.
};

/// The dissector's fields of each packet, in order.
inline std::vector<std::vector<ShownField>> dissect(const std::filesystem::path& capture) {
  // tshark writes one field a line; those without children end in "/>".
  const std::regex field(
      R"re(<field name="(hlm[^"]*)" showname="([^"]*)" size="(\d+)" pos="(\d+)" show="([^"]*)".*/>)re");
  std::vector<std::vector<ShownField>> packets;
  for (const std::string& line : lines(tshark(capture, "-T pdml"))) {
    if (line == "<packet>") packets.emplace_back();
    std::smatch match;
    if (!std::regex_search(line, match, field)) continue;
    packets.back().push_back({.name = match[1],
                              .text = match[2],
                              .value = match[5],
                              .position = std::stoul(match[4]),
                              .size = std::stoul(match[3])});
  }
  return packets;
}

/// The dissector's tables of names, by field: each name by its value. `configuration` is an empty
/// folder, where tshark finds the dissector as a plugin.
inline std::map<std::string, std::map<int, std::string>> dissector_names(
    const std::filesystem::path& configuration) {
  const std::filesystem::path plugins = configuration / "wireshark" / "plugins";
  std::filesystem::create_directories(plugins);
  std::filesystem::copy(HLM_DISSECTOR, plugins);
  std::map<std::string, std::map<int, std::string>> tables;
  const std::regex row(R"re(V\t(hlm\.[^\t]*)\t(\d+)\t(.*))re");
  const std::string command =
      "XDG_CONFIG_HOME=" + configuration.string() + " tshark -G values 2> /dev/null";
  for (const std::string& line : lines(output_of(command))) {
    std::smatch match;
    // Most lines are other protocols'.
    if (!line.starts_with("V\thlm.") || !std::regex_match(line, match, row)) continue;
    tables[match[1]][std::stoi(match[2])] = match[3];
  }
  return tables;
}

}  // namespace hlm::test
