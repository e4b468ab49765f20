#include "hlm/server_scene/loader.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <utility>

#include "hlm/server_scene/scene_shapes.h"

namespace hlm::server {
namespace {

/// Chunks between the loop and the thread beside it; more stay in the session's window.
constexpr std::size_t kChunksBetween = 256;

/// How often the thread looks for chunks, s.
constexpr std::chrono::milliseconds kLooksEach{1};

constexpr std::string_view kTooSlow =
    "its contacts took more time than a tick has: leave out what the tool cannot reach, or give "
    "shapes of fewer pieces";

/// Why a scene is not used, or no longer.
void tell(const geometry::FinderCut& left_out, protocol::Text& text) noexcept {
  if (left_out == geometry::FinderCut{}) return text.assign(kTooSlow.begin(), kTooSlow.end());
  text.resize(text.capacity());
  const int size = std::snprintf(text.data(), text.size(),
                                 "half a tick is too short for %zu pairs of pieces and %zu "
                                 "contacts where the tool is now: are "
                                 "lengths in m, and is the tool outside of what it touches?",
                                 left_out.pairs, left_out.contacts);
  text.resize(std::min(static_cast<std::size_t>(size), text.size() - 1));
}

/// A placement of which no scene can be made.
struct UnusablePlacement : std::runtime_error {
  UnusablePlacement(std::uint32_t placement, const std::string& why)
      : std::runtime_error("placement " + std::to_string(placement) + ": " + why), id(placement) {}
  std::uint32_t id;
};

}  // namespace

SceneLoader::SceneLoader() : chunks_(kChunksBetween) {}

SceneLoader::~SceneLoader() {
  delete made_.load();
  delete spent_.load();
}

void SceneLoader::begin(const ToolDescription& tool) noexcept {
  ++session_;
  is_dropped_ = false;
  begun_.put({session_, tool});
  begun_number_.store(session_, std::memory_order_release);
}

bool SceneLoader::take(std::span<const std::byte> bytes) noexcept {
  Chunk chunk;
  chunk.session = session_;
  chunk.size = std::min(bytes.size(), chunk.bytes.size());
  std::copy_n(bytes.begin(), chunk.size, chunk.bytes.begin());
  return chunks_.push(chunk);
}

Scene* SceneLoader::poll() noexcept {
  // A scene changes only where there is room to give the one before back.
  if (spent_.load(std::memory_order_acquire) == nullptr) {
    std::unique_ptr<Made> next(made_.exchange(nullptr, std::memory_order_acq_rel));
    if (next) {
      if (next->session == session_) {
        std::swap(next, in_force_);
        is_dropped_ = false;
      }
      spent_.store(next.release(), std::memory_order_release);
    }
  }
  return is_usable() ? in_force_->scene.get() : nullptr;
}

protocol::SceneState SceneLoader::state() noexcept {
  const Progress& progress = progress_.get();
  protocol::SceneState state;
  if (progress.session == session_) state = progress.state;
  state.scene = number();
  if (is_dropped_ && state.error == protocol::SceneError::kNone) {
    state.error = protocol::SceneError::kSlow;
    tell(left_out_, state.text);
  }
  return state;
}

void SceneLoader::work() {
  try {
    read();
    if (!commit_ || is_over()) return;
    const Commit commit = *std::exchange(commit_, std::nullopt);
    make(commit);
    say();
  } catch (const std::exception& error) {  // Out of memory, above all.
    commit_.reset();
    parts_.clear();
    if (!store_) return;
    store_->refuse(
        {protocol::SceneError::kLimit, 0, std::string("no scene of it: ") + error.what()});
    say();
  }
}

void SceneLoader::read() {
  delete spent_.exchange(nullptr, std::memory_order_acq_rel);
  if (is_over()) begin_reading();
  bool heard = false;
  Chunk chunk;
  while (chunks_.pop(chunk)) {
    if (is_over()) begin_reading();
    if (chunk.session != reading_.number) continue;
    read_chunk(std::span(chunk.bytes).first(chunk.size));
    heard = true;
  }
  if (!heard) return;
  keep_commit();
  say();
}

void SceneLoader::begin_reading() {
  reading_ = begun_.get();
  reader_.emplace();
  store_.emplace(reading_.tool.links.size());
  commit_.reset();
  commits_ = false;
  parts_.clear();
}

void SceneLoader::read_chunk(std::span<const std::byte> bytes) {
  if (store_->fault()) return;
  reader_->feed(bytes);
  while (auto record = reader_->next()) {
    const bool commits = std::holds_alternative<protocol::SceneCommit>(*record);
    if (!commits) keep_commit();
    if (!store_->apply(std::move(*record))) return;
    commits_ = commits_ || commits;
  }
  if (reader_->fault()) store_->refuse(*reader_->fault());
}

/// What the latest commit is about, before other records change it.
void SceneLoader::keep_commit() {
  if (!std::exchange(commits_, false)) return;
  Commit commit{};
  commit.number = store_->scene();
  for (const auto& [id, placement] : store_->placements()) commit.placements.push_back(placement);
  commit.apart = store_->apart();
  commit_ = std::move(commit);
}

std::shared_ptr<const geometry::ShapeParts> SceneLoader::parts_of(std::uint64_t shape) {
  std::shared_ptr<const geometry::ShapeParts>& parts = parts_[shape];
  if (!parts) {
    parts = std::make_shared<const geometry::ShapeParts>(
        geometry::parts_of(any_shape(*store_->shape(shape)), "of it"));
  }
  return parts;
}

/// Tells of a fault instead where a placement cannot be used.
void SceneLoader::make(const Commit& commit) {
  try {
    std::vector<PlacedShape> shapes;
    std::map<std::uint32_t, std::uint32_t> place_of;  // By id.
    std::size_t pieces = 0;
    for (const protocol::ScenePlacement& placement : commit.placements) {
      if (is_over()) return;
      try {
        PlacedShape shape{.shape = parts_of(placement.shape),
                          .side = placement.side,
                          .X_BS = placement.X_BS,
                          .friction = placement.friction,
                          .group = placement.group,
                          .mask = placement.mask};
        require_place(shape, reading_.tool);
        pieces += shape.shape->pieces.size();
        if (pieces > kMostPieces) break;
        place_of[placement.id] = static_cast<std::uint32_t>(shapes.size());
        shapes.push_back(std::move(shape));
      } catch (const std::exception& error) {
        throw UnusablePlacement(placement.id, error.what());
      }
    }
    if (pieces > kMostPieces) {
      const std::string text = std::to_string(pieces) +
                               " pieces (each triangle of a mesh is one) must be at most " +
                               std::to_string(kMostPieces);
      return store_->refuse({protocol::SceneError::kLimit, 0, text});
    }
    std::vector<std::pair<std::uint32_t, std::uint32_t>> apart;
    for (const protocol::SceneApart& pair : commit.apart) {
      apart.emplace_back(place_of.at(pair.a), place_of.at(pair.b));
    }
    auto made = std::make_unique<Made>();
    made->session = reading_.number;
    made->number = commit.number;
    made->scene = std::make_unique<Scene>(std::move(shapes), apart, reading_.tool);
    delete made_.exchange(made.release(), std::memory_order_acq_rel);
    std::erase_if(parts_, [](const auto& known) { return known.second.use_count() == 1; });
  } catch (const UnusablePlacement& error) {
    store_->refuse({protocol::SceneError::kGeometry, error.id, error.what()});
  }
}

void SceneLoader::say() {
  Progress progress{.session = reading_.number};
  store_->describe(progress.state);
  progress_.put(progress);
}

SceneLoaderThread::SceneLoaderThread(SceneLoader& loader)
    : thread_([&loader](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
          loader.work();
          std::this_thread::sleep_for(kLooksEach);
        }
      }) {}

}  // namespace hlm::server
