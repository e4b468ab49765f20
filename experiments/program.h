// What computes cells.
#pragma once

#include <string>

namespace hlm::experiments {

/// Cells of one sweep have the same.
struct Program {
  std::string commit;
  std::string compiler;
  std::string flags;
  std::string executable;  ///< Hash of its file.
  std::string worlds;      ///< Hash of the files that it reads: worlds and hands.
};
/// 32 hexadecimal digits.
std::string hash_of(const std::string& bytes);
/// This one. Throws std::runtime_error if its file cannot be read.
const Program& program();

}  // namespace hlm::experiments
