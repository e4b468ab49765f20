/* Contacts for engines whose own are late, few or nameless: shapes once, their poses in each step.
 *
 *   haptic_proximity* near = haptic_proximity_open(shapes, count, NULL, 0, error, sizeof error);
 *   while (running) {
 *     ...  // haptic_poll(), your engine, haptic_sample()
 *     size_t found = haptic_proximity_find(near, poses, epsilon, contacts);
 *     haptic_send(touch, contacts, found, NULL, 0);  // identities are lasting ones
 *   }
 *
 * SI units, world axes. Link with -lhaptic_proximity beside -lhaptic. One thread at a time.
 */
#ifndef HAPTIC_PROXIMITY_H
#define HAPTIC_PROXIMITY_H

#include "haptic.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Each is centred in its own frame. */
enum haptic_shape_kind {
  HAPTIC_SPHERE = 0,    /* size[0]: radius, m */
  HAPTIC_CAPSULE = 1,   /* along z: radius, length of the cylindrical part */
  HAPTIC_CYLINDER = 2,  /* along z: radius, length */
  HAPTIC_BOX = 3,       /* edge lengths */
  HAPTIC_ELLIPSOID = 4, /* semi-axes */
  HAPTIC_HULL = 5,      /* the convex hull of `vertices` */
  HAPTIC_HALF_SPACE = 6 /* z <= 0; of the world only */
};

typedef struct haptic_shape {
  int32_t kind;         /* enum haptic_shape_kind */
  int32_t side;         /* enum haptic_side: whose it is */
  uint32_t index;       /* of the link, or your own number for the body */
  uint32_t group, mask; /* two shapes may touch if a bit of one's group is in the other's mask */
  uint32_t vertex_count;
  double size[3];         /* m, > 0 */
  const double* vertices; /* of HULL: x, y, z each, m; read while opening only */
} haptic_shape;

typedef struct haptic_pose {
  double position[3]; /* of the shape's frame in the world, m */
  double rotation[4]; /* unit quaternion w, x, y, z */
} haptic_pose;

typedef struct haptic_proximity haptic_proximity;

/* `excluded`: twice `excluded_count` indices of shapes that never touch, or NULL. Shapes of one
 * body never do. NULL if a shape cannot be used; `error` then names it. */
HAPTIC_API haptic_proximity* haptic_proximity_open(const haptic_shape* shapes, size_t count,
                                                   const uint32_t* excluded, size_t excluded_count,
                                                   char* error, size_t error_size);
/* NULL is ignored. */
HAPTIC_API void haptic_proximity_close(haptic_proximity* proximity);

/* Contacts within epsilon (m, >= 0) at these poses, one for each shape, in the order of the shapes:
 * of the tool with all others, on all axes of each pair; then of the bodies that it has contacts
 * with, and of those that these have contacts with. Nearest pairs first, whole pairs only.
 * Separations are exact to 1e-6 m. `pair` is count times the index of a's shape plus that of b's.
 * Velocities and loads are 0, friction is the server's. Returns how many, at most
 * HAPTIC_MAX_CONTACTS, which `contacts` must hold. Shapes whose pose is not finite, or whose
 * rotation is of length 0, have no contacts. */
HAPTIC_API size_t haptic_proximity_find(haptic_proximity* proximity, const haptic_pose* poses,
                                        double epsilon, haptic_contact* contacts);

#ifdef __cplusplus
}
#endif

#endif
