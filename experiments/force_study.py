#!/usr/bin/python3
"""Whether contact force among the observations helps a policy that learns by imitation to find a socket and to insert a peg.

Usage: force_study.py LIBHAPTIC PACKAGE_FOLDER HAPTIC_REPLAY [--demonstrations N] [--rollouts N] [--seeds N] [--seed N]

The peg is a cylinder of 28 mm, the socket eight walls around it, 50 mm deep. It is up to 4 mm beside where it is believed to be, so the
peg mostly lands on the rim. A scripted hand, which knows no more, presses it down and moves it away from where the rim presses, until it
drops in. Each demonstration is recorded by the server in virtual time; haptic.dataset makes 30 frames per second of it. A network of 2
layers of 64, by Adam, in numpy, learns how far that hand draws the peg from where it is, from the last 4 frames. All variants have the
same demonstrations and training, and see the peg's pose and twist, which tell where it stops and how the rim tilts it:

    no force    nothing else
    command     how far ahead of the peg they drew it in the frame before, which a spring makes a force
    mean        the mean wrench of each frame, observation.force
    window      of each frame's wrenches at 1 kHz, observation.force_window: mean, deviation, least, largest and last

A rollout is a success if the peg is 30 mm in the socket for 0.5 s, within 4 s, three times what the scripted hand takes. Prints, of each
hand and condition, how many were, with Wilson's interval of 95 %, and how many of each training seed; fails where a window of the set is not
what was there online. Each of these has its own
demonstrations, networks and rollouts, the same for all variants. Hands that do not learn are tried with the first one's rollouts.
"""

import argparse
import functools
import os
import pathlib
import sys
import tempfile

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # Before numpy: more of them wait for each other most of the time.

import numpy as np  # noqa: E402

RADIUS, DEPTH, WALL, LENGTH = 0.014, 0.05, 0.005, 0.09  # m
MISS, START = 0.004, 0.005  # m: how far the socket, and the peg at first, are at most from where the socket is believed to be
OVER = DEPTH + LENGTH / 2  # m: of the peg's middle when it stands on the rim
INSIDE, FOR, LIMIT = 0.03, 0.5, 4.0  # m, s, s
FPS, TICKS, HISTORY = 30, 34, 4  # Hz; in a frame, at most; frames
SHAKE = 0.001  # m: standard deviation of where a demonstration's hand is drawn, about where it means to be
CONDITIONS = {"as trained": (0.0005, 0.2), "friction 0.4": (0.0005, 0.4), "clearance 0.25 mm": (0.00025, 0.2)}  # clearance, m; friction
VARIANTS = ("no force", "command", "mean", "window")


def scene(socket, start, clearance, friction):
    inner = RADIUS + clearance
    walls = "".join(
        f'<geom type="box" size="{1.1 * inner} {WALL} {DEPTH / 2}" friction="{friction}" euler="0 0 {a + np.pi / 2}" '
        f'pos="{socket[0] + (inner + WALL) * np.cos(a)} {socket[1] + (inner + WALL) * np.sin(a)} {DEPTH / 2}"/>'
        for a in np.arange(8) * np.pi / 4)
    return f"""<mujoco><compiler angle="radian"/><option timestep="{1 / FPS}" gravity="0 0 0"/><worldbody>
      <geom type="plane" size="2 2 .1" friction="{friction}"/>{walls}
      <body name="peg" pos="{start[0]} {start[1]} {start[2]}"><freejoint/>
      <geom type="cylinder" size="{RADIUS} {LENGTH / 2}" mass=".05" friction="{friction}"/></body></worldbody></mujoco>"""


def in_disc(random, radius):
    angle, distance = random.uniform(0, 2 * np.pi), radius * np.sqrt(random.uniform())
    return distance * np.cos(angle), distance * np.sin(angle)


def straight_down(state, *_):
    return np.array([*np.clip(-state[:2], -0.01, 0.01), -0.012])


def expert(state, force, _):
    """How far it draws the peg from where that is, m. The socket is believed to be at 0, 0."""
    if state[2] < OVER - 0.003:
        return np.array([0, 0, -0.02])
    if force[2] < 0.5:
        return np.array([*np.clip(-state[:2], -0.01, 0.01), -0.008])
    arm = LENGTH / 2  # m: to where the rim presses, whose middle is:
    middle = np.array([-force[4] - arm * force[0], force[3] - arm * force[1]]) / force[2]
    return np.array([*(-0.006 * middle / np.linalg.norm(middle)), -0.012])


def columns_of(ticks):
    """state (13), force (6) and window (TICKS, 6) of a frame with these ticks, as haptic.dataset makes them of a recording."""
    ends = [*(f"{axis}_m" for axis in "xyz"), *(f"q{axis}" for axis in "wxyz"), *(f"v{axis}_m_per_s" for axis in "xyz"),
            *(f"w{axis}_rad_per_s" for axis in "xyz")]
    wrench = np.column_stack([ticks[f"env_{kind}_{axis}_{unit}"] for kind, unit in (("force", "N"), ("torque", "N_m")) for axis in "xyz"])
    window = np.full((TICKS, 6), np.nan)
    window[-len(wrench):] = wrench[-TICKS:]
    return np.array([ticks[f"proxy_{end}"][-1] for end in ends]), wrench.mean(axis=0), window


def attempt(haptic, mujoco, hand, random, condition, folder=None):
    """Whether the hand, which says where to from a frame's columns, gets the peg in. folder: where a demonstration is kept."""
    socket, start = in_disc(random, MISS), (*in_disc(random, START), OVER + random.uniform(0.01, 0.02))
    model = mujoco.MjModel.from_xml_string(scene(socket, start, *CONDITIONS[condition]))
    data, begin, inside = mujoco.MjData(model), 0, 0
    options = ("--record", str(folder / "run.pcap")) if folder else ()
    with (haptic.virtual.Server(*options) as server,
          haptic.mujoco.Session(model, data, tool="peg", binding=mujoco, period=1 / FPS) as touch):
        while server.now < LIMIT and inside < FOR * FPS:
            for _ in range(touch.drive(data)):
                mujoco.mj_step(model, data)
            ticks = server.ticks_since(begin)
            begin += len(ticks)
            if touch.touch.server_state == "active":
                state, force, window = columns_of(ticks)
                target = state[:3] + np.clip(hand(state, force, window), -0.05, 0.05)
                touch.hold(target + (random.normal(0, SHAKE, 3) if folder else 0))
                is_in = state[2] < OVER - INSIDE and np.hypot(*(state[:2] - socket)) < RADIUS
                inside = inside + 1 if is_in else 0
                if folder and not touch.touch.current_episode:
                    touch.episode("find the socket and insert the peg", folder / "episodes")
                touch.log(target=target, online=window)
            touch.send(data)
        if folder and inside >= FOR * FPS:
            touch.touch.current_episode.success()
    return inside >= FOR * FPS


def demonstrate(haptic, mujoco, seed, count):
    """Columns of each demonstration; how many had success; and of how many frames the window was the same online."""
    made, good, same = [], 0, []
    for i in range(count):
        with tempfile.TemporaryDirectory() as name:
            here = pathlib.Path(name)
            good += attempt(haptic, mujoco, expert, np.random.default_rng([seed, 0, i]), "as trained", here)
            episodes, _ = haptic.dataset.find_episodes([here / "episodes"])
            found = haptic.dataset.demonstrations([here / "run.pcap"], episodes, FPS)
            for frames in haptic.dataset.frames(found, FPS):
                state, force, window, target, online = (np.asarray(frames.columns[f"observation.{column}"], float) for column in (
                    "state", "force", "force_window", "target", "online"))
                same += compare(window, online)
                made.append((state[:, :13], force, window, target))
    return made, good, np.bincount(same, minlength=3)


def compare(window, online):
    """Of each frame 0 where its window was the same online, 1 where it ended a tick earlier there, 2 where it was another."""
    is_near = [np.isclose(window[:, 2 - back:TICKS - back], online[:, 2:], atol=1e-4).all(axis=(1, 2)) for back in (0, 1)]
    return np.where(is_near[0], 0, np.where(is_near[1], 1, 2)).tolist()


def features(variant, state, force, window, before):
    """Of each frame (n, …), with those before it. before: where the hand drew the peg to in the last one, m."""
    rows = [state[:, :3] - [0, 0, OVER], 2 * np.sign(state[:, 3:4]) * state[:, 4:7], state[:, 7:]]  # m, rad, m/s and rad/s
    if variant == "command":
        rows += [before - state[:, :3]]
    elif variant == "mean":
        rows += [force]
    elif variant == "window":
        rows += [summary(window, axis=1) for summary in (np.nanmean, np.nanstd, np.nanmin, np.nanmax)] + [window[:, -1]]
    joined = np.column_stack(rows)
    return np.column_stack([joined[np.maximum(np.arange(len(joined)) - back, 0)] for back in range(HISTORY)])


class Network:
    """What it learns at once, by Adam: from the rows x those of y."""

    def __init__(self, x, y, random, epochs=150, batch=128, rate=1e-3):
        self._x, self._y = ((rows.mean(axis=0), rows.std(axis=0) + 1e-6) for rows in (x, y))
        sizes = (x.shape[1], 64, 64, y.shape[1])
        self._w = [random.normal(0, n**-0.5, (n, m)) for n, m in zip(sizes, sizes[1:])] + [np.zeros(m) for m in sizes[1:]]
        x, y = self._scaled(x), (y - self._y[0]) / self._y[1]
        first, second, step = [0 * w for w in self._w], [0 * w for w in self._w], 0
        for epoch in range(epochs):
            for rows in np.array_split(random.permutation(len(x)), max(1, len(x) // batch)):
                step += 1
                for i, gradient in enumerate(self._gradients(x[rows], y[rows])):
                    first[i] += 0.1 * (gradient - first[i])
                    second[i] += 0.001 * (gradient**2 - second[i])
                    along = first[i] / (1 - 0.9**step) / (np.sqrt(second[i] / (1 - 0.999**step)) + 1e-8)
                    self._w[i] -= rate * (1 - epoch / epochs) * along

    def __call__(self, x):
        return self._layers(self._scaled(x))[-1] * self._y[1] + self._y[0]

    def _scaled(self, x):
        return np.clip((x - self._x[0]) / self._x[1], -5, 5)  # Collisions have large forces.

    def _layers(self, x):
        a = np.tanh(x @ self._w[0] + self._w[3])
        b = np.tanh(a @ self._w[1] + self._w[4])
        return a, b, b @ self._w[2] + self._w[5]

    def _gradients(self, x, y):
        a, b, out = self._layers(x)
        out = (out - y) / len(y)
        of_b = out @ self._w[2].T * (1 - b**2)
        of_a = of_b @ self._w[1].T * (1 - a**2)
        return x.T @ of_a, a.T @ of_b, b.T @ out, of_a.sum(axis=0), of_b.sum(axis=0), out.sum(axis=0)


def policy(variant, network):
    """A hand that begins."""
    seen, before = [], []

    def hand(state, *columns):
        seen.append((state, *columns, before.pop() if before else state[:3]))
        del seen[:-HISTORY]
        ahead = network(features(variant, *(np.array(column) for column in zip(*seen)))[-1:])[0]
        before.append(state[:3] + ahead)
        return ahead
    return hand


def wilson(good, count):
    """The interval of 95 %, in %."""
    z, share = 1.96, good / count
    middle, half = share + z**2 / (2 * count), z * np.sqrt(share * (1 - share) / count + z**2 / (4 * count**2))
    return 100 * (middle - half) / (1 + z**2 / count), 100 * (middle + half) / (1 + z**2 / count)


def study(haptic, mujoco, seed, given, found):
    """Adds to `found`. Returns how many windows of the demonstrations were others online."""
    demonstrations, good, same = demonstrate(haptic, mujoco, seed, given.demonstrations)
    print(f"seed {seed}: {good} of {given.demonstrations} demonstrations had success; of their {same.sum()} windows {same[0]} were the "
          f"same online, {same[1]} ended a tick earlier there, {same[2]} were others", flush=True)
    hands = {"straight down": lambda: straight_down, "expert": lambda: expert} if seed == given.seed else {}
    for variant in VARIANTS:
        x = np.concatenate([features(variant, state, force, window, np.vstack([state[:1, :3], target[:-1]]))
                            for state, force, window, target in demonstrations])
        y = np.concatenate([target - state[:, :3] for state, _, _, target in demonstrations])
        hands[variant] = functools.partial(policy, variant, Network(x, y, np.random.default_rng([seed, 1])))
    for name, begin in hands.items():
        for condition in CONDITIONS:
            rollouts = (attempt(haptic, mujoco, begin(), np.random.default_rng([seed, 2, i]), condition) for i in range(given.rollouts))
            found.setdefault(name, {}).setdefault(condition, []).append(sum(rollouts))
    return same[2]


def show(found, count):
    """count: of rollouts of each hand, condition and training seed."""
    print(f"{'':14}" + "".join(f"{condition:>34}" for condition in CONDITIONS))
    for name, of_conditions in found.items():
        cells = []
        for good in of_conditions.values():
            total = count * len(good)
            least, most = wilson(sum(good), total)
            cells.append(f"{sum(good)}/{total} ({least:.0f}-{most:.0f} %) {'+'.join(map(str, good))}")
        print(f"{name:14}" + "".join(f"{cell:>34}" for cell in cells))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("library", "package", "replay"):
        parser.add_argument(name, type=pathlib.Path)
    parser.add_argument("--demonstrations", type=int, default=50)
    parser.add_argument("--rollouts", type=int, default=15, help="of each hand, condition and training seed")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1, help="the first")
    given = parser.parse_args()
    os.environ.update(HAPTIC_LIBRARY=str(given.library.resolve()), HAPTIC_PROGRAMS=str(given.replay.resolve().parent))
    sys.path.insert(0, str(given.package.resolve()))
    import haptic_local_model as haptic
    import haptic_local_model.dataset
    import haptic_local_model.mujoco
    import haptic_local_model.virtual
    import mujoco

    found = {}
    others = sum(study(haptic, mujoco, seed, given, found) for seed in range(given.seed, given.seed + given.seeds))
    show(found, given.rollouts)
    return 1 if others else 0


if __name__ == "__main__":
    sys.exit(main())
