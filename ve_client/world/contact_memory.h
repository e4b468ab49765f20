// What the contacts among the world's bodies carried: for friction's direction in the next step of
// the solver, and for the loads that are reported.
#pragma once

#include <deque>
#include <functional>
#include <map>

#include <ode/ode.h>

#include "hlm/geometry/feature.h"
#include "hlm/ve_client/scene/geometry.h"

namespace hlm::ve {

class ContactMemory {
 public:
  /// What a contact carried in one step of the solver.
  struct Carried {
    double normal = 0;                   ///< N.
    Vector3 friction = Vector3::Zero();  ///< Friction on key.a, N.
  };

  /// A frame of `substeps` steps of the solver begins: loads are its means. Those between bodies
  /// that do not move stay as they are.
  void begin_frame(int substeps, const std::function<bool(std::uint32_t body)>& moves);
  /// A contact that takes part in the present step; the solver writes into the feedback what it
  /// carried, on key.a. Valid until end_step().
  dJointFeedback& add(const ContactKey& key, const Vector3& n_W);
  /// The present step is solved.
  void end_step();

  /// What it carried in the latest step; zero if the contact was not there.
  Carried latest(const ContactKey& key) const;
  /// Mean normal force of a contact in the frame, or in the latest one in which it moved, N.
  double load(const ContactKey& key) const;
  /// Load of all contacts of two bodies.
  double load(int body_a, int body_b) const;

 private:
  struct Acting {
    ContactKey key;  ///< Key as ordered by ordered().
    bool swapped;
    Vector3 n_W;
    dJointFeedback feedback;
  };

  struct Load {
    double mean = 0;     ///< N.
    unsigned frame = 0;  ///< Frame of the mean.
  };

  unsigned frame_ = 0;
  double share_ = 1;  ///< Weight of one step in the means.
  std::deque<Acting> acting_;
  std::map<ContactKey, Carried> latest_;
  std::map<ContactKey, Load> loads_;
};

}  // namespace hlm::ve
