#include "hlm/protocol/sealing/key_file.h"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

namespace hlm::protocol {
namespace {

constexpr std::string_view kFirstLine = "haptic key 1\n";
constexpr std::size_t kDigits = 2 * noise::kKeySize;
constexpr std::size_t kFileSize = kFirstLine.size() + kDigits + 1;

std::runtime_error error_of(const std::filesystem::path& path, const std::string& what) {
  return std::runtime_error("key file " + path.string() + ": " + what);
}

std::runtime_error no_key(const std::filesystem::path& path) {
  return error_of(path,
                  "is no key: it must have the line \"haptic key 1\" and 64 hexadecimal "
                  "digits, as haptic_keygen writes them");
}

class File {
 public:
  File(const std::filesystem::path& path, int flags) : number_(open(path.c_str(), flags, 0600)) {
    if (number_ < 0) throw error_of(path, std::strerror(errno));
  }
  ~File() {
    if (number_ >= 0) close(number_);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  int number() const { return number_; }
  /// Whether the system took all that was written.
  bool finish() { return fsync(number_) == 0 && close(std::exchange(number_, -1)) == 0; }

 private:
  int number_;
};

/// Root may give a key to another user's program; nobody else may.
void check_owner(const std::filesystem::path& path, uid_t owner) {
  if (owner == geteuid() || owner == 0) return;
  throw error_of(path, "is owned by user " + std::to_string(owner) +
                           ", who may change it; it must be owned by root or by the user of this "
                           "program, " +
                           std::to_string(geteuid()));
}

/// What is no random key: zeros of a file that was never written, or a placeholder.
bool is_one_byte_repeated(const noise::Key& key) {
  // Of every key the same time, as all that is done with a secret.
  unsigned differences = 0;
  for (std::size_t i = 1; i < key.size(); ++i) {
    differences |= std::to_integer<unsigned>(key.data()[i] ^ key.data()[0]);
  }
  return differences == 0;
}

void check_rights(const std::filesystem::path& path, int number) {
  struct stat status {};
  if (fstat(number, &status) != 0) throw error_of(path, std::strerror(errno));
  if (!S_ISREG(status.st_mode)) throw error_of(path, "is not a regular file");
  check_owner(path, status.st_uid);
  if ((status.st_mode & (S_IRWXG | S_IRWXO)) == 0) return;
  std::array<char, 8> mode{};
  std::snprintf(mode.data(), mode.size(), "%04o", static_cast<unsigned>(status.st_mode & 07777));
  throw error_of(path, "others than its owner have rights to it (mode " + std::string(mode.data()) +
                           "); chmod 600 " + path.string());
}

}  // namespace

std::string key_of_service() {
  const char* const credentials = std::getenv("CREDENTIALS_DIRECTORY");
  if (credentials == nullptr) return {};
  const std::filesystem::path key = std::filesystem::path(credentials) / "haptic.key";
  // One that is there and cannot be read is the service's, too: read_key() then says why.
  std::error_code error;
  const auto type = std::filesystem::symlink_status(key, error).type();
  return type == std::filesystem::file_type::not_found ? std::string() : key.string();
}

noise::Key read_key(const std::filesystem::path& path) {
  const File file(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  check_rights(path, file.number());
  noise::Secret<kFileSize + 1> content;  // One byte more than a key, to see what is longer.
  const ssize_t size = read(file.number(), content.data(), content.size());
  if (size < 0) throw error_of(path, std::strerror(errno));
  const std::string_view text(reinterpret_cast<const char*>(content.data()),
                              static_cast<std::size_t>(size));
  const bool framed =
      text.size() == kFileSize && text.starts_with(kFirstLine) && text.back() == '\n';
  noise::Key key;
  std::size_t bytes = 0;
  if (!framed ||
      sodium_hex2bin(reinterpret_cast<unsigned char*>(key.data()), key.size(),
                     text.data() + kFirstLine.size(), kDigits, nullptr, &bytes, nullptr) != 0 ||
      bytes != key.size()) {
    throw no_key(path);
  }
  if (is_one_byte_repeated(key)) {
    throw error_of(path,
                   "is one byte repeated, which anybody can guess; haptic_keygen FILE makes a "
                   "random key");
  }
  return key;
}

void write_new_key(const std::filesystem::path& path) {
  const noise::KeyPair pair = noise::random_key_pair();
  noise::Secret<kFileSize + 1> content;  // sodium_bin2hex ends with a zero.
  char* const text = reinterpret_cast<char*>(content.data());
  kFirstLine.copy(text, kFirstLine.size());
  sodium_bin2hex(text + kFirstLine.size(), kDigits + 1,
                 reinterpret_cast<const unsigned char*>(pair.secret_key.data()), noise::kKeySize);
  text[kFileSize - 1] = '\n';

  File file(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC);
  const bool written =
      write(file.number(), text, kFileSize) == static_cast<ssize_t>(kFileSize) && file.finish();
  if (written) return;
  const std::string why = std::strerror(errno);
  unlink(path.c_str());
  throw error_of(path, "cannot be written: " + why);
}

}  // namespace hlm::protocol
