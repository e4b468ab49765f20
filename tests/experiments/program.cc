#include "tests/experiments/program.h"

#include <array>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include <sodium.h>

#include "tests/experiments/commit.h"

namespace hlm::experiments {
namespace {

std::string hash_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  if (bytes.empty()) throw std::runtime_error(path + " cannot be read");
  std::array<unsigned char, 16> hash{};
  crypto_generichash(hash.data(), hash.size(), reinterpret_cast<const unsigned char*>(bytes.data()),
                     bytes.size(), nullptr, 0);
  std::array<char, 2 * hash.size() + 1> text{};
  sodium_bin2hex(text.data(), text.size(), hash.data(), hash.size());
  return text.data();
}

}  // namespace

const Program& program() {
  static const Program here{kCommit, HLM_COMPILER, HLM_FLAGS, hash_of("/proc/self/exe")};
  return here;
}

}  // namespace hlm::experiments
