// The vector of PROTOCOL.md's section on sealing, and the examples that it seals.
#pragma once

#include <algorithm>
#include <cstddef>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

#include "hlm/protocol/sealing/noise.h"
#include "tests/protocol/transport/capture_files.h"

namespace hlm::test {

inline protocol::noise::Key key_from_hex(const std::string& text) {
  const std::vector<std::byte> bytes = from_hex(text);
  protocol::noise::Key key;
  if (bytes.size() != key.size()) throw std::invalid_argument("no key: " + text);
  std::copy(bytes.begin(), bytes.end(), key.begin());
  return key;
}

class DocumentVector {
 public:
  DocumentVector() {
    std::ifstream file(HLM_PROTOCOL_DOCUMENT);
    document_.assign(std::istreambuf_iterator<char>(file), {});
  }

  std::vector<std::byte> value(const std::string& name) const {
    return from_hex(line_after("### Vector: sealing", "\n" + name + " = "));
  }
  protocol::noise::Key key(const std::string& name) const {
    return key_from_hex(line_after("### Vector: sealing", "\n" + name + " = "));
  }
  /// The bytes of an example.
  std::vector<std::byte> example(const std::string& name) const {
    const std::size_t begin = find("```hex\n", find("### Example: " + name + "\n", 0)) + 7;
    std::string digits = document_.substr(begin, find("```", begin) - begin);
    std::erase(digits, '\n');
    return from_hex(digits);
  }

 private:
  std::size_t find(const std::string& text, std::size_t from) const {
    const std::size_t at = document_.find(text, from);
    if (at == std::string::npos) throw std::runtime_error("the document lacks " + text);
    return at;
  }
  std::string line_after(const std::string& heading, const std::string& name) const {
    const std::size_t begin = find(name, find(heading, 0)) + name.size();
    return document_.substr(begin, find("\n", begin) - begin);
  }

  std::string document_;
};

}  // namespace hlm::test
