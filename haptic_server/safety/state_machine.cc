#include "hlm/haptic_server/safety/state_machine.h"

#include <algorithm>
#include <cstddef>

namespace hlm::server {
namespace {

using enum ServerState;
using enum SafetyEvent;

struct Row {
  ServerState from;
  ServerState to[7];  ///< Next states by SafetyEvent.
};

// clang-format off
constexpr Row kTransitions[] = {
  // from       kGranted  kUpdated  kRisen    kUnheard  kGoodbye  kFadedOut kFailed
    {kOff,     {kArming,  kOff,     kOff,     kOff,     kOff,     kOff,     kFault}},
    {kArming,  {kArming,  kRamping, kArming,  kArming,  kFading,  kArming,  kFault}},
    {kRamping, {kArming,  kRamping, kActive,  kFading,  kFading,  kRamping, kFault}},
    {kActive,  {kArming,  kActive,  kActive,  kFading,  kFading,  kActive,  kFault}},
    {kFading,  {kArming,  kRamping, kFading,  kFading,  kFading,  kOff,     kFault}},
    {kFault,   {kArming,  kFault,   kFault,   kFault,   kFault,   kFault,   kFault}},
};
// clang-format on

}  // namespace

void SafetyStateMachine::happen(SafetyEvent event) noexcept {
  for (const Row& row : kTransitions) {
    if (row.from == state_) return void(state_ = row.to[static_cast<std::size_t>(event)]);
  }
}

void SafetyStateMachine::begin(double silence_time) noexcept {
  happen(kGranted);
  fault_ = Fault::kNone;
  fade_ = Fade::kNone;
  silence_time_ = silence_time;
  silence_ = without_update_ = 0;
  refused_ = false;
}

void SafetyStateMachine::stand_by(double silence_time) noexcept {
  silence_time_ = silence_time;
  silence_ = without_update_ = 0;
  refused_ = false;
  if (state_ == kArming && fade_ != Fade::kClientLeft) fade_ = Fade::kNone;
}

void SafetyStateMachine::update(double silence_time, double age, double oldest) noexcept {
  stand_by(silence_time);
  if (fade_ == Fade::kClientLeft) return;
  if (age > oldest) return lose(Fade::kContactsOld);
  happen(kUpdated);
  if (renders_force(state_)) fade_ = Fade::kNone;
}

void SafetyStateMachine::end() noexcept {
  if (!simulates()) return;
  happen(kGoodbye);
  fade_ = Fade::kClientLeft;
}

void SafetyStateMachine::fail(Fault fault) noexcept {
  released_ = false;
  if (state_ == kFault && (ends_at_device(fault_) || !ends_at_device(fault))) return;
  happen(kFailed);
  fault_ = fault;
  fade_ = Fade::kNone;
}

void SafetyStateMachine::tick(ForceLevel level, std::uint64_t periods) noexcept {
  const double passed = static_cast<double>(periods) * dt_;
  silence_ += passed;
  without_update_ += passed;
  if (silence_ > silence_time_) {
    lose(refused_ ? Fade::kUpdatesInvalid : Fade::kClientSilent);
  } else if (without_update_ > std::max(silence_time_, kLongestWithoutUpdate)) {
    lose(refused_ ? Fade::kUpdatesInvalid : Fade::kContactsOld);
  }
  if (level == ForceLevel::kFull) happen(kRisen);
  if (level == ForceLevel::kNone && fade_ == Fade::kClientLeft) happen(kFadedOut);
  if (state_ == kOff) fade_ = Fade::kNone;
}

void SafetyStateMachine::lose(Fade why) noexcept {
  happen(kUnheard);
  const bool waits = state_ == kArming || state_ == kFading;
  if (waits && fade_ != Fade::kClientLeft) fade_ = why;
}

}  // namespace hlm::server
