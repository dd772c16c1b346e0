"""Small made-up data sets for tests: rectangles, hand-made automata, shortest tours over corners.

They have the form of docs/dataset.md and enough sense for learning to be visible; real data comes from
``nngtl dataset generate``.
"""

import gzip
import hashlib
import itertools
import json
from pathlib import Path

import numpy as np


def rectangle(x, y, w, h):
    return [[round(a, 4), round(b, 4)] for a, b in ((x, y), (x + w, y), (x + w, y + h), (x, y + h))]


def overlaps(a, b, gap):
    return a[0] < b[0] + b[2] + gap and b[0] < a[0] + a[2] + gap and a[1] < b[1] + b[3] + gap and b[1] < a[1] + a[3] + gap


def draw_map(rng, regions):
    """Two large obstacles and ``regions`` small squares, apart from each other."""
    boxes = []
    while len(boxes) < 2 + regions:
        big = len(boxes) < 2
        w, h = rng.uniform(0.15, 0.45, 2) if big else rng.uniform(0.06, 0.12, 2)
        box = (rng.uniform(0.02, 0.98 - w), rng.uniform(0.02, 0.98 - h), w, h)
        if not any(overlaps(box, other, 0.03) for other in boxes):
            boxes.append(box)
    return boxes[:2], boxes[2:]


def blocked(a, b, box):
    """Which segments a[i]–b[j] cut the interior of a box: (len(a), len(b))."""
    a, b = a[:, None], b[None]
    d = b - a
    low, high = np.zeros(d.shape[:2]), np.ones(d.shape[:2])
    for axis in (0, 1):
        lo, hi = box[axis] + 1e-6, box[axis] + box[axis + 2] - 1e-6
        with np.errstate(divide="ignore", invalid="ignore"):
            t0, t1 = (lo - a[..., axis]) / d[..., axis], (hi - a[..., axis]) / d[..., axis]
        inside = (a[..., axis] > lo) & (a[..., axis] < hi)
        flat = d[..., axis] == 0
        low = np.maximum(low, np.where(flat, np.where(inside, 0, 2), np.minimum(t0, t1)))
        high = np.minimum(high, np.where(flat, np.where(inside, 1, -1), np.maximum(t0, t1)))
    return low < high


def roadmap(points, boxes):
    """Lengths and next hops between points by way of box corners (Floyd and Warshall)."""
    corners = [c for x, y, w, h in boxes for c in ((x, y), (x + w, y), (x + w, y + h), (x, y + h))]
    nodes = np.array(list(points) + corners)
    length = np.linalg.norm(nodes[:, None] - nodes[None], axis=2)
    for box in boxes:
        length[blocked(nodes, nodes, box)] = np.inf
    hop = np.tile(np.arange(len(nodes)), (len(nodes), 1))
    for k in range(len(nodes)):
        through = length[:, k : k + 1] + length[k : k + 1]
        better = through < length - 1e-12
        length = np.where(better, through, length)
        hop = np.where(better, hop[:, k : k + 1], hop)
    return nodes, length, hop


def walk(nodes, hop, a, b):
    way = [a]
    while a != b:
        a = hop[a, b]
        way.append(a)
    return [[round(float(v), 4) for v in nodes[k]] for k in way]


def visit_all(n):
    """Visit n regions in any order: the lattice of subsets."""
    transitions = []
    for state in range(2**n):
        open_ = [i for i in range(n) if not state >> i & 1]
        transitions.append([state, state, [-1 if i in open_ else 0 for i in range(n)]])
        for i in open_:
            transitions.append([state, state | 1 << i, [1 if j == i else -1 if j in open_ else 0 for j in range(n)]])
    distance = [(n - bin(s).count("1")) / max(n, 1) for s in range(2**n)]
    return dict(initial=[0], accepting=[2**n - 1], states=2**n, distance=distance, transitions=transitions)


def in_sequence(n):
    """Visit n regions in their order, entering none ahead of time."""
    transitions = []
    for state in range(n + 1):
        later = [-1 if i >= state else 0 for i in range(n)]
        transitions.append([state, state, later])
        if state < n:
            transitions.append([state, state + 1, [1 if i == state else v for i, v in enumerate(later)]])
    return dict(
        initial=[0], accepting=[n], states=n + 1, distance=[(n - s) / n for s in range(n + 1)], transitions=transitions
    )


def draw_mission(rng, boxes, squares):
    n = int(rng.integers(1, 4))
    order = [int(v) for v in rng.permutation(len(squares))[:n]]
    centres = [(x + w / 2, y + h / 2) for x, y, w, h in squares]
    while True:
        start = rng.uniform(0.02, 0.98, 2)
        if not any(overlaps((*start, 0, 0), box, 0.01) for box in boxes + squares):
            break
    start = [round(float(v), 4) for v in start]
    nodes, length, hop = roadmap([start] + [centres[k] for k in order], boxes)
    free = rng.random() < 0.6
    tours = itertools.permutations(range(n)) if free else [tuple(range(n))]
    cost = lambda tour: sum(length[a, b] for a, b in zip([0] + [t + 1 for t in tour], [t + 1 for t in tour]))
    tour = min(tours, key=cost)
    if not np.isfinite(cost(tour)):
        return None
    prefix, at, visited, state = [start], 0, [0], 0
    for t in tour:
        prefix += walk(nodes, hop, at, t + 1)[1:]
        at = t + 1
        state = state | 1 << t if free else state + 1
        visited.append(state)
    _, around, _ = roadmap([start] + centres, boxes)
    return {
        "start": start,
        "ways": [round(float(v), 4) for v in around[0, 1 : 1 + len(centres)]],
        "formula": " && ".join(f"<> l{k + 1}" for k in order),
        "pattern": "visit" if free else "sequence",
        "order": order,
        "automaton": visit_all(n) if free else in_sequence(n),
        "prefix": prefix,
        "suffix": [prefix[-1]],
        "visited": sorted(visited),
        "cost": 0.2 * float(cost(tour)),
    }


def map_ways(boxes, squares):
    """Ways between the squares' centres, and last the radius of a disc of a square's area."""
    _, length, _ = roadmap([(x + w / 2, y + h / 2) for x, y, w, h in squares], boxes)
    for k, (_, _, w, h) in enumerate(squares):
        length[k, k] = (w * h / np.pi) ** 0.5
    return [[round(float(v), 4) for v in length[k, : k + 1]] for k in range(len(squares))]


def write(directory, maps, seed=0, missions=4, shards=2, regions=7):
    """Writes a data set and returns its maps."""
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    entries = []
    for index in range(maps):
        rng = np.random.default_rng([seed, index])
        boxes, squares = draw_map(rng, regions)
        drawn = [draw_mission(rng, boxes, squares) for _ in range(missions)]
        entries.append(
            {
                "index": index,
                "family": "paper",
                "bounds": [[0, 0], [1, 1]],
                "obstacles": [rectangle(*b) for b in boxes],
                "regions": [rectangle(*b) for b in squares],
                "ways": map_ways(boxes, squares),
                "missions": [m for m in drawn if m],
            }
        )
    cut = np.array_split(np.arange(maps), shards)
    listed = []
    for number, part in enumerate(cut):
        name = f"shard-{number:05}.jsonl.gz"
        text = "".join(json.dumps(entries[k]) + "\n" for k in part)
        (directory / name).write_bytes(gzip.compress(text.encode(), mtime=0))
        listed.append(
            {
                "file": name,
                "sha256": hashlib.sha256((directory / name).read_bytes()).hexdigest(),
                "maps": len(part),
                "missions": sum(len(entries[k]["missions"]) for k in part),
                "from": int(part[0]) if len(part) else 0,
                "to": int(part[-1]) + 1 if len(part) else 0,
            }
        )
    manifest = {
        "format": 1,
        "generator": "synthetic",
        "seed": seed,
        "from": 0,
        "to": maps,
        "maps": maps,
        "missions": sum(s["missions"] for s in listed),
        "filtered": {},
        "families": {"paper": maps},
        "shards": listed,
    }
    (directory / "manifest.json").write_text(json.dumps(manifest))
    return entries
