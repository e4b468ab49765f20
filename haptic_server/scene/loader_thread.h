// The threads beside the loop: one reads a session's scene stream, one makes scenes of it.
#pragma once

#include <chrono>
#include <memory>
#include <thread>
#include <vector>

#include "hlm/haptic_server/scene/loader.h"

namespace hlm::server {

/// Has a loader work during its life. A new session, and the end, find a thread at once, whatever
/// the one before makes: that one is told to end, and left to itself until it does.
class SceneLoaderThread {
 public:
  /// Time for one scene. More is refused: the shapes are too many, or lie within each other. Less
  /// would refuse large scenes on a slow machine: 60,000 pieces take some seconds.
  static constexpr std::chrono::milliseconds kLongestMaking{30'000};

  /// `loader` outlives this.
  explicit SceneLoaderThread(SceneLoader& loader,
                             std::chrono::milliseconds longest_making = kLongestMaking);
  ~SceneLoaderThread();
  SceneLoaderThread(const SceneLoaderThread&) = delete;
  SceneLoaderThread& operator=(const SceneLoaderThread&) = delete;

  /// Whether a thread of any of these still works although it was told to end: the program is not
  /// to run what it usually runs at its end, which the thread may use.
  static bool leaves_any() noexcept;

 private:
  class Bench;

  void run(const std::stop_token& stop);
  void work();
  void change_bench();
  void forget_ended();

  SceneLoader& loader_;
  std::chrono::milliseconds longest_making_;
  std::shared_ptr<Bench> bench_;              ///< Null: there can be no thread for it yet.
  std::uint64_t session_ = 0;                 ///< Of the bench.
  std::vector<std::shared_ptr<Bench>> left_;  ///< Told to end.
  std::jthread thread_;                       ///< The last, so that it ends first.
};

}  // namespace hlm::server
