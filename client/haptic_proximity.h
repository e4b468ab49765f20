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

/* Contacts within epsilon (m, >= 0). `poses`: one for each shape, in the order of the shapes. Finds
 * the contacts of the tool with all other shapes, on all axes of each pair; then those of the
 * bodies that the tool touches, and of the bodies that these touch. If there is not room for all,
 * the ones that say most about where the tool can go. Separations are exact to 1e-6 m.
 *
 * Shapes that are fixed to each other make one surface, whose inner edges are not felt: those of
 * one link or body, and those of the world that have not moved since the first call. That call, and
 * any in which a shape first moves relative to what it was fixed to, may take long with large
 * meshes.
 *
 * Velocities and loads are 0, friction is the server's. Returns how many there are, at most
 * HAPTIC_MAX_CONTACTS, which `contacts` must have room for; `shapes`, if not NULL, gets the indices
 * of both shapes of each contact, so twice as many. Shapes whose pose is not finite or farther than
 * 1e7 m, or whose rotation is of length 0, have no contacts. With a NULL argument there are none.
 */
HAPTIC_API size_t haptic_proximity_find(haptic_proximity* proximity, const haptic_pose* poses,
                                        double epsilon, haptic_contact* contacts, uint32_t* shapes);

#ifdef __cplusplus
}
#endif

#endif
