"""Polygons, paths and batches to cells, one at a time in plain numpy: what the package's drawing is compared with.

The rasteriser takes coordinates in *cells*: the frame [0, 1]² scaled by the resolution. Arrays are
indexed ``[i, j]``, ``i`` along x, ``j`` along y, (0, 0) at the lowest coordinates.
"""

import numpy as np

TOLERANCE = 1e-9
"""Cells are shrunk by this much, in cells, so that touching a grid line marks nothing beyond it."""


def _slabs(origin, delta, low, high):
    """The parameter interval in which ``origin + t·delta`` lies in [low, high], clipped to [0, 1].

    ``origin`` and ``delta`` are (E, 1), ``low`` and ``high`` (1, N); an empty interval has its
    first value above its second.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        a = (low - origin) / delta
        b = (high - origin) / delta
    still = np.broadcast_to(delta == 0, a.shape)
    within = (origin >= low) & (origin <= high)
    first = np.where(still, np.where(within, 0.0, 2.0), np.minimum(a, b))
    last = np.where(still, np.where(within, 1.0, -1.0), np.maximum(a, b))
    return np.maximum(first, 0.0), np.minimum(last, 1.0)


def _crossed(starts, ends, columns, rows, margin):
    """Which cells each segment meets: (E, columns, rows), cells grown by ``margin`` on each side."""
    delta = ends - starts
    x = _slabs(starts[:, :1], delta[:, :1], columns[None] - margin, columns[None] + 1.0 + margin)
    y = _slabs(starts[:, 1:], delta[:, 1:], rows[None] - margin, rows[None] + 1.0 + margin)
    first = np.maximum(x[0][:, :, None], y[0][:, None, :])
    last = np.minimum(x[1][:, :, None], y[1][:, None, :])
    return first <= last


def _window(low, high, resolution):
    """The cells between two coordinates, one more on each side, inside the raster."""
    first = int(np.clip(np.floor(low) - 1, 0, resolution))
    last = int(np.clip(np.floor(high) + 2, 0, resolution))
    return np.arange(first, max(first, last), dtype=np.float64)


def polygon(vertices, resolution):
    """The cells whose open square meets the interior of a simple polygon: (R, R) bool."""
    vertices = np.asarray(vertices, dtype=np.float64)
    marks = np.zeros((resolution, resolution), dtype=bool)
    columns = _window(vertices[:, 0].min(), vertices[:, 0].max(), resolution)
    rows = _window(vertices[:, 1].min(), vertices[:, 1].max(), resolution)
    if columns.size == 0 or rows.size == 0:
        return marks
    ends = np.roll(vertices, -1, axis=0)
    hit = _crossed(vertices, ends, columns, rows, -TOLERANCE).any(axis=0)
    hit |= _inside(vertices, ends, columns + 0.5, rows + 0.5)
    marks[int(columns[0]) : int(columns[-1]) + 1, int(rows[0]) : int(rows[-1]) + 1] = hit
    return marks


def _inside(starts, ends, x, y):
    """Even-odd rule at the points of the grid ``x`` × ``y``: (len(x), len(y)) bool."""
    low, high = starts[:, 1:], ends[:, 1:]
    straddles = (low > y[None]) != (high > y[None])  # (E, rows)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (ends[:, :1] - starts[:, :1]) / (high - low)
        at = starts[:, :1] + (y[None] - low) * slope  # where the edge crosses the row
    left = straddles[:, None, :] & (x[None, :, None] < at[:, None, :])
    return left.sum(axis=0) % 2 == 1


def path(points, resolution):
    """The cells that a polyline meets, closed squares: (R, R) bool."""
    points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    marks = np.zeros((resolution, resolution), dtype=bool)
    starts, ends = (points, points) if len(points) == 1 else (points[:-1], points[1:])
    for a, b in zip(starts, ends):
        columns = _window(min(a[0], b[0]), max(a[0], b[0]), resolution)
        rows = _window(min(a[1], b[1]), max(a[1], b[1]), resolution)
        if columns.size == 0 or rows.size == 0:
            continue
        hit = _crossed(a[None], b[None], columns, rows, TOLERANCE)[0]
        marks[int(columns[0]) : int(columns[-1]) + 1, int(rows[0]) : int(rows[-1]) + 1] |= hit
    return marks


def grow(marks):
    """The marked cells and their four neighbours."""
    grown = marks.copy()
    grown[1:] |= marks[:-1]
    grown[:-1] |= marks[1:]
    grown[:, 1:] |= marks[:, :-1]
    grown[:, :-1] |= marks[:, 1:]
    return grown


def cell(point, resolution):
    """The cell of a point of the frame [0, 1]²."""
    i, j = np.clip(np.floor(np.asarray(point, dtype=np.float64) * resolution), 0, resolution - 1)
    return int(i), int(j)


def map_codes(obstacles, regions, extent, resolution):
    """One integer a cell: bit 0 obstacle (or outside of the bounds), bit 1 + k region k.

    Polygons are in the frame [0, 1]²; ``extent`` is how far the bounds reach in it, (width, height).
    """
    code = np.zeros((resolution, resolution), dtype=code_type(len(regions)))
    for vertices in obstacles:
        code |= polygon(np.asarray(vertices) * resolution, resolution).astype(code.dtype)
    for axis, reach in enumerate(extent):
        outside = np.arange(1, resolution + 1) > reach * resolution + TOLERANCE
        code |= (outside[:, None] if axis == 0 else outside[None, :]).astype(code.dtype)
    for k, vertices in enumerate(regions):
        inside = polygon(np.asarray(vertices) * resolution, resolution)
        code |= inside.astype(code.dtype) << (k + 1)
    return code


def code_type(regions):
    """The narrowest integer type that holds the codes of a map with that many regions."""
    for kind in (np.uint8, np.uint16, np.uint32):
        if regions + 1 <= np.iinfo(kind).bits:
            return kind
    raise ValueError(f"{regions} regions on one map, at most 31 are supported")


def turned(grid, turn):
    """One of the eight symmetries of the square: transposed when bit 0 is set, then flipped by bits 1 and 2."""
    if turn & 1:
        grid = grid.T
    if turn & 2:
        grid = grid[::-1]
    if turn & 4:
        grid = grid[:, ::-1]
    return grid


class Sample:
    """One mission of a data set's line, drawn by the book."""

    def __init__(self, entry, mission, side):
        (x0, y0), (x1, y1) = entry["bounds"]
        scale = max(x1 - x0, y1 - y0)
        frame = lambda points: (np.array(points, dtype=np.float64).reshape(-1, 2) - (x0, y0)) / scale
        self.side, self.order = side, mission["order"]
        self.prefix, self.suffix, self.start = frame(mission["prefix"]), frame(mission["suffix"]), frame(mission["start"])[0]
        self.obstacles, self.regions = ([frame(p) for p in entry[kind]] for kind in ("obstacles", "regions"))
        self.extent = ((x1 - x0) / scale, (y1 - y0) / scale)
        self.codes = map_codes(self.obstacles, self.regions, self.extent, side)

    def slid(self, share):
        """The start further along the first leg, or None."""
        if len(self.prefix) < 2:
            return None
        moved = self.prefix[0] + share * (self.prefix[1] - self.prefix[0])
        passed = grow(path(np.stack([self.prefix[0], moved]) * self.side, self.side))
        if len(np.unique(self.codes[passed] >> 1)) > 1 or self.codes[cell(moved, self.side)] & 1:
            return None
        return moved

    def raster(self, start, columns):
        """The network's input, (1 + labels, side, side)."""
        status = (self.codes & 1).astype(np.float32)
        status[cell(start, self.side)] = -1
        out = [status]
        for channel in columns:
            used = channel < len(self.order)
            out.append(self.codes >> (1 + self.order[channel]) & 1 if used else np.zeros_like(self.codes))
        return np.stack(out).astype(np.float32)

    def cells(self, prefix, suffix, entries):
        """The marks at 200×200 of a path, and around its entries (x, y, region) into regions."""
        free = map_codes(self.obstacles, [], self.extent, 200) & 1 == 0
        marks = path(prefix * 200, 200)
        if suffix:
            marks |= path(self.suffix * 200, 200)
        marks = grow(marks)
        centre = (np.arange(200) + 0.5) / 200
        for x, y, region in entries:
            disc = (centre[:, None] - x) ** 2 + (centre[None] - y) ** 2 <= 0.04**2
            marks |= disc & polygon(self.regions[int(region)] * 200, 200)
        return marks & free

    def heat(self, prefix, suffix=True, entries=(), spread=None):
        """The target, (side, side)."""
        if spread is None:
            factor = 200 // self.side
            marks = self.cells(prefix, suffix, entries).astype(np.float32)
            return marks.reshape(self.side, factor, self.side, factor).sum((1, 3)) / factor**2
        centre = (np.arange(self.side) + 0.5) / self.side
        out = np.zeros((self.side, self.side))
        for x, y in [*self.prefix[1:], *(self.suffix if suffix else [])]:
            along, across = (np.exp(-0.5 * ((centre - at) / spread) ** 2) for at in (x, y))
            out = np.maximum(out, np.outer(along, across))
        return out * (self.codes & 1 == 0)
