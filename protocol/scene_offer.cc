#include "hlm/protocol/scene_offer.h"

#include <set>
#include <stdexcept>
#include <string>

#include "hlm/protocol/scene_store.h"

namespace hlm::protocol {
namespace {

/// Reads what a server will read, so that what it would refuse is said here.
class Writer {
 public:
  explicit Writer(std::size_t tool_links) : store_(tool_links) {}

  void add(const SceneRecord& record) {
    const std::size_t begin = bytes_.size();
    append(record, bytes_);
    reader_.feed(std::as_bytes(std::span(bytes_).subspan(begin)));
    while (auto read = reader_.next()) store_.apply(std::move(*read));
    if (reader_.fault()) throw std::invalid_argument(reader_.fault()->text);
    if (store_.fault()) throw std::invalid_argument(store_.fault()->text);
  }

  std::vector<std::uint8_t> take() { return std::move(bytes_); }

 private:
  std::vector<std::uint8_t> bytes_;
  SceneRecordReader reader_;
  SceneStore store_;
};

}  // namespace

std::vector<std::uint8_t> scene_of(std::span<const OfferedShape> shapes,
                                   std::span<const std::pair<std::uint32_t, std::uint32_t>> apart,
                                   std::size_t tool_links) {
  Writer writer(tool_links);
  std::set<std::uint64_t> known;  // Shapes that are placed more than once.
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const OfferedShape& offered = shapes[i];
    try {
      const std::uint64_t hash = hash_of(offered.shape);
      if (known.insert(hash).second) writer.add(offered.shape);
      writer.add(ScenePlacement{.id = static_cast<std::uint32_t>(i),
                                .shape = hash,
                                .side = offered.side,
                                .X_BS = offered.X_BS,
                                .friction = offered.friction,
                                .group = offered.group,
                                .mask = offered.mask});
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument("shape " + std::to_string(i) + ": " + error.what());
    }
  }
  for (const auto& [a, b] : apart) writer.add(SceneApart{.a = a, .b = b});
  writer.add(SceneCommit{.scene = 1});
  return writer.take();
}

}  // namespace hlm::protocol
