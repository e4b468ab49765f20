// Which bodies rest, so that they need no steps until something moves them?
#pragma once

#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "hlm/ve_client/scene/world_description.h"

namespace hlm::ve {

/// Bodies that touch each other come to rest together, when all of them have been still for a
/// while. One that touches nothing does not rest, nor does one with a joint, nor what touches
/// these.
class Rest {
 public:
  /// `movable`: of each body. All of them are awake.
  Rest(const WorldDescription& description, const std::vector<bool>& movable);

  bool is_awake(int body) const { return state_[at(body)].awake; }
  /// The bodies in the order in which they woke.
  std::span<const int> awake() const noexcept { return awake_; }
  /// A body that rests moves again. Invalidates awake().
  void wake(int body);
  /// A body that is awake is pushed from outside: it has not been still.
  void push(int body) { state_[at(body)].still = 0; }

  /// A step of the solver begins: contacts of the one before are forgotten.
  void begin_step() { touching_.clear(); }
  /// Two bodies touch in the present step; one may be fixed.
  void touch(int first, int second) { touching_.emplace_back(first, second); }
  /// After a frame of dt seconds: the bodies that come to rest now. `speed`: of a body's fastest
  /// point, m/s.
  std::vector<int> settle(double dt, const std::function<double(int body)>& speed);
  /// A body comes to rest however it moves. Invalidates awake().
  void put_to_rest(int body);

 private:
  struct State {
    bool awake = false;
    bool jointed = false;
    double still = 0;       ///< How long it has been, s.
    int island = 0;         ///< A body of the same island, nearer to the one that names it.
    bool borne = false;     ///< Whether the island touches what is fixed.
    bool restless = false;  ///< Whether the island is restless.
  };
  static std::size_t at(int body) { return static_cast<std::size_t>(body); }
  int island_of(int body);

  std::vector<State> state_;
  std::vector<int> awake_;
  std::vector<std::pair<int, int>> touching_;
};

}  // namespace hlm::ve
