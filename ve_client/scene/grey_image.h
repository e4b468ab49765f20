// The pixels of a grey image from a file.
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

namespace hlm::ve {

struct GreyImage {
  std::size_t width = 0;
  std::size_t height = 0;
  std::vector<double> pixels;  ///< Row by row from the top, each from the left; 0: black, 1: white.
};

/// Reads a PNG file of any depth, at its samples' own values: a gamma in the file does not count.
/// It may be stored with colours if all of them are grey; transparency is ignored. Throws
/// std::runtime_error with one line that names the file if it cannot be read, has other colours, or
/// a side that is not 2 to `most_side` pixels long.
GreyImage read_grey_png(const std::filesystem::path& file, std::size_t most_side);

}  // namespace hlm::ve
