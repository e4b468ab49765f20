#include "hlm/page/web/page_register.h"

#include <algorithm>
#include <utility>

namespace hlm::ve {

void PageRegister::open(std::uint64_t page) {
  const std::lock_guard lock(mutex_);
  open_.emplace(page, false);
}

void PageRegister::close(std::uint64_t page) {
  const std::lock_guard lock(mutex_);
  if (open_.erase(page) == 0) return;
  requests_.push_back({.page = page, .text = {}, .closed = true});
}

void PageRegister::add(std::uint64_t page, std::string text) {
  const std::lock_guard lock(mutex_);
  if (requests_.size() >= kMaxRequests) {
    ++dropped_;
    return;
  }
  requests_.push_back({.page = page, .text = std::move(text), .closed = false});
}

bool PageRegister::full() const {
  const std::lock_guard lock(mutex_);
  return requests_.size() >= kMaxRequests;
}

std::vector<PageRequest> PageRegister::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(requests_, {});
}

std::uint64_t PageRegister::dropped() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

std::size_t PageRegister::pages() const {
  const std::lock_guard lock(mutex_);
  return open_.size();
}

void PageRegister::set_telemetry(std::uint64_t page, bool on) {
  const std::lock_guard lock(mutex_);
  if (const auto found = open_.find(page); found != open_.end()) found->second = on;
}

bool PageRegister::telemetry(std::uint64_t page) const {
  const std::lock_guard lock(mutex_);
  const auto found = open_.find(page);
  return found != open_.end() && found->second;
}

bool PageRegister::telemetry_wanted() const {
  const std::lock_guard lock(mutex_);
  return std::any_of(open_.begin(), open_.end(), [](const auto& page) { return page.second; });
}

}  // namespace hlm::ve
