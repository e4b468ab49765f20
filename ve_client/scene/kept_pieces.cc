#include "hlm/ve_client/scene/kept_pieces.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <limits>
#include <sstream>
#include <string>

#include <unistd.h>

#include "hlm/geometry/hull.h"

namespace hlm::ve {
namespace {

namespace fs = std::filesystem;

/// Raised where the same mesh and parameters give other pieces, or files another form.
constexpr double kVersion = 2;
/// Most pieces of a file.
constexpr std::size_t kMostPieces = 20'000;
constexpr const char* kExtension = ".hulls";
/// What a program left that was ended as it wrote.
constexpr std::chrono::hours kLeftOver{1};

/// FNV-1a.
class Fingerprint {
 public:
  void add(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) hash_ = (hash_ ^ bytes[i]) * 0x100000001B3u;
  }
  std::string text() const {
    std::ostringstream text;
    text << std::hex << std::setw(16) << std::setfill('0') << hash_;
    return text.str();
  }

 private:
  std::uint64_t hash_ = 0xCBF29CE484222325u;
};

std::string fingerprint(const std::string& text) {
  Fingerprint print;
  print.add(text.data(), text.size());
  return print.text();
}

/// Each piece: the number of its vertices, and these. None if the text does not hold such.
std::optional<std::vector<Hull>> parse(const std::string& text) {
  std::istringstream in(text);
  std::size_t pieces = 0;
  if (!(in >> pieces) || pieces == 0 || pieces > kMostPieces) return std::nullopt;
  std::vector<Hull> hulls(pieces);
  for (Hull& hull : hulls) {
    std::size_t count = 0;
    if (!(in >> count) || count > kMaxHullVertices) return std::nullopt;
    hull.vertices.resize(count);
    for (Vector3& p : hull.vertices) {
      if (!(in >> p.x() >> p.y() >> p.z()) || !p.allFinite()) return std::nullopt;
    }
  }
  const auto is_solid = [](const Hull& hull) { return has_inside(hull.vertices); };
  if (!std::ranges::all_of(hulls, is_solid)) return std::nullopt;
  return hulls;
}

std::string text_of(const std::vector<Hull>& hulls) {
  std::ostringstream out;
  out << std::setprecision(std::numeric_limits<double>::max_digits10) << hulls.size() << "\n";
  for (const Hull& hull : hulls) {
    out << hull.vertices.size() << "\n";
    for (const Vector3& p : hull.vertices) out << p.x() << " " << p.y() << " " << p.z() << "\n";
  }
  return out.str();
}

struct KeptFile {
  fs::path path;
  fs::file_time_type used;
  std::uintmax_t size = 0;
};

/// Removes what is left over and, from the longest unused one on, what is too much. `newest` stays.
void tidy(const fs::path& newest, std::uintmax_t most) {
  std::vector<KeptFile> files;
  std::uintmax_t sum = 0;
  std::error_code ignored;
  const auto now = fs::file_time_type::clock::now();
  for (fs::directory_iterator entry(newest.parent_path(), ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    std::error_code gone;
    const KeptFile file{entry->path(), entry->last_write_time(gone), entry->file_size(gone)};
    if (gone || file.path.filename().string().find(kExtension) == std::string::npos) continue;
    if (file.path.extension() == kExtension) {
      files.push_back(file);
      sum += file.size;
    } else if (now - file.used > kLeftOver) {
      fs::remove(file.path, gone);
    }
  }
  std::ranges::sort(files, {}, &KeptFile::used);
  for (const KeptFile& file : files) {
    if (sum <= most) return;
    if (file.path == newest) continue;
    fs::remove(file.path, ignored);
    sum -= file.size;
  }
}

}  // namespace

fs::path kept_file(const Mesh& mesh, std::span<const double> parameters) {
  const char* cache = std::getenv("XDG_CACHE_HOME");
  const char* home = std::getenv("HOME");
  if ((cache == nullptr || *cache == 0) && (home == nullptr || *home == 0)) return {};
  const fs::path folder =
      cache != nullptr && *cache != 0 ? fs::path(cache) : fs::path(home) / ".cache";
  Fingerprint print;
  print.add(&kVersion, sizeof kVersion);
  print.add(parameters.data(), parameters.size_bytes());
  for (const Vector3& p : mesh.points) print.add(p.data(), 3 * sizeof(double));
  for (const auto& triangle : mesh.triangles) print.add(triangle.data(), sizeof triangle);
  return folder / "haptic_local_model" / (print.text() + kExtension);
}

std::optional<std::vector<Hull>> read_kept(const fs::path& file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error) || fs::file_size(file, error) > kMostKept) return {};
  std::ifstream in(file);
  std::string print;
  if (!std::getline(in, print)) return std::nullopt;
  std::ostringstream rest;
  rest << in.rdbuf();
  if (print != fingerprint(rest.str())) return std::nullopt;
  auto hulls = parse(rest.str());
  if (hulls) fs::last_write_time(file, fs::file_time_type::clock::now(), error);
  return hulls;
}

void keep(const fs::path& file, const std::vector<Hull>& hulls, std::uintmax_t most) {
  std::error_code ignored;
  fs::create_directories(file.parent_path(), ignored);
  const fs::path part = file.string() + "." + std::to_string(::getpid());
  const std::string text = text_of(hulls);
  std::ofstream out(part);
  out << fingerprint(text) << "\n" << text;
  out.close();
  if (out) fs::rename(part, file, ignored);
  if (!out || ignored) fs::remove(part, ignored);
  tidy(file, most);
}

}  // namespace hlm::ve
