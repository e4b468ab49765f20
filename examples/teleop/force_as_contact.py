"""A force that a simulator reports in each frame, felt as the surface behind it.

Sent to a device as it is, such a force is held until the next frame, and stiff contact buzzes. Here it becomes one
contact: a plane at right angles to it, as deep as the server's contact stiffness makes it that force. Between frames the
force follows the hand. A force is reported only once something touches: the surface stays where the tool was then, some
tenths of a millimetre deep. Where a simulator can say which contacts are near, send those instead.
"""

import haptic
import numpy as np

LEAST = 1e-3  # N: less is no contact


def send_force(touch, q, v, force, period, stiffness=4000):
    """After a frame of `period` seconds, s, with the tool of `touch` at q and v: the world's force on it, N, world axes.

    stiffness: of a contact of the server (haptic_server --stiffness), N/m. Raises haptic.HapticError where a number is
    not finite.
    """
    force = np.asarray(force, dtype=np.float64)
    magnitude = np.linalg.norm(force)
    contacts = haptic.contacts(0 if magnitude < LEAST else 1)
    if len(contacts) > 0:
        normal, depth = force / magnitude, magnitude / stiffness
        contacts["normal"], contacts["separation"] = normal, -depth
        contacts["point"] = q[:3] + depth * normal
        contacts["friction"] = 0  # It is in the force.
    touch.sample(q, v, period)
    touch.send(touch.track(contacts))
