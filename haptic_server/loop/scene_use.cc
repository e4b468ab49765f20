#include "hlm/haptic_server/loop/scene_use.h"

#include <cstddef>
#include <span>
#include <utility>

namespace hlm::server {

void SceneUse::begin(const ToolDescription& tool) noexcept {
  if (source_ != nullptr) source_->begin(tool);
  scene_ = nullptr;
  wanted_ = false;
}

void SceneUse::load(const protocol::ServerSession::Inbox& inbox, protocol::ServerSession& link,
                    std::optional<LocalModel>& model, Clocks& clocks,
                    const Timing& timing) noexcept {
  exchange_ = {};
  if (source_ == nullptr) return;
  if (clocks.is_late(model && model->scene() != nullptr, timing)) source_->drop({});
  if (inbox.scene) {
    const std::size_t taken =
        link.take_scene([this](std::span<const std::byte> bytes) { return source_->take(bytes); });
    exchange_.chunks = static_cast<std::uint32_t>(taken);
  }
  Scene* const before = std::exchange(scene_, source_->poll());
  if (scene_ != nullptr && scene_ != before && model) {
    const geometry::FinderCut left_out = model->try_scene(*scene_);
    if (left_out != geometry::FinderCut{}) {
      source_->drop(left_out);
      scene_ = nullptr;
    }
  }
  if (before != nullptr && scene_ == nullptr) clocks.keep_contacts();
  exchange_.number = source_->number();
  use(wanted_, model, clocks);
}

void SceneUse::use(bool wanted, std::optional<LocalModel>& model, Clocks& clocks) noexcept {
  wanted_ = wanted;
  if (!model) return;
  Scene* const scene = wanted ? scene_ : nullptr;
  clocks.go_on_keeping(wanted && scene == nullptr);
  if (clocks.keeps_contacts()) return model->keep_contacts();
  if (model->scene() != scene || model->keeps_contacts()) model->set_scene(scene);
}

void SceneUse::acknowledge(double now, protocol::ServerSession& link) noexcept {
  if (source_ != nullptr && link.has_scene()) link.inform(now, source_->state());
}

void SceneUse::describe(const LocalModel& model, TickRecord& record) const noexcept {
  if (scene_ == nullptr) return;
  record.scene = source_->number();
  record.placements = static_cast<std::uint32_t>(scene_->shapes());
  record.pieces = static_cast<std::uint32_t>(scene_->pieces());
  record.left_out = static_cast<std::uint32_t>(model.cut().pairs + model.cut().contacts);
}

}  // namespace hlm::server
