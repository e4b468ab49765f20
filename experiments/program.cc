#include "experiments/program.h"

#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <stdexcept>

#include <sodium.h>

#include "experiments/commit.h"
#include "tests/support/worlds.h"

namespace hlm::experiments {
namespace {

std::string read(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  if (!file) throw std::runtime_error(path.string() + " cannot be read");
  return bytes;
}

/// Names and contents.
std::string hash_of_worlds() {
  std::set<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(test::worlds_folder())) {
    if (entry.is_regular_file()) files.insert(entry.path());
  }
  std::string all;
  for (const std::filesystem::path& file : files) {
    all += std::filesystem::relative(file, test::worlds_folder()).string() + hash_of(read(file));
  }
  return hash_of(all);
}

}  // namespace

std::string hash_of(const std::string& bytes) {
  std::array<unsigned char, 16> hash{};
  crypto_generichash(hash.data(), hash.size(), reinterpret_cast<const unsigned char*>(bytes.data()),
                     bytes.size(), nullptr, 0);
  std::array<char, 2 * hash.size() + 1> text{};
  sodium_bin2hex(text.data(), text.size(), hash.data(), hash.size());
  return text.data();
}

const Program& program() {
  static const Program here{kCommit, HLM_COMPILER, HLM_FLAGS, hash_of(read("/proc/self/exe")),
                            hash_of_worlds()};
  return here;
}

}  // namespace hlm::experiments
