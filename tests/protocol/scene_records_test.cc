// Records of the scene stream to bytes and back; what is refused, and in which words.
#include "hlm/protocol/scene_records.h"

#include <cmath>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "tests/protocol/sample_records.h"
#include "tests/support/catch.h"

namespace hlm::protocol {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// Example bytes of PROTOCOL.md.
Bytes documented(const std::string& record) {
  std::ifstream file(HLM_PROTOCOL_DOCUMENT);
  std::stringstream buffer;
  buffer << file.rdbuf();
  const std::string document = buffer.str();
  const std::string opening = "```hex\n";
  const std::size_t example = document.find("### Example: " + record + "\n");
  REQUIRE(example != std::string::npos);
  const std::size_t begin = document.find(opening, example) + opening.size();
  std::string digits;
  for (const char c : document.substr(begin, document.find("```", begin) - begin)) {
    if (c != '\n') digits += c;
  }
  Bytes bytes;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(digits.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

Bytes bytes_of(const SceneRecord& record) {
  Bytes bytes;
  append(record, bytes);
  return bytes;
}

/// Fed in pieces of `piece` bytes.
std::vector<SceneRecord> read(const Bytes& bytes, std::size_t piece, SceneRecordReader& reader) {
  std::vector<SceneRecord> records;
  const auto all = std::as_bytes(std::span(bytes));
  for (std::size_t i = 0; i < all.size(); i += piece) {
    reader.feed(all.subspan(i, std::min(piece, all.size() - i)));
    while (auto record = reader.next()) records.push_back(std::move(*record));
  }
  return records;
}

/// Why the bytes are refused; they must be.
SceneFault fault_of(const Bytes& bytes, const SceneLimits& limits = {}) {
  SceneRecordReader reader(limits);
  CHECK(read(bytes, bytes.size(), reader).empty());
  REQUIRE(reader.fault());
  return *reader.fault();
}

SceneFault fault_of(const SceneRecord& record, const SceneLimits& limits = {}) {
  return fault_of(bytes_of(record), limits);
}

template <class Number>
Bytes with(Bytes bytes, std::size_t at, Number value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
  return bytes;
}

/// The same with the hash that its bytes have.
Bytes rehashed(Bytes record) {
  constexpr std::size_t kHashed = 13;
  const std::uint64_t hash = fnv1a(std::as_bytes(std::span(record)).subspan(kHashed));
  return with(std::move(record), 5, hash);
}

SceneShape sphere(double radius = 0.1) { return {.size = {radius, 0, 0}}; }

TEST_CASE("Each record has the bytes of its example in PROTOCOL.md") {
  SceneShape shape{.kind = SceneShapeKind::kMesh};
  shape.vertices = {{0, 0, 0}, {0.5, 0, 0}, {0, 0.5, 0}, {0, 0, 0.5}};
  shape.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  CHECK(bytes_of(shape) == documented("shape"));
  ScenePlacement placement{.id = 6, .shape = hash_of(shape), .side = {SideKind::kMovableBody, 5}};
  placement.X_BS.p.z() = 0.01;
  placement.friction = {0.25, FrictionRule::kMaximum, 1};
  placement.mask = ~1u;
  CHECK(bytes_of(placement) == documented("placement"));
  CHECK(bytes_of(SceneRemoval{2}) == documented("removal"));
  CHECK(bytes_of(SceneApart{6, 1}) == documented("apart"));
  CHECK(bytes_of(SceneCommit{3}) == documented("commit"));
}

TEST_CASE("The hash is FNV-1a of 64 bits") {
  const auto hash = [](const std::string& text) { return fnv1a(std::as_bytes(std::span(text))); };
  CHECK(hash("") == 0xCBF29CE484222325);
  CHECK(hash("a") == 0xAF63DC4C8601EC8C);
  CHECK(hash("foobar") == 0x85944171F73967E8);
}

TEST_CASE("What is read is what was written, in pieces of any size") {
  test::Random random;
  std::vector<SceneRecord> records;
  Bytes bytes;
  for (int i = 0; i < 300; ++i) {
    records.push_back(test::random_record(random));
    append(records.back(), bytes);
  }
  for (const std::size_t piece : {1u, 7u, 1000u, 1024u, 1'000'000u}) {
    SceneRecordReader reader;
    const std::vector<SceneRecord> found = read(bytes, piece, reader);
    CHECK_FALSE(reader.fault());
    CHECK((found == records));
  }
}

TEST_CASE("What a later version appends to a record is skipped") {
  for (const SceneRecord& record :
       {SceneRecord(sphere()), SceneRecord(ScenePlacement{.id = 3, .shape = 1}),
        SceneRecord(SceneRemoval{2}), SceneRecord(SceneApart{1, 2}), SceneRecord(SceneCommit{9})}) {
    Bytes bytes = bytes_of(record);
    bytes.insert(bytes.end(), 7, 0xEE);
    const std::uint32_t length = static_cast<std::uint32_t>(bytes.size()) - 5;
    bytes = with(bytes, 1, length);
    if (std::holds_alternative<SceneShape>(record)) bytes = rehashed(bytes);
    append(SceneCommit{10}, bytes);
    SceneRecordReader reader;
    const auto found = read(bytes, 16, reader);
    REQUIRE(found.size() == 2);
    CHECK(found[0].index() == record.index());
    CHECK((found[1] == SceneRecord(SceneCommit{10})));
  }
}

TEST_CASE("A wrong record ends the stream, and its fault names the thing, its value, the allowed") {
  const auto check = [](const SceneFault& fault, SceneError error, const std::string& text) {
    CHECK(fault.error == error);
    CHECK(fault.text.ends_with(text));
  };
  constexpr SceneError kMalformed = SceneError::kMalformed;
  const Bytes good = bytes_of(sphere());
  check(fault_of(with(good, 0, std::uint8_t{8})), kMalformed, "record: kind 8 must be 1 to 7");
  check(fault_of(with(good, 0, std::uint8_t{0})), kMalformed, "record: kind 0 must be 1 to 7");
  check(fault_of(with(good, 1, 0x1000001u)), SceneError::kLimit,
        "record: length 16777217 must be at most 16777216 bytes");
  check(fault_of(with(good, 5, std::uint8_t{7})), SceneError::kHash,
        "its hash must be that of its bytes, " + test::hexadecimal(hash_of(sphere())));
  check(fault_of(rehashed(with(good, 13, std::uint8_t{8}))), kMalformed, ": form 8 must be 0 to 7");
  check(fault_of(sphere(0)), kMalformed, ": size 0 m must be above 0 to 10000 m");
  check(fault_of(sphere(-1)), kMalformed, ": size -1 m must be above 0 to 10000 m");
  check(fault_of(sphere(10001)), kMalformed, ": size 10001 m must be above 0 to 10000 m");
  check(fault_of(sphere(std::nan(""))), kMalformed, ": size nan m must be above 0 to 10000 m");
  check(fault_of(SceneShape{.size = {1, 1, 0}}), kMalformed, ": size 1 m must be 0 to 0 m");
  check(fault_of(Bytes{5, 3, 0, 0, 0, 1, 2, 3}), kMalformed,
        "commit: its 3 bytes must be at least 4");
  check(fault_of(SceneCommit{0}), kMalformed, "commit: scene 0 must be at least 1");
  check(fault_of(BodyInertia{.body = 4, .mass = 0}), kMalformed,
        "inertia of body 4: mass 0 kg must be 1e-06 to 1000000 kg");
  check(fault_of(BodyInertia{.mass = std::nan("")}), kMalformed,
        ": mass nan kg must be 1e-06 to 1000000 kg");
  check(fault_of(BodyInertia{.I_BCom = Vector3(1, 1, 2.1).asDiagonal()}), kMalformed,
        ": its principal moments must be > 0, none more than the others' sum");
  check(fault_of(BodyInertia{.I_BCom = Matrix3::Constant(1)}), kMalformed,
        ": its principal moments must be > 0, none more than the others' sum");
  check(fault_of(BodyInertia{.gravity_W = {0, 0, -1001}}), kMalformed,
        ": gravity -1001 m/s^2 must be -1000 to 1000 m/s^2");
  check(fault_of(BodyInertia{.damping = -1}), kMalformed,
        ": damping -1 1/s must be 0 to 1000000 1/s");
  check(fault_of(BodyJoint{.body = 4, .type = JointType::kFree}), kMalformed,
        "joint of body 4: type must be 1 (revolute) or 2 (prismatic)");
  check(fault_of(BodyJoint{.body = 4, .parent = 4}), kMalformed,
        "joint of body 4: its parent must be another body");
  check(fault_of(BodyJoint{.axis = {0, 0, 0.5}}), kMalformed,
        ": axis must be of length 1 within 0.001");
  check(fault_of(BodyJoint{.lower = 1, .upper = 0.9}), kMalformed,
        ": upper limit must be at least the lower one");
  check(fault_of(BodyJoint{.friction = -1}), kMalformed, ": friction -1 must be 0 to 1e+09");

  SceneShape mesh = test::tetrahedron();
  CHECK_FALSE(fault_of(SceneShape{.kind = SceneShapeKind::kHull}).text.empty());
  check(fault_of(SceneShape{.kind = SceneShapeKind::kMesh, .vertices = mesh.vertices}), kMalformed,
        ": a mesh must have triangles");
  check(fault_of(SceneShape{.size = {1, 0, 0}, .vertices = mesh.vertices}), kMalformed,
        ": a sphere must have no vertices");
  mesh.triangles[1][2] = 4;
  check(fault_of(mesh), kMalformed, ": corner 4 of a triangle must be below 4, the vertices");
  mesh = test::tetrahedron();
  mesh.vertices[2].y() = -10001;
  check(fault_of(mesh), kMalformed, ": vertex -10001 m must be -10000 to 10000 m");
  mesh = test::tetrahedron();
  check(fault_of(mesh, {.vertices = 3}), SceneError::kLimit, ": vertices 4 must be at most 3");
  check(fault_of(mesh, {.triangles = 3}), SceneError::kLimit, ": triangles 4 must be at most 3");
  check(fault_of(rehashed(with(bytes_of(mesh), 38, 5000u))), kMalformed,
        ": its 185 bytes must be at least 120037");
}

TEST_CASE("A fault of a placement says which one") {
  const auto refused = [](auto change) {
    ScenePlacement placement{.id = 7, .shape = 1};
    change(placement);
    const SceneFault fault = fault_of(placement);
    CHECK(fault.error == SceneError::kMalformed);
    CHECK(fault.item == 7);
    return fault.text;
  };
  using P = ScenePlacement;
  CHECK(refused([](P& p) { p.side.kind = SideKind{3}; }) ==
        "placement 7: side_kind 3 must be 0 to 2");
  CHECK(refused([](P& p) { p.X_BS.p.x() = 1e5; }) ==
        "placement 7: X_BS 100000 m must be -10000 to 10000 m");
  CHECK(refused([](P& p) { p.X_BS.R.w() = 0.5; }) ==
        "placement 7: X_BS: quaternion's length 0.5 must be 1 within 0.001");
  CHECK(refused([](P& p) { p.friction.coefficient = 11; }) ==
        "placement 7: friction 11 must be -10 to 10");
  CHECK_FALSE(refused([](P& p) { p.X_BS.R.x() = std::nan(""); }).empty());
  CHECK_FALSE(refused([](P& p) { p.friction.coefficient = std::nan(""); }).empty());
}

TEST_CASE("A quaternion that is nearly unit comes out of length 1") {
  ScenePlacement placement{.id = 7, .shape = 1};
  placement.X_BS.R.w() = 1.0009;
  SceneRecordReader reader;
  const auto found = read(bytes_of(placement), 100, reader);
  REQUIRE(found.size() == 1);
  CHECK(std::get<ScenePlacement>(found[0]).X_BS.R.w() == 1);
}

TEST_CASE("After a fault nothing is read, and nothing more is held") {
  SceneRecordReader reader;
  Bytes bytes = bytes_of(SceneCommit{1});
  append(SceneCommit{0}, bytes);
  append(SceneCommit{2}, bytes);
  CHECK(read(bytes, 3, reader).size() == 1);
  REQUIRE(reader.fault());
  CHECK(read(bytes_of(SceneCommit{3}), 3, reader).empty());
  CHECK(reader.fault()->text == "commit: scene 0 must be at least 1");
}

TEST_CASE("Every cut of a record is waited for, and every shorter length refused") {
  test::Random random;
  for (int i = 0; i < 50; ++i) {
    const Bytes bytes = bytes_of(test::random_record(random));
    for (std::size_t size = 0; size < bytes.size(); size += 1 + size / 8) {
      Bytes cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
      SceneRecordReader waiting;
      CHECK(read(cut, 1000, waiting).empty());
      CHECK_FALSE(waiting.fault());
      if (size < 5) continue;
      cut = with(cut, 1, static_cast<std::uint32_t>(size - 5));
      if (cut[0] == 1 && size >= 13) cut = rehashed(cut);
      CHECK(fault_of(cut).error == SceneError::kMalformed);
    }
  }
}

}  // namespace
}  // namespace hlm::protocol
