// What a session changes in the user's model and data, and how it gives that back.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include <mujoco/mujoco.h>

#include "hlm/common/spatial.h"

namespace hlm::mujoco {

/// Numbers of a model, which are as they were when this ends. What somebody else has set since
/// stays.
class Changes {
 public:
  Changes() = default;
  Changes(const Changes&) = delete;
  Changes& operator=(const Changes&) = delete;
  ~Changes() { give_all_back(); }

  void set(mjtNum& number, double value) { set(numbers_, number, mjtNum{value}); }
  void set(int& number, int value) { set(whole_, number, value); }
  void give_back(mjtNum& number) { give_back(numbers_, number); }
  void give_back(int& number) { give_back(whole_, number); }
  void give_all_back() {
    for (auto& [where, change] : numbers_) change.undo(*where);
    for (auto& [where, change] : whole_) change.undo(*where);
    numbers_.clear();
    whole_.clear();
  }

 private:
  template <class T>
  struct Change {
    T own;
    T set;

    /// mj_setConst() adds to what was set in dof_M0: that is what it is without.
    void undo(T& number) const {
      constexpr double kClose = 1e-3;
      const double beyond = static_cast<double>(number) - static_cast<double>(set);
      if (beyond == 0) {
        number = own;
      } else if (beyond > 0 && beyond <= kClose * static_cast<double>(set)) {
        number -= set;
      }
    }
  };

  template <class T>
  static void set(std::map<T*, Change<T>>& changes, T& number, T value) {
    changes.try_emplace(&number, Change<T>{number, value}).first->second.set = value;
    number = value;
  }
  template <class T>
  static void give_back(std::map<T*, Change<T>>& changes, T& number) {
    const auto change = changes.find(&number);
    if (change == changes.end()) return;
    change->second.undo(number);
    changes.erase(change);
  }

  std::map<mjtNum*, Change<mjtNum>> numbers_;
  std::map<int*, Change<int>> whole_;
};

/// What the tool does to bodies from drive() to send(), in xfrc_applied beside what the user has
/// there. Where that is cleared or set meanwhile, nothing of ours is left to be taken away.
class Pushes {
 public:
  void add(mjData& data, int body, const Vector6& F_W) {
    Row row = row_of(data, body);
    pushes_.push_back({body, F_W, row, row + F_W});
    row += F_W;
  }
  /// What of it acts on a body now.
  Vector6 on(mjData& data, int body) const {
    const auto push = std::ranges::find(pushes_, body, &Push::body);
    if (push == pushes_.end()) return Vector6::Zero();
    const Row row = row_of(data, body);
    Vector6 F_W = Vector6::Zero();
    for (int i = 0; i < 6; ++i) {
      if (push->is_there(row, i)) F_W[i] = push->F_W[i];
    }
    return F_W;
  }
  void take_back(mjData& data) {
    for (const Push& push : pushes_) {
      Row row = row_of(data, push.body);
      for (int i = 0; i < 6; ++i) {
        if (push.is_there(row, i)) row[i] = push.before[i];
      }
    }
    pushes_.clear();
  }

 private:
  using Row = Eigen::Map<Vector6>;
  struct Push {
    int body;
    Vector6 F_W;
    Vector6 before;  ///< The row without it,
    Vector6 with;    ///< and with it.

    bool is_there(const Row& row, int i) const {
      constexpr double kRounding = 1e-9;  // N or N·m, and relative.
      return std::abs(row[i] - with[i]) <= kRounding * (1 + std::abs(with[i]));
    }
  };

  static Row row_of(mjData& data, int body) {
    return Row(data.xfrc_applied + std::ptrdiff_t{6} * body);
  }

  std::vector<Push> pushes_;
};

}  // namespace hlm::mujoco
