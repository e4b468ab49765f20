/* Contacts for engines whose own are late, few or nameless: shapes once, their poses in each step.
 * Where the server takes shapes (haptic_offer()) it finds contacts itself, and this is not needed.
 *
 *   haptic_proximity* near = haptic_proximity_open(shapes, count, NULL, 0, error, sizeof error);
 *   while (running) {
 *     ...  // haptic_poll(), your engine, haptic_sample()
 *     size_t found = haptic_proximity_find(near, poses, epsilon, contacts, NULL);
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
 * with, and of those that these have contacts with. Of more than there is room for, those that tell
 * most of where the tool can go. Separations are exact to 1e-6 m.
 *
 * What is fixed to each other is one surface, whose inner edges are not felt: the shapes of one
 * link or body, and those of the world that have not moved since the first call. That call, and one
 * in which a shape first moves against what it was fixed to, may take long with large meshes.
 *
 * Velocities and loads are 0, friction is the server's. Returns how many, at most
 * HAPTIC_MAX_CONTACTS, which `contacts` must hold; `shapes`, if not NULL, gets the places of both
 * shapes of each, twice as many. Shapes whose pose is not finite,
 * farther than 1e7 m, or whose rotation is of length 0 have no contacts; nor has what is NULL. */
HAPTIC_API size_t haptic_proximity_find(haptic_proximity* proximity, const haptic_pose* poses,
                                        double epsilon, haptic_contact* contacts, uint32_t* shapes);

#ifdef __cplusplus
}
#endif

#endif
