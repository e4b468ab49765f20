#include "hlm/haptic_server/scene/loader.h"

#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <string_view>
#include <utility>

namespace hlm::server {
namespace {

/// Chunks between the loop and the thread beside it; more stay in the session's window.
constexpr std::size_t kChunksBetween = 256;

constexpr std::string_view kTooSlow =
    "its contacts took more time than a tick has: leave out what the tool cannot reach, or give "
    "shapes of fewer pieces";

/// Why a scene is not used, or no longer.
void tell(const geometry::FinderCut& left_out, protocol::Text& text) noexcept {
  if (left_out == geometry::FinderCut{}) return text.assign(kTooSlow.begin(), kTooSlow.end());
  text.resize(text.capacity());
  const int size = std::snprintf(text.data(), text.size(),
                                 "a tick is too short for %zu pairs of pieces and %zu "
                                 "contacts where the tool is now: are "
                                 "lengths in m, and is the tool outside of what it touches?",
                                 left_out.pairs, left_out.contacts);
  text.resize(std::min(static_cast<std::size_t>(size), text.size() - 1));
}

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
  read();
  if (const auto order = next_order()) finish(maker_.make(*order));
}

void SceneLoader::read() {
  delete spent_.exchange(nullptr, std::memory_order_acq_rel);
  if (is_over()) begin_reading();
  bool heard = false;
  Chunk chunk;
  try {
    while (chunks_.pop(chunk)) {
      if (is_over()) begin_reading();
      if (chunk.session != reading_.number) continue;
      read_chunk(std::span(chunk.bytes).first(chunk.size));
      heard = true;
    }
    if (heard) keep_commit();
  } catch (const std::exception& error) {  // Out of memory, above all.
    order_.reset();
    refuse({protocol::SceneError::kLimit, 0, std::string("no scene of it: ") + error.what()});
  }
  if (heard) say();
}

std::optional<SceneOrder> SceneLoader::next_order() {
  return is_over() ? std::nullopt : std::exchange(order_, std::nullopt);
}

void SceneLoader::finish(SceneOutcome outcome) {
  if (outcome.session != reading_.number) return;
  if (outcome.fault) refuse(std::move(*outcome.fault));
  if (outcome.made) delete made_.exchange(outcome.made.release(), std::memory_order_acq_rel);
  say();
}

void SceneLoader::begin_reading() {
  reading_ = begun_.get();
  reader_.emplace();
  store_.emplace(reading_.tool.links.size());
  order_.reset();
  commits_ = false;
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
  SceneOrder order{.session = reading_.number,
                   .tool = reading_.tool,
                   .number = store_->scene(),
                   .placements = {},
                   .apart = store_->apart(),
                   .inertias = {},
                   .joints = {},
                   .shapes = {}};
  for (const auto& [id, placement] : store_->placements()) {
    order.placements.push_back(placement);
    order.shapes.emplace(placement.shape, store_->shape(placement.shape));
  }
  for (const auto& [body, inertia] : store_->inertias()) order.inertias.push_back(inertia);
  for (const auto& [body, joint] : store_->joints()) order.joints.push_back(joint);
  order_ = std::move(order);
}

void SceneLoader::refuse(protocol::SceneFault fault) {
  if (store_) store_->refuse(std::move(fault));
}

void SceneLoader::say() {
  Progress progress{.session = reading_.number};
  store_->describe(progress.state);
  progress_.put(progress);
}

}  // namespace hlm::server
