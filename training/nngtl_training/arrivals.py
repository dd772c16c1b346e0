"""Where a path enters regions: what the target's ``reach`` and the metrics' draws are about."""

import numpy as np

STEPS = 400
"""A path is looked at so many times a side of the frame."""

STRAIGHT = 1 / 400
"""A corner of the path that lies this near to the straight line, in sides, is none."""


def arrivals(path, regions):
    """Where a path enters regions, and its legs that run straight from one such place (or the start) to the next.

    ``regions`` lists (number, polygon). Returns [(x, y, number)] twice: the entries, and the legs' beginnings with the
    region that each ends in.
    """
    points, leg = _walked(path)
    inside = {number: contains(shape, points) for number, shape in regions}
    found = [(step + 1, number) for number, within in inside.items() for step in np.flatnonzero(within[1:] & ~within[:-1])]
    found.sort()
    # Whether any region holds the last point of each leg.
    held = np.zeros(len(points), dtype=bool)
    for within in inside.values():
        held |= within
    ends = np.flatnonzero(np.diff(leg, append=len(path)))[1:]
    entries, legs, last, next_ = [], [], path[0], 0
    for k, end in enumerate(ends):
        while next_ < len(found) and found[next_][0] <= end:
            step, number = found[next_]
            entries.append((*points[step], number))
            if last is not None:
                legs.append((*last, number))
            last, next_ = points[step], next_ + 1
        corner = path[k + 1]
        if held[end]:
            last = corner
        elif last is not None and k + 2 < len(path) and _beside(corner, last, path[k + 2]) > STRAIGHT:
            last = None  # a corner: the leg that it lies on is not straight
    return entries, legs


def _walked(path):
    """Points along a path, its first one and then at least STEPS a side, and the leg of each (from 1; 0 for the first one)."""
    along = np.diff(path, axis=0)
    steps = np.maximum(2, np.ceil(np.hypot(along[:, 0], along[:, 1]) * STEPS).astype(np.int64))
    leg = np.repeat(np.arange(len(steps)), steps)
    share = (np.arange(len(leg)) - (np.cumsum(steps) - steps)[leg] + 1) / steps[leg]
    points = np.concatenate([path[:1], path[leg] + share[:, None] * along[leg]])
    return points, np.concatenate([[0], leg + 1])


def _beside(point, a, b):
    """How far a point lies from the line through ``a`` and ``b``."""
    d = b - a
    length = np.hypot(*d)
    away = point - a
    return abs(d[0] * away[1] - d[1] * away[0]) / length if length > 0 else np.hypot(*away)


def contains(polygon, points):
    """Even-odd rule for single points: (N) bool."""
    out = np.zeros(len(points), dtype=bool)
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    near = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    a, b = polygon, np.roll(polygon, -1, axis=0)
    x, y = points[near, :1], points[near, 1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        at = a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    out[near] = (((a[:, 1] > y) != (b[:, 1] > y)) & (x < at)).sum(axis=1) % 2 == 1
    return out
