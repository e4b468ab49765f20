// Images for tests, in files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <vector>

#include <png.h>

namespace hlm::test {

/// Writes a PNG image whose samples are those given, row by row from the top. `format`: libpng's,
/// PNG_FORMAT_LINEAR_Y with 16 bits a sample, the others with 8.
template <class Sample>
void write_png(const std::filesystem::path& file, unsigned width, unsigned height,
               const std::vector<Sample>& samples,
               unsigned format = sizeof(Sample) == 2 ? PNG_FORMAT_LINEAR_Y : PNG_FORMAT_GRAY) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = width;
  image.height = height;
  image.format = format;
  if (png_image_write_to_file(&image, file.c_str(), 0, samples.data(), 0, nullptr) == 0) {
    throw std::runtime_error(file.string() + ": " + image.message);
  }
}

}  // namespace hlm::test
