// The key's file: who may read it, and what is a key.
#include "hlm/protocol/sealing/key_file.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <unistd.h>

#include "tests/protocol/transport/capture_files.h"
#include "tests/support/catch.h"

namespace hlm::protocol {
namespace {

namespace fs = std::filesystem;
using Catch::Matchers::ContainsSubstring;

constexpr fs::perms kOwners = fs::perms::owner_read | fs::perms::owner_write;

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

void write(const fs::path& path, const std::string& text) {
  std::ofstream(path) << text;
  fs::permissions(path, kOwners);
}

std::string error_of(const fs::path& path) {
  try {
    read_key(path);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST_CASE("A new key is its owner's alone, is read back, and is another each time") {
  const test::TemporaryDirectory directory;
  write_new_key(directory / "a.key");
  write_new_key(directory / "b.key");
  CHECK((fs::status(directory / "a.key").permissions() & fs::perms::all) == kOwners);
  CHECK(read_key(directory / "a.key") == read_key(directory / "a.key"));
  CHECK(read_key(directory / "a.key") != read_key(directory / "b.key"));
}

TEST_CASE("A file that is there is not overwritten") {
  const test::TemporaryDirectory directory;
  write(directory / "a.key", "precious");
  CHECK_THROWS_WITH(write_new_key(directory / "a.key"),
                    ContainsSubstring("a.key") && ContainsSubstring("exists"));
  CHECK(text_of(directory / "a.key") == "precious");
}

TEST_CASE("A key to which others than its owner have any rights is refused") {
  const test::TemporaryDirectory directory;
  const fs::path path = directory / "a.key";
  write_new_key(path);
  for (const fs::perms right :
       {fs::perms::group_read, fs::perms::group_write, fs::perms::group_exec,
        fs::perms::others_read, fs::perms::others_write, fs::perms::others_exec}) {
    fs::permissions(path, kOwners | right);
    CHECK_THAT(error_of(path), ContainsSubstring(path.string()) && ContainsSubstring("chmod 600"));
  }
  fs::permissions(path, fs::perms::owner_read);
  CHECK(error_of(path).empty());
}

TEST_CASE("A service has the key that systemd hands to it, and others have none") {
  const test::TemporaryDirectory directory;
  setenv("CREDENTIALS_DIRECTORY", (directory / "").c_str(), 1);
  CHECK(key_of_service().empty());
  write_new_key(directory / "haptic.key");
  CHECK(key_of_service() == directory / "haptic.key");
  fs::remove(directory / "haptic.key");
  fs::create_symlink("nothing", directory / "haptic.key");
  CHECK_FALSE(key_of_service().empty());  // It cannot be read, which is an error, not no key.
  unsetenv("CREDENTIALS_DIRECTORY");
  CHECK(key_of_service().empty());
}

TEST_CASE("What is no key is refused in one line that names the file and what a key is") {
  const test::TemporaryDirectory directory;
  const fs::path path = directory / "a.key";
  write_new_key(path);
  const std::string good = text_of(path);
  std::string other_digit = good;
  other_digit[20] = 'g';
  for (const std::string& bad : {std::string(), good.substr(0, good.size() - 1), good + "\n",
                                 "haptic key 2" + good.substr(12), other_digit,
                                 std::string(good.size(), 'a'), std::string(100'000, 'a')}) {
    fs::remove(path);
    write(path, bad);
    CHECK_THAT(error_of(path), ContainsSubstring(path.string()) && ContainsSubstring("no key") &&
                                   ContainsSubstring("64 hexadecimal"));
  }
  CHECK_THAT(error_of(directory / "none"), ContainsSubstring("No such file"));
  CHECK_THAT(error_of("/dev/null"), ContainsSubstring("not a regular file"));
}

TEST_CASE("A key of one byte repeated is refused: nobody has drawn it") {
  const test::TemporaryDirectory directory;
  const fs::path path = directory / "a.key";
  const std::string byte = GENERATE(as<std::string>(), "00", "ff", "41");
  std::string digits;
  for (int i = 0; i < 32; ++i) digits += byte;
  write(path, "haptic key 1\n" + digits + "\n");
  CHECK_THAT(error_of(path), ContainsSubstring(path.string()) &&
                                 ContainsSubstring("one byte repeated") &&
                                 ContainsSubstring("haptic_keygen"));
  digits.back() = digits.back() == '0' ? '1' : '0';
  write(path, "haptic key 1\n" + digits + "\n");
  CHECK(error_of(path).empty());
}

TEST_CASE("A key file of another user is refused, root's is not") {
  if (geteuid() != 0) {
    WARN("skipped: only root gives files away");
    return;
  }
  const test::TemporaryDirectory directory;
  const fs::path path = directory / "a.key";
  write_new_key(path);
  constexpr uid_t kNobody = 65534;
  REQUIRE(chown(path.c_str(), kNobody, static_cast<gid_t>(-1)) == 0);
  CHECK_THAT(error_of(path), ContainsSubstring(path.string()) &&
                                 ContainsSubstring("owned by user 65534") &&
                                 ContainsSubstring("user of this program, 0"));
  REQUIRE(seteuid(kNobody) == 0);
  const std::string as_its_owner = error_of(path);
  REQUIRE(seteuid(0) == 0);
  // The directory may be closed to that user; its own file is not refused for its owner.
  CHECK_THAT(as_its_owner, !ContainsSubstring("owned by user"));
}

}  // namespace
}  // namespace hlm::protocol
