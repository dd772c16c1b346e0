"""A data set in memory: maps as small integer rasters, missions as paths and graphs, in flat arrays."""

import json
import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from . import raster, shards

TARGET_SIDE = 200
"""Cells per side of the target heatmap (nngtl.md, IV-D)."""

REACH = 0.04
"""Radius, in sides of the frame, of the part of a region around the expert's entry that counts as its place of arrival."""

UNDRAWN = 8
"""Cells per side of the maps of networks that do not look at them."""

FARTHEST = 4.0
"""Ways count as at most so many sides of the frame; where none leads, too."""

CACHE_VERSION = 4


@dataclass
class Missions:
    """Missions of one data set at one resolution.

    Arrays that hold a different number of rows for each mission are concatenated; mission ``k`` owns rows
    ``at[k]`` to ``at[k + 1]`` with ``at`` the array of that name with ``_at``.
    """

    resolution: int
    labels: int
    fingerprint: str
    codes: np.ndarray  # (maps, R, R): bit 0 obstacle, bit 1 + k region k
    map: np.ndarray  # (N): each mission's map
    start: np.ndarray  # (N, 2): in the frame [0, 1]²
    order: np.ndarray  # (N, labels): the region of each channel, −1 none
    points: np.ndarray  # (P, 2): prefix and suffix, in the frame
    points_at: np.ndarray
    prefix: np.ndarray  # (N): how many of them are the prefix
    cells: np.ndarray  # (C): marked cells of the target at 200×200, flat
    cells_at: np.ndarray
    reach: np.ndarray  # cells of the regions that the path enters, within REACH of the entries
    reach_at: np.ndarray
    legs: np.ndarray  # (L, 3): from x, y straight to a region: its number on the map
    legs_at: np.ndarray
    states: np.ndarray  # (S, 3)
    visited: np.ndarray  # (S)
    states_at: np.ndarray
    edges: np.ndarray  # (T, 2): source, target within the mission
    literals: np.ndarray  # (T, labels)
    edges_at: np.ndarray
    ways: np.ndarray  # (N, labels + 1, labels + 1): lengths between channels and the start, in sides of the frame; NaN unknown
    family: np.ndarray  # (N): names
    pattern: np.ndarray
    skipped: dict = field(default_factory=dict)

    def __len__(self):
        return len(self.map)

    def families(self):
        """How many missions there are on each family of maps."""
        return dict(zip(*(a.tolist() for a in np.unique(self.family, return_counts=True))))


def load(directory, config, cache=None, limit=None, families=None):
    """Reads and rasterises a data set; with ``cache`` a folder, keeps the result there.

    ``config`` gives ``labels``, ``resolution`` and optionally ``suffix`` (default true) and ``max_transitions``
    (missions with larger automata are skipped in training; default 4000). ``limit`` stops after so many maps. ``families`` leaves
    out maps of other families, uncounted.
    """
    manifest = shards.verify(directory)
    # Networks that read no raster need no cells either.
    drawn = "resolution" in config
    side, labels = config["resolution"] if drawn else UNDRAWN, config["labels"]
    suffix, most = config.get("suffix", True), config.get("max_transitions", 4000)
    kinds = "+".join(sorted(families or ["all"]))
    name = f"{shards.fingerprint(manifest)}-{side}-{labels}-{suffix}-{most}-{limit}-{kinds}-v{CACHE_VERSION}.npz"
    path = Path(cache) / name if cache else None
    if path and path.is_file():
        with np.load(path) as stored:
            kept = {key: stored[key] for key in stored.files}
        skipped = dict(zip(kept.pop("skipped_why"), kept.pop("skipped_count").tolist()))
        return Missions(side, labels, shards.fingerprint(manifest), skipped=skipped, **kept)
    builder = _Builder(side, labels, suffix, most, drawn)
    for number, (place, entry) in enumerate(shards.maps(directory, manifest)):
        if limit is not None and number >= limit:
            break
        if not families or entry["family"] in families:
            _check_ways(place, entry)
            builder.add(entry)
    arrays = builder.arrays()
    if path:
        path.parent.mkdir(parents=True, exist_ok=True)
        why = np.array(list(builder.skipped), dtype="U64")
        count = np.array(list(builder.skipped.values()), dtype=np.int64)
        # Ranks that find no cache build it side by side: each writes a file of its own, and the last one stays.
        partial = path.with_suffix(f".{os.getpid()}.partial.npz")
        np.savez(partial, skipped_why=why, skipped_count=count, **arrays)
        partial.replace(path)
    return Missions(side, labels, shards.fingerprint(manifest), skipped=builder.skipped, **arrays)


def _check_ways(place, entry):
    """Refuses a map whose ``ways``, its own or a mission's, are not as docs/dataset.md describes them."""
    regions = len(entry["regions"])
    lists = []
    if "ways" in entry:
        rows = entry["ways"]
        if not isinstance(rows, list) or len(rows) != regions:
            raise _bad_ways(place, "ways", f"a list for each of the {regions} regions", rows)
        lists += [(f"ways of region l{k + 1}", row, k + 1) for k, row in enumerate(rows)]
    for number, mission in enumerate(entry["missions"], start=1):
        if "ways" in mission:
            lists.append((f"mission {number}: ways", mission["ways"], regions))
    for what, lengths, wanted in lists:
        if not isinstance(lengths, list) or len(lengths) != wanted or not all(map(_is_length, lengths)):
            raise _bad_ways(place, what, f"{wanted} lengths", lengths)


def _is_length(value):
    """No way at all is null."""
    return value is None or isinstance(value, (int, float)) and not isinstance(value, bool) and value >= 0


def _bad_ways(place, what, wanted, found):
    """The error of ``ways`` that are not what is wanted."""
    text = json.dumps(found)
    short = text if len(text) <= 80 else text[:77] + "..."
    return shards.DataError(
        f"{place}: {what}: expected {wanted}, found {short}: write them as docs/dataset.md says, or leave out `ways` in the whole set"
    )


_NO_CELLS = {
    "cells": np.zeros(0, dtype=np.uint16),
    "reach": np.zeros(0, dtype=np.uint16),
    "legs": np.zeros((0, 3), dtype=np.float32),
}


class _Builder:
    """Collects missions into flat arrays."""

    def __init__(self, side, labels, suffix, most, drawn=True):
        self.side, self.labels, self.suffix, self.most, self.drawn = side, labels, suffix, most, drawn
        self.codes, self.rows, self.skipped = [], [], {}

    def add(self, entry):
        (x0, y0), (x1, y1) = entry["bounds"]
        scale = max(x1 - x0, y1 - y0)
        frame = lambda points: (np.asarray(points, dtype=np.float64).reshape(-1, 2) - (x0, y0)) / scale
        obstacles = [frame(p) for p in entry["obstacles"]]
        regions = [frame(p) for p in entry["regions"]]
        extent = ((x1 - x0) / scale, (y1 - y0) / scale)
        fine = raster.map_codes(obstacles, [], extent, TARGET_SIDE) & 1 == 0 if self.drawn else None
        used = False
        for mission in entry["missions"]:
            why = self._refuse(mission)
            if why:
                self.skipped[why] = self.skipped.get(why, 0) + 1
                continue
            self.rows.append(self._row(entry, mission, frame, fine, regions))
            used = True
        if used:
            self.codes.append(raster.map_codes(obstacles, regions, extent, self.side))

    def _refuse(self, mission):
        if len(mission["order"]) > self.labels:
            return "more regions than channels"
        if len(mission["automaton"]["transitions"]) > self.most:
            return "automaton too large"
        return None

    def _row(self, entry, mission, frame, free, regions):
        prefix, suffix = frame(mission["prefix"]), frame(mission["suffix"])
        cells = self._cells(mission, prefix, suffix, free, regions) if self.drawn else _NO_CELLS
        automaton = mission["automaton"]
        states = np.zeros((automaton["states"], 3), dtype=np.float32)
        states[automaton["initial"], 0] = 1
        states[automaton["accepting"], 1] = 1
        states[:, 2] = automaton["distance"]
        visited = np.zeros(automaton["states"], dtype=np.uint8)
        visited[mission["visited"]] = 1
        edges = automaton["transitions"]
        literals = np.zeros((len(edges), self.labels), dtype=np.int8)
        if edges and mission["order"]:
            literals[:, : len(mission["order"])] = [e[2] for e in edges]
        order = np.full(self.labels, -1, dtype=np.int8)
        order[: len(mission["order"])] = mission["order"]
        return {
            "map": len(self.codes),
            "start": frame(mission["start"])[0],
            "order": order,
            "points": np.concatenate([prefix, suffix]),
            "prefix": len(prefix),
            **cells,
            "states": states,
            "visited": visited,
            "edges": np.array([e[:2] for e in edges], dtype=np.int32).reshape(-1, 2),
            "literals": literals,
            "ways": self._ways(entry, mission),
            "family": entry["family"],
            "pattern": mission["pattern"],
        }

    def _cells(self, mission, prefix, suffix, free, regions):
        """What a mission marks at 200×200, and its straight legs."""
        marks = raster.path(prefix * TARGET_SIDE, TARGET_SIDE)
        if self.suffix:
            marks |= raster.path(suffix * TARGET_SIDE, TARGET_SIDE)
        marks = raster.grow(marks) & free
        used = [(k, regions[k]) for k in mission["order"]]
        entries, legs = arrivals(prefix, used)
        if self.suffix:
            entries += arrivals(suffix, used)[0]
        reach = np.zeros_like(marks)
        for point, shape in entries:
            reach |= _disc(point) & raster.polygon(shape * TARGET_SIDE, TARGET_SIDE)
        return {
            "cells": np.flatnonzero(marks).astype(np.uint16),
            "reach": np.flatnonzero(reach & free).astype(np.uint16),
            "legs": np.array(legs, dtype=np.float32).reshape(-1, 3),
        }

    def _ways(self, entry, mission):
        """Docs/networks.md, *Ways*: channels and then the start."""
        out = np.zeros((self.labels + 1, self.labels + 1), dtype=np.float32)
        if "ways" not in entry or "ways" not in mission:
            return np.full_like(out, np.nan)
        (x0, y0), (x1, y1) = entry["bounds"]
        number = lambda x: FARTHEST if x is None else min(x / max(x1 - x0, y1 - y0), FARTHEST)
        for c, k in enumerate(mission["order"]):
            out[c, self.labels] = out[self.labels, c] = number(mission["ways"][k])
            for d, l in enumerate(mission["order"][: c + 1]):
                out[c, d] = out[d, c] = number(entry["ways"][max(k, l)][min(k, l)])
        return out

    def arrays(self):
        if not self.rows:
            raise shards.DataError(f"no usable mission in the data set; skipped: {self.skipped}")
        column = lambda name: [row[name] for row in self.rows]
        out = {
            "codes": np.stack([c.astype(max((c.dtype for c in self.codes), key=lambda d: d.itemsize)) for c in self.codes]),
            "map": np.array(column("map"), dtype=np.int32),
            "start": np.array(column("start"), dtype=np.float32),
            "order": np.stack(column("order")),
            "prefix": np.array(column("prefix"), dtype=np.int32),
            "ways": np.stack(column("ways")),
            "family": np.array(column("family")),
            "pattern": np.array(column("pattern")),
        }
        for name in ("points", "cells", "reach", "legs", "states", "visited", "edges", "literals"):
            parts = column(name)
            out[name] = np.concatenate(parts)
            if name not in ("visited", "literals"):
                out[f"{name}_at"] = np.concatenate([[0], np.cumsum([len(p) for p in parts])])
        out["points"] = out["points"].astype(np.float32)
        return out


def arrivals(path, regions):
    """Where a path enters regions, and its legs that run straight from one such place (or the start) to the next.

    ``regions`` lists (number, polygon). Returns [(entry point, polygon)] and [(x, y, number)], a leg's
    beginning and the region that it ends in.
    """
    entries, legs, last = [], [], path[0]
    within = {number: bool(_contains(shape, path[:1])[0]) for number, shape in regions}
    for k, (a, b) in enumerate(zip(path, path[1:])):
        steps = max(2, int(np.ceil(np.linalg.norm(b - a) * 2 * TARGET_SIDE)))
        points = a + np.linspace(0, 1, steps + 1)[1:, None] * (b - a)
        found = []
        for number, shape in regions:
            inside = _contains(shape, points)
            before = np.concatenate([[within[number]], inside[:-1]])
            found += [(step, number, shape) for step in np.flatnonzero(inside & ~before)]
            within[number] = bool(inside[-1])
        for step, number, shape in sorted(found, key=lambda f: f[:2]):
            entries.append((points[step], shape))
            if last is not None:
                legs.append((*last, number))
            last = points[step]
        if any(within.values()):
            last = b
        elif last is not None and k + 2 < len(path) and _beside(b, last, path[k + 2]) > 0.5 / TARGET_SIDE:
            last = None  # a corner: the leg that it lies on is not straight
    return entries, legs


def _beside(point, a, b):
    """How far a point lies from the line through ``a`` and ``b``."""
    d = b - a
    length = np.linalg.norm(d)
    away = point - a
    return abs(d[0] * away[1] - d[1] * away[0]) / length if length > 0 else np.linalg.norm(away)


def _contains(polygon, points):
    """Even-odd rule for single points: (N) bool."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    x, y = points[:, :1], points[:, 1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        at = a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return (((a[:, 1] > y) != (b[:, 1] > y)) & (x < at)).sum(axis=1) % 2 == 1


def _disc(point):
    """The cells within REACH of a point of the frame, at 200×200."""
    centre = (np.arange(TARGET_SIDE) + 0.5) / TARGET_SIDE
    return (centre[:, None] - point[0]) ** 2 + (centre[None] - point[1]) ** 2 <= REACH**2
