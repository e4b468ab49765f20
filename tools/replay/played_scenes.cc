#include "hlm/tools/replay/played_scenes.h"

#include <algorithm>
#include <utility>
#include <variant>

#include "hlm/protocol/messages.h"

namespace hlm::server {

void PlayedScenes::set(const SceneExchange& noted) noexcept { noted_ = noted; }

void PlayedScenes::give(std::span<const std::byte> stream) {
  for (; !stream.empty(); stream = stream.subspan(std::min(stream.size(), protocol::kChunkSize))) {
    keep(stream.first(std::min(stream.size(), protocol::kChunkSize)));
  }
}

void PlayedScenes::begin(const ToolDescription& tool) noexcept {
  loader_.begin(tool);
  reader_.emplace();
  chunks_.clear();
  missing_.clear();
}

bool PlayedScenes::take(std::span<const std::byte> bytes) noexcept {
  if (noted_.chunks == 0) return false;
  --noted_.chunks;
  keep(bytes);
  return true;
}

Scene* PlayedScenes::poll() noexcept {
  if (noted_.number != 0 && noted_.number != loader_.number() && missing_.empty()) {
    make(noted_.number);
  }
  Scene* const scene = loader_.poll();
  return noted_.number == 0 ? nullptr : scene;
}

void PlayedScenes::keep(std::span<const std::byte> bytes) {
  Chunk& chunk = chunks_.emplace_back();
  chunk.bytes.assign(bytes.begin(), bytes.end());
  if (!reader_) return;
  reader_->feed(bytes);
  while (const auto record = reader_->next()) {
    if (const auto* commit = std::get_if<protocol::SceneCommit>(&*record)) {
      chunk.commit = commit->scene;
    }
  }
}

/// Hands the loader all up to the commit of that scene, which is the newest one then.
void PlayedScenes::make(std::uint32_t number) {
  const std::string scene = "scene " + std::to_string(number);
  const auto last = std::ranges::find(chunks_, number, &Chunk::commit);
  if (last == chunks_.end()) {
    missing_ = scene + ": the recording lacks its commit, or a chunk before that";
    return;
  }
  for (auto left = last - chunks_.begin() + 1; left > 0; --left) {
    while (!loader_.take(chunks_.front().bytes)) loader_.read();
    chunks_.pop_front();
  }
  loader_.work();
  loader_.poll();
  if (loader_.number() == number) return;
  const protocol::SceneState state = loader_.state();
  missing_ = scene + ": " + std::string(state.text.begin(), state.text.end());
}

}  // namespace hlm::server
