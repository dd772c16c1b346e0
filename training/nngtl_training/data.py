"""A data set in memory: maps as polygons, missions as paths and graphs, in flat arrays, on the host and on a device."""

import json
import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch

from . import shards
from .arrivals import arrivals
from .drawing import Lines, outlines

FARTHEST = 4.0
"""Ways count as at most so many sides of the frame; where none leads, too."""

CACHE_VERSION = 5


@dataclass
class Missions:
    """Missions of one data set, as vectors: what is drawn is drawn where it is needed (``batches``, ``targets``).

    Arrays that hold a different number of rows for each mission are concatenated; mission ``k`` owns rows
    ``at[k]`` to ``at[k + 1]`` with ``at`` the array of that name with ``_at``. Coordinates are in the frame [0, 1]².
    """

    resolution: int | None  # cells per side of the raster that the network reads, if it reads one
    labels: int
    suffix: bool  # whether the target includes it
    fingerprint: str
    corners: np.ndarray  # (V, 2): of the maps' polygons
    corners_at: np.ndarray  # for each polygon
    polygons_at: np.ndarray  # for each map: its obstacles and then its regions
    obstacles: np.ndarray  # (maps): how many of its polygons are obstacles
    extent: np.ndarray  # (maps, 2): how far the bounds reach
    map: np.ndarray  # (N): each mission's map
    start: np.ndarray  # (N, 2)
    order: np.ndarray  # (N, labels): the region of each channel, −1 none
    points: np.ndarray  # (P, 2): prefix and suffix
    points_at: np.ndarray
    prefix: np.ndarray  # (N): how many of them are the prefix
    entries: np.ndarray  # (A, 3): x, y where the path enters a region, and its number on the map
    entries_at: np.ndarray
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

    def __post_init__(self):
        self.device, self._moved = torch.device("cpu"), {}

    def __len__(self):
        return len(self.map)

    def families(self):
        """How many missions there are on each family of maps."""
        return dict(zip(*(a.tolist() for a in np.unique(self.family, return_counts=True))))

    def to(self, device):
        """Draws and gives batches on this device from now on."""
        if torch.device(device) != self.device:
            self.device, self._moved = torch.device(device), {}
        return self

    def on(self, name):
        """An array on the device, moved there when it is first asked for."""
        return self.kept(name, lambda: torch.from_numpy(getattr(self, name)).to(self.device))

    def walls(self):
        """The edges of the maps' polygons, numbered as ``corners`` are; obstacles on layer 0, region k on 1 + k."""
        return self.kept("walls", self._walls)

    def trail(self):
        """The paths' lines: number p from point p to the next one, that from a path's last point to itself."""
        return self.kept("trail", self._trail)

    def layers(self):
        """How many layers ``walls`` has."""
        return self.kept("layers", lambda: 1 + int((np.diff(self.polygons_at) - self.obstacles).max()))

    def kept(self, name, make):
        """What ``make`` gave when this was first asked for under the name, on this device."""
        if name not in self._moved:
            self._moved[name] = make()
        return self._moved[name]

    def _walls(self):
        number = np.diff(self.polygons_at)
        layer = np.arange(len(self.corners_at) - 1) - np.repeat(self.polygons_at[:-1] + self.obstacles - 1, number)
        layer = np.repeat(np.maximum(layer, 0), np.diff(self.corners_at))
        return Lines(outlines(self.corners, self.corners_at), self.device, layer)

    def _trail(self):
        following = np.minimum(np.arange(1, len(self.points) + 1), len(self.points) - 1)
        for last in (self.points_at[:-1] + self.prefix - 1, self.points_at[1:] - 1):
            following[last] = last
        return Lines(np.hstack([self.points, self.points[following]]), self.device)


def load(directory, config, cache=None, limit=None, families=None):
    """Reads a data set; with ``cache`` a folder, keeps what was read there.

    ``config`` gives ``labels``, ``resolution`` and optionally ``suffix`` (default true) and ``max_transitions``
    (missions with larger automata are skipped in training; default 4000). ``limit`` stops after so many maps. ``families`` leaves
    out maps of other families, uncounted.
    """
    manifest = shards.verify(directory)
    side, labels = config.get("resolution"), config["labels"]
    suffix, most = config.get("suffix", True), config.get("max_transitions", 4000)
    # Networks that read no raster need nothing to draw either.
    drawn = side is not None
    kinds = "+".join(sorted(families or ["all"]))
    name = f"{shards.fingerprint(manifest)}-{drawn}-{labels}-{suffix}-{most}-{limit}-{kinds}-v{CACHE_VERSION}.npz"
    path = Path(cache) / name if cache else None
    if path and path.is_file():
        with np.load(path) as stored:
            kept = {key: stored[key] for key in stored.files}
        skipped = dict(zip(kept.pop("skipped_why"), kept.pop("skipped_count").tolist()))
        return Missions(side, labels, suffix, shards.fingerprint(manifest), skipped=skipped, **kept)
    builder = _Builder(labels, suffix, most, drawn)
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
    return Missions(side, labels, suffix, shards.fingerprint(manifest), skipped=builder.skipped, **arrays)


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


class _Builder:
    """Collects missions into flat arrays."""

    def __init__(self, labels, suffix, most, drawn=True):
        self.labels, self.suffix, self.most, self.drawn = labels, suffix, most, drawn
        self.maps, self.rows, self.skipped = [], [], {}

    def add(self, entry):
        (x0, y0), (x1, y1) = entry["bounds"]
        scale = max(x1 - x0, y1 - y0)
        frame = lambda points: (np.asarray(points, dtype=np.float64).reshape(-1, 2) - (x0, y0)) / scale
        regions = [frame(p) for p in entry["regions"]]
        used = False
        for mission in entry["missions"]:
            why = self._refuse(mission)
            if why:
                self.skipped[why] = self.skipped.get(why, 0) + 1
                continue
            self.rows.append(self._row(entry, mission, frame, regions))
            used = True
        if used:
            self.maps.append(
                {
                    "polygons": [frame(p) for p in entry["obstacles"]] + regions if self.drawn else [],
                    "obstacles": len(entry["obstacles"]) if self.drawn else 0,
                    "extent": ((x1 - x0) / scale, (y1 - y0) / scale),
                }
            )

    def _refuse(self, mission):
        if len(mission["order"]) > self.labels:
            return "more regions than channels"
        if len(mission["automaton"]["transitions"]) > self.most:
            return "automaton too large"
        return None

    def _row(self, entry, mission, frame, regions):
        prefix, suffix = frame(mission["prefix"]), frame(mission["suffix"])
        used = [(k, regions[k]) for k in mission["order"]] if self.drawn else []
        entries, legs = arrivals(prefix, used)
        if self.suffix:
            entries += arrivals(suffix, used)[0]
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
            "map": len(self.maps),
            "start": frame(mission["start"])[0],
            "order": order,
            "points": np.concatenate([prefix, suffix]),
            "prefix": len(prefix),
            "entries": np.array(entries, dtype=np.float64).reshape(-1, 3),
            "legs": np.array(legs, dtype=np.float64).reshape(-1, 3),
            "states": states,
            "visited": visited,
            "edges": np.array([e[:2] for e in edges], dtype=np.int32).reshape(-1, 2),
            "literals": literals,
            "ways": self._ways(entry, mission),
            "family": entry["family"],
            "pattern": mission["pattern"],
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
        polygons = [polygon for entry in self.maps for polygon in entry["polygons"]]
        out = {
            "corners": np.concatenate([np.zeros((0, 2)), *polygons]),
            "corners_at": _bounds(polygons),
            "polygons_at": _bounds([entry["polygons"] for entry in self.maps]),
            "obstacles": np.array([entry["obstacles"] for entry in self.maps]),
            "extent": np.array([entry["extent"] for entry in self.maps], dtype=np.float64),
            "map": np.array(column("map"), dtype=np.int32),
            "start": np.array(column("start")),
            "order": np.stack(column("order")),
            "prefix": np.array(column("prefix"), dtype=np.int32),
            "ways": np.stack(column("ways")),
            "family": np.array(column("family")),
            "pattern": np.array(column("pattern")),
        }
        for name in ("points", "entries", "legs", "states", "visited", "edges", "literals"):
            parts = column(name)
            out[name] = np.concatenate(parts)
            if name not in ("visited", "literals"):
                out[f"{name}_at"] = _bounds(parts)
        return out


def _bounds(parts):
    """Where each of the concatenated parts begins, and the last one ends."""
    return np.concatenate([[0], np.cumsum([len(part) for part in parts], dtype=np.int64)])
