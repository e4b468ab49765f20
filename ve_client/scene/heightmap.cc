#include "hlm/ve_client/scene/heightmap.h"

#include <algorithm>

#include "hlm/ve_client/scene/grey_image.h"

namespace hlm::ve {
namespace {

/// Share of the way from the first to the last of `count`.
double share(std::size_t index, std::size_t count) {
  return static_cast<double>(index) / static_cast<double>(count - 1);
}

}  // namespace

Mesh read_heightmap(const std::filesystem::path& file, const Vector3& size) {
  const GreyImage image = read_grey_png(file, kMostHeightsAlong);
  const double brightest = std::ranges::max(image.pixels);
  const double scale = brightest > 0 ? 1 / brightest : 0;
  Mesh mesh;
  for (std::size_t row = 0; row < image.height; ++row) {
    for (std::size_t column = 0; column < image.width; ++column) {
      const Vector3 shares{share(column, image.width) - 0.5, 0.5 - share(row, image.height),
                           scale * image.pixels[row * image.width + column]};
      mesh.points.emplace_back(size.cwiseProduct(shares));
    }
  }
  const auto point = [&](std::size_t row, std::size_t column) {
    return static_cast<int>(row * image.width + column);
  };
  for (std::size_t row = 1; row < image.height; ++row) {
    for (std::size_t column = 1; column < image.width; ++column) {
      const int lower_left = point(row, column - 1);
      const int upper_right = point(row - 1, column);
      mesh.triangles.push_back({lower_left, point(row, column), upper_right});
      mesh.triangles.push_back({lower_left, upper_right, point(row - 1, column - 1)});
    }
  }
  mesh.find_around();
  return mesh;
}

}  // namespace hlm::ve
