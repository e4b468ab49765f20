#!/usr/bin/env python3
"""Writes the meshes of worlds/mesh.sdf and worlds/assembly.sdf beside this file. Lengths in m."""
import math
import pathlib

FOLDER = pathlib.Path(__file__).parent


def write(name, points, faces):
    """An OBJ file; faces are loops of indices from 0, counter-clockwise seen from outside."""
    lines = [f"# Written by {pathlib.Path(__file__).name}."]
    lines += [f"v {x:.6g} {y:.6g} {z:.6g}" for x, y, z in points]
    lines += ["f " + " ".join(str(i + 1) for i in face) for face in faces]
    (FOLDER / name).write_text("\n".join(lines) + "\n")


def frustum(bottom, top, height):
    """A square pyramid's frustum about z, its middle at the origin."""
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    points = [(x * size / 2, y * size / 2, z) for size, z in ((bottom, -height / 2), (top, height / 2)) for x, y in corners]
    sides = [(i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)]
    return points, [(3, 2, 1, 0), (4, 5, 6, 7), *sides]


def turned(profile, sides):
    """A body of revolution about z: the closed profile (r, z) counter-clockwise, seen with r to the right."""
    points, faces = [], []
    for i in range(sides):
        angle = 2 * math.pi * i / sides
        points += [(r * math.cos(angle), r * math.sin(angle), z) for r, z in profile]
    n = len(profile)
    for i in range(sides):
        here, there = i * n, (i + 1) % sides * n
        for k in range(n):
            next_k = (k + 1) % n
            faces.append((here + k, there + k, there + next_k, here + next_k))
    return points, faces


def extruded(outline, height):
    """A slab with the outline (x, y), counter-clockwise, in triangles of its own ear clipping."""
    n = len(outline)
    points = [(x, y, -height / 2) for x, y in outline] + [(x, y, height / 2) for x, y in outline]

    def cross(a, b, c):
        (ax, ay), (bx, by), (cx, cy) = outline[a], outline[b], outline[c]
        return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)

    left, ears = list(range(n)), []
    while len(left) > 3:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            inside = [p for p in left if p not in (a, b, c) and cross(a, b, p) >= 0
                      and cross(b, c, p) >= 0 and cross(c, a, p) >= 0]
            if cross(a, b, c) > 0 and not inside:
                ears.append((a, b, c))
                left.pop(k)
                break
    ears.append(tuple(left))
    faces = [(c, b, a) for a, b, c in ears] + [(a + n, b + n, c + n) for a, b, c in ears]
    faces += [(i, (i + 1) % n, (i + 1) % n + n, i + n) for i in range(n)]
    return points, faces


def terrain(cells, size, thickness):
    """A closed block with a rolling top."""
    n = cells + 1
    step = size / cells
    points, faces = [], []
    for top in (True, False):
        for i in range(n):
            for k in range(n):
                x, y = i * step - size / 2, k * step - size / 2
                wave = 0.008 * math.sin(25 * x) * math.cos(20 * y) + 0.004 * math.sin(60 * x + 30 * y)
                points.append((x, y, wave if top else -thickness))
    for i in range(cells):
        for k in range(cells):
            a, b, c, d = i * n + k, (i + 1) * n + k, (i + 1) * n + k + 1, i * n + k + 1
            faces += [(a, b, c), (a, c, d)]
            faces += [(n * n + a, n * n + c, n * n + b), (n * n + a, n * n + d, n * n + c)]
    rim = ([i * n for i in range(cells)] + [cells * n + k for k in range(cells)]
           + [(cells - i) * n + cells for i in range(cells)] + [cells - k for k in range(cells)])
    for a, b in zip(rim, rim[1:] + rim[:1]):
        faces += [(n * n + a, n * n + b, b), (n * n + a, b, a)]
    return points, faces


def main():
    write("cup.obj", *turned([(0.004, 0), (0.03, 0), (0.034, 0.05), (0.03, 0.05), (0.026, 0.005), (0.004, 0.005)], 24))
    write("hook.obj", *extruded([(0, 0), (0.05, 0), (0.05, 0.03), (0.038, 0.03), (0.038, 0.012), (0.012, 0.012),
                                 (0.012, 0.08), (0, 0.08)], 0.012))
    write("tip.obj", *frustum(0.007, 0.0115, 0.014))
    write("terrain.obj", *terrain(24, 0.3, 0.05))


if __name__ == "__main__":
    main()
