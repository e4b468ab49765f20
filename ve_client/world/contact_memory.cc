#include "hlm/ve_client/world/contact_memory.h"

#include <utility>

namespace hlm::ve {
namespace {

/// The key that the contact has whichever of its bodies comes first. Kinds of sides do not matter
/// here: all are bodies of the world.
ContactKey ordered(ContactKey key, bool& swapped) {
  key.a.kind = key.b.kind = SideKind::kMovableBody;
  swapped = key.b.index < key.a.index;
  if (swapped) {
    std::swap(key.a, key.b);
    std::swap(key.a_feature, key.b_feature);
  }
  return key;
}

}  // namespace

void ContactMemory::begin_frame(int substeps,
                                const std::function<bool(std::uint32_t body)>& moves) {
  ++frame_;
  share_ = 1.0 / substeps;
  std::erase_if(loads_, [&](const auto& entry) {
    return moves(entry.first.a.index) || moves(entry.first.b.index);
  });
}

dJointFeedback& ContactMemory::add(const ContactKey& key, const Vector3& n_W) {
  Acting& acting = acting_.emplace_back();
  acting.key = ordered(key, acting.swapped);
  acting.n_W = n_W;
  acting.feedback = {};
  return acting.feedback;
}

void ContactMemory::end_step() {
  latest_.clear();
  for (const Acting& acting : acting_) {
    const Vector3 f(acting.feedback.f1[0], acting.feedback.f1[1], acting.feedback.f1[2]);
    const double f_n = acting.n_W.dot(f);
    latest_[acting.key] = {f_n, (acting.swapped ? -1 : 1) * (f - f_n * acting.n_W)};
    Load& load = loads_[acting.key];
    if (load.frame != frame_) load = {0, frame_};
    load.mean += share_ * f_n;
  }
  acting_.clear();
}

ContactMemory::Carried ContactMemory::latest(const ContactKey& key) const {
  bool swapped = false;
  const auto found = latest_.find(ordered(key, swapped));
  if (found == latest_.end()) return {};
  Carried carried = found->second;
  if (swapped) carried.friction = -carried.friction;
  return carried;
}

double ContactMemory::load(const ContactKey& key) const {
  bool swapped = false;
  const auto found = loads_.find(ordered(key, swapped));
  return found == loads_.end() ? 0 : found->second.mean;
}

double ContactMemory::load(int body_a, int body_b) const {
  const auto first = static_cast<std::uint32_t>(std::min(body_a, body_b));
  const auto second = static_cast<std::uint32_t>(std::max(body_a, body_b));
  double sum = 0;
  for (const auto& [key, load] : loads_) {
    if (key.a.index == first && key.b.index == second) sum += load.mean;
  }
  return sum;
}

}  // namespace hlm::ve
