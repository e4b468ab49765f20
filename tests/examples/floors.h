// A ball above a floor in three engines, and what each says of their contact.
#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>

#include <btBulletDynamicsCommon.h>
#include <mujoco/mujoco.h>
#include <ode/ode.h>
#include <stdlib.h>
#include <unistd.h>

#include "hlm/common/contact.h"

namespace hlm::test {

inline constexpr double kBallRadius = 0.02;  // m
inline constexpr double kEpsilon = 0.005;    // m: ε

/// The floor is z = 0.
class Floor {
 public:
  virtual ~Floor() = default;

  virtual const char* engine() const = 0;
  /// How deep the engine's own collision detection reports the ball with its centre there, m; 0
  /// where it reports none.
  virtual double depth(const Vector3& p_W) = 0;
  /// Contacts within ε as this project's adapter for the engine sends them. There is one at most,
  /// between the ball, side a, and the floor, hence one identity.
  virtual ReportedContacts near(const Vector3& p_W) = 0;

 protected:
  static ReportedContact contact(const Vector3& p_W, const Vector3& n_W, double separation) {
    ReportedContact made;
    made.identity = 1;
    made.a = {SideKind::kToolLink, 0};
    made.p_WC = p_W;
    made.n_W = n_W;
    made.separation = separation;
    return made;
  }
};

class MujocoFloor final : public Floor {
 public:
  MujocoFloor() {
    char path[] = "/tmp/haptic_floor_XXXXXX";
    const int file = mkstemp(path);
    const std::string text =
        "<mujoco><worldbody><geom type='plane' size='1 1 1'/><body><freejoint/>"
        "<geom type='sphere' size='" +
        std::to_string(kBallRadius) + "' margin='" + std::to_string(kEpsilon) + "' gap='" +
        std::to_string(kEpsilon) + "'/></body></worldbody></mujoco>";
    const bool written = write(file, text.data(), text.size()) == ssize_t(text.size());
    close(file);
    char error[500] = "";
    if (written) model_.reset(mj_loadXML(path, nullptr, error, sizeof error));
    std::remove(path);
    if (!model_) throw std::runtime_error(error);
    data_.reset(mj_makeData(model_.get()));
  }

  const char* engine() const override { return "MuJoCo"; }
  double depth(const Vector3& p_W) override {
    place(p_W);
    return data_->ncon > 0 ? std::max(0.0, -data_->contact[0].dist) : 0;
  }
  ReportedContacts near(const Vector3& p_W) override {
    place(p_W);
    ReportedContacts found;
    for (int i = 0; i < data_->ncon; ++i) {
      const mjContact& listed = data_->contact[i];
      const Vector3 n(listed.frame[0], listed.frame[1],
                      listed.frame[2]);  // From geom 0, the floor.
      const Vector3 middle(listed.pos[0], listed.pos[1], listed.pos[2]);
      found.push_back(contact(middle - 0.5 * listed.dist * n, n, listed.dist));
    }
    return found;
  }

 private:
  void place(const Vector3& p_W) {
    std::copy(p_W.begin(), p_W.end(), data_->qpos);
    mj_forward(model_.get(), data_.get());
  }

  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model_{nullptr, &mj_deleteModel};
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data_{nullptr, &mj_deleteData};
};

/// An engine whose adapter gives shapes, in which the server finds the contact.
class FloorOfShapes : public Floor {
 public:
  ReportedContacts near(const Vector3& p_W) override {
    const double separation = p_W.z() - kBallRadius;
    if (separation > kEpsilon) return {};
    return {contact({p_W.x(), p_W.y(), 0}, Vector3::UnitZ(), separation)};
  }
};

class BulletFloor final : public FloorOfShapes {
 public:
  BulletFloor() {
    floor_.setCollisionShape(&plane_);
    ball_.setCollisionShape(&sphere_);
    world_.addCollisionObject(&floor_);
    world_.addCollisionObject(&ball_);
  }
  ~BulletFloor() override {
    world_.removeCollisionObject(&ball_);
    world_.removeCollisionObject(&floor_);
  }

  const char* engine() const override { return "Bullet"; }
  double depth(const Vector3& p_W) override {
    place(p_W);
    world_.performDiscreteCollisionDetection();
    double deepest = 0;
    for (int i = 0; i < dispatcher_.getNumManifolds(); ++i) {
      const btPersistentManifold& manifold = *dispatcher_.getManifoldByIndexInternal(i);
      for (int j = 0; j < manifold.getNumContacts(); ++j) {
        deepest = std::max(deepest, -double{manifold.getContactPoint(j).getDistance()});
      }
    }
    return deepest;
  }

 private:
  void place(const Vector3& p_W) {
    const btVector3 p(btScalar(p_W.x()), btScalar(p_W.y()), btScalar(p_W.z()));
    ball_.setWorldTransform(btTransform(btQuaternion::getIdentity(), p));
  }

  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_{&configuration_};
  btDbvtBroadphase broadphase_;
  btCollisionWorld world_{&dispatcher_, &broadphase_, &configuration_};
  btStaticPlaneShape plane_{{0, 0, 1}, 0};
  btSphereShape sphere_{btScalar(kBallRadius)};
  btCollisionObject floor_;
  btCollisionObject ball_;
};

class OdeFloor final : public FloorOfShapes {
 public:
  OdeFloor() {
    static const int initialised = dInitODE2(0);
    (void)initialised;
    plane_ = dCreatePlane(nullptr, 0, 0, 1, 0);
    sphere_ = dCreateSphere(nullptr, kBallRadius);
  }
  ~OdeFloor() override {
    dGeomDestroy(sphere_);
    dGeomDestroy(plane_);
  }

  const char* engine() const override { return "ODE"; }
  double depth(const Vector3& p_W) override {
    dGeomSetPosition(sphere_, p_W.x(), p_W.y(), p_W.z());
    dContactGeom found;
    return dCollide(sphere_, plane_, 1, &found, sizeof found) > 0 ? found.depth : 0;
  }

 private:
  dGeomID plane_;
  dGeomID sphere_;
};

}  // namespace hlm::test
