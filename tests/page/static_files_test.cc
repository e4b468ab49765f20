// Which files a page may have.
#include "hlm/page/web/static_files.h"

#include "tests/page/web_root.h"
#include "tests/support/catch.h"

namespace hlm::ve {
namespace {

/// Name of the file found, "none" without one.
std::string found(const test::WebRoot& root, const std::string& target) {
  const auto file = find_static_file(root.path(), target);
  return file ? file->path.filename().string() : "none";
}

TEST_CASE("Files below the root are found with their kinds") {
  const test::WebRoot root;
  root.write("index.html", "");
  CHECK(found(root, "/") == "index.html");
  CHECK(found(root, "/index.html?v=1") == "index.html");
  const std::pair<const char*, const char*> kinds[] = {
      {"a.html", "text/html; charset=utf-8"},
      {"a.css", "text/css; charset=utf-8"},
      {"a.js", "text/javascript; charset=utf-8"},
      {"a.mjs", "text/javascript; charset=utf-8"},
      {"a.json", "application/json"},
      {"a.js.map", "application/json"},
      {"a.svg", "image/svg+xml"},
      {"a.png", "image/png"},
      {"sub/@scope/a~b+c_d-e.ico", "image/x-icon"},
  };
  for (const auto& [name, type] : kinds) {
    CAPTURE(name);
    root.write(name, "x");
    const auto file = find_static_file(root.path(), std::string("/") + name);
    REQUIRE(file);
    CHECK(file->content_type == type);
    CHECK(std::filesystem::equivalent(file->path, root.path() / name));
  }
}

TEST_CASE("Nothing else is found") {
  const test::WebRoot root;
  root.write("index.html", "");
  root.write("below/secret.json", "");
  root.write("below/web/index.html", "");
  root.write("below/web/notes.txt", "");
  root.write("below/web/program", "");
  root.write("below/web/.hidden.json", "");
  root.write("below/web/.git/config.json", "");
  root.write("below/web/a b.js", "");
  std::filesystem::create_directory(root.path() / "below/web/folder.js");
  const auto web = root.path() / "below/web";
  REQUIRE(find_static_file(web, "/index.html"));
  for (const char* target : {"",
                             "*",
                             "index.html",
                             "//index.html",
                             "http://localhost/index.html",
                             "/missing.js",
                             "/notes.txt",
                             "/program",
                             "/.hidden.json",
                             "/.git/config.json",
                             "/a%20b.js",
                             "/a b.js",
                             "/folder.js",
                             "/folder.js/",
                             "/../secret.json",
                             "/../web/index.html",
                             "/./index.html",
                             "/%2e%2e/secret.json",
                             "/..%2fsecret.json",
                             "/..\\secret.json",
                             "/?/../secret.json/"}) {
    CAPTURE(target);
    const auto file = find_static_file(web, target);
    CHECK((!file || (std::string(target).starts_with("/?") && file->path.stem() == "index")));
  }
  CHECK_FALSE(find_static_file(web, std::string(8000, '/').replace(1, 7999, 7999, 'a') + ".js"));
}

TEST_CASE("A symbolic link does not lead out of the root") {
  const test::WebRoot root;
  const test::WebRoot elsewhere;
  elsewhere.write("secret.json", "");
  elsewhere.write("secret.txt", "");
  root.write("real/a.js", "");
  root.write("notes.txt", "");
  root.link("inside.js", "real/a.js");
  root.link("out.json", elsewhere.path() / "secret.json");
  root.link("out", elsewhere.path());
  root.link("notes.json", "notes.txt");
  root.link("loop.js", "loop.js");
  CHECK(found(root, "/inside.js") == "a.js");
  CHECK(found(root, "/out.json") == "none");
  CHECK(found(root, "/out/secret.json") == "none");
  CHECK(found(root, "/notes.json") == "none");
  CHECK(found(root, "/loop.js") == "none");
}

TEST_CASE("Node_modules may be a link, and its packages links within") {
  const test::WebRoot root;
  const test::WebRoot elsewhere;
  const test::WebRoot third;
  elsewhere.write("three/build/three.module.js", "");
  elsewhere.link("alias", "three");
  third.write("a.js", "");
  elsewhere.link("out", third.path());
  root.write("other/a.js", "");
  elsewhere.link("workspace", root.path() / "other");
  root.link("node_modules", elsewhere.path());
  root.link("modules", elsewhere.path());
  CHECK(found(root, "/node_modules/three/build/three.module.js") == "three.module.js");
  CHECK(found(root, "/node_modules/alias/build/three.module.js") == "three.module.js");
  CHECK(found(root, "/node_modules/workspace/a.js") == "a.js");
  CHECK(found(root, "/node_modules/out/a.js") == "none");
  CHECK(found(root, "/modules/three/build/three.module.js") == "none");
}

}  // namespace
}  // namespace hlm::ve
