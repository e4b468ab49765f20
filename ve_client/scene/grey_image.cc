#include "hlm/ve_client/scene/grey_image.h"

#include <array>
#include <cerrno>
#include <csetjmp>
#include <cstdio>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <system_error>

#include <png.h>

#include "hlm/common/one_line.h"

namespace hlm::ve {
namespace {

constexpr std::size_t kSignature = 8;  // Bytes with which a PNG file begins.

/// libpng's state while it reads a file.
class PngFile {
 public:
  explicit PngFile(const std::filesystem::path& path)
      : name_(path.string()), file_(std::fopen(name_.c_str(), "rb"), &std::fclose) {
    if (file_ == nullptr) fail(std::generic_category().message(errno));
    std::array<png_byte, kSignature> begin{};
    const std::size_t count = std::fread(begin.data(), 1, begin.size(), file_.get());
    if (count < kSignature || png_sig_cmp(begin.data(), 0, kSignature) != 0) {
      fail("is not a PNG file");
    }
    handles_.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &error_, &on_error, &on_warning);
    if (handles_.png != nullptr) handles_.info = png_create_info_struct(handles_.png);
    if (handles_.info == nullptr) throw std::bad_alloc();
  }

  GreyImage read(std::size_t most_side) {
    const png_structp png = handles_.png;
    const png_infop info = handles_.info;
    std::FILE* const file = file_.get();
    call([=] {
      png_init_io(png, file);
      png_set_sig_bytes(png, kSignature);
      png_read_info(png, info);
    });
    GreyImage image{png_get_image_width(png, info), png_get_image_height(png, info), {}};
    require_side("width", image.width, most_side);
    require_side("height", image.height, most_side);
    const bool coloured = (png_get_color_type(png, info) & PNG_COLOR_MASK_COLOR) != 0;
    call([=] {
      constexpr int kAnyWeight = -1;  // Weights of the colours: they must be equal.
      png_set_expand(png);
      png_set_strip_alpha(png);
      if (coloured) png_set_rgb_to_gray(png, PNG_ERROR_ACTION_NONE, kAnyWeight, kAnyWeight);
      png_set_interlace_handling(png);
      png_read_update_info(png, info);
    });
    const std::size_t pitch = png_get_rowbytes(png, info);
    std::vector<png_byte> bytes(pitch * image.height);
    std::vector<png_bytep> rows;
    for (std::size_t row = 0; row < image.height; ++row) rows.push_back(&bytes[row * pitch]);
    call([png, first = rows.data()] {
      png_read_image(png, first);
      png_read_end(png, nullptr);
    });
    if (coloured && png_get_rgb_to_gray_status(png) != 0) {
      fail("has colours; allowed are shades of grey");
    }
    const bool wide = png_get_bit_depth(png, info) == 16;  // Else 8.
    image.pixels.reserve(image.width * image.height);
    for (std::size_t i = 0; i < image.width * image.height; ++i) {
      image.pixels.push_back(wide ? (256 * bytes[2 * i] + bytes[2 * i + 1]) / 65535.0
                                  : bytes[i] / 255.0);
    }
    return image;
  }

 private:
  struct Handles {
    Handles() = default;
    Handles(const Handles&) = delete;
    Handles& operator=(const Handles&) = delete;
    ~Handles() { png_destroy_read_struct(&png, &info, nullptr); }
    png_structp png = nullptr;
    png_infop info = nullptr;
  };

  static void on_error(png_structp png, png_const_charp message) {
    *static_cast<std::string*>(png_get_error_ptr(png)) = message;
    png_longjmp(png, 1);
  }
  static void on_warning(png_structp /*png*/, png_const_charp /*message*/) {}

  /// Calls libpng, which leaves `calls` by a jump if something is wrong: it may own nothing.
  template <class Calls>
  void call(const Calls& calls) {
    if (setjmp(png_jmpbuf(handles_.png)) != 0) fail(error_);
    calls();
  }
  void require_side(const char* what, std::size_t pixels, std::size_t most) const {
    if (pixels >= 2 && pixels <= most) return;
    fail(std::string(what) + " " + std::to_string(pixels) + " pixels must be 2 to " +
         std::to_string(most) + " pixels: scale the image");
  }
  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(one_line("image " + name_ + ": " + what));
  }

  std::string name_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  std::string error_;  ///< Error of libpng.
  Handles handles_;
};

}  // namespace

GreyImage read_grey_png(const std::filesystem::path& file, std::size_t most_side) {
  return PngFile(file).read(most_side);
}

}  // namespace hlm::ve
