"""Polygons and paths to cells, many at once, on whatever device the data lie (docs/networks.md, *Map raster*).

Coordinates are those of the frame [0, 1]², grids are indexed ``[..., i, j]``, ``i`` along x, ``j`` along y, (0, 0) at the lowest
coordinates. A line covers in each column of cells a run of rows; the run's ends are added to a grid of differences, and a sum along
the rows makes cells of them. Sizes are known from the data set alone, so nothing waits for the device.
"""

import math

import numpy as np
import torch

TOLERANCE = 1e-9
"""Cells are shrunk (for paths grown) by this much, in cells, so that touching a grid line marks nothing beyond it."""

SLACK = 1e-6
"""A line is tried in the columns that it comes this near to, in cells; more than TOLERANCE and rounding ask for."""

EDGES = 4096
PAIRS = 1 << 20
CELLS = 1 << 22
"""Bounds on memory: so many edges are drawn in one piece, so many columns of edges and cells of grids at a time."""


class Lines:
    """Straight lines in the frame, (n, 4): from x, y to x, y, each on a layer.

    Outlines of polygons run counterclockwise, see ``outlines``.
    """

    def __init__(self, ends, device="cpu", layer=None):
        self.ends_here, self.device = np.ascontiguousarray(ends, dtype=np.float64), torch.device(device)
        self.ends = torch.from_numpy(self.ends_here).to(self.device)
        self.layer = None if layer is None else torch.from_numpy(layer.astype(np.int16)).to(self.device)
        self._windows = {}

    def windows(self, side):
        """Which columns each line is tried in, upright and transposed.

        Returns how many columns the lines before each one have together, (n + 1, 2) and on the host, and the first and last
        column, (n, 2, 2) and on the device.
        """
        if side not in self._windows:
            low = np.minimum(self.ends_here[:, :2], self.ends_here[:, 2:]) * side
            high = np.maximum(self.ends_here[:, :2], self.ends_here[:, 2:]) * side
            first = np.clip(np.floor(low - SLACK), 0, side).astype(np.int64)
            last = np.clip(np.floor(high + SLACK), -1, side - 1).astype(np.int64)
            total = np.zeros((len(low) + 1, 2), dtype=np.int64)
            np.cumsum(np.maximum(last - first + 1, 0), axis=0, out=total[1:])
            window = torch.from_numpy(np.stack([first, last], axis=2).astype(np.int16))
            self._windows[side] = total, window.to(self.device)
        return self._windows[side]


def outlines(corners, at):
    """The edges of polygons with these corners, each polygon's in turn and counterclockwise: (corners, 4).

    Polygon ``p`` owns the corners ``at[p]`` to ``at[p + 1]``.
    """
    sizes = np.diff(at)
    owner = np.repeat(np.arange(len(sizes)), sizes)
    following = np.arange(1, len(corners) + 1)
    following[at[1:][sizes > 0] - 1] = at[:-1][sizes > 0]
    # From a corner of their own, or a small area drowns in rounding.
    away = corners - corners[at[:-1][owner]] if len(corners) else corners
    next_away = away[following]
    area = np.bincount(owner, away[:, 0] * next_away[:, 1] - away[:, 1] * next_away[:, 0], len(sizes))
    back = (area < 0)[owner][:, None]
    return np.where(back, np.hstack([corners[following], corners]), np.hstack([corners, corners[following]]))


def send(values, device):
    """A small array from the host to the device, without waiting for it."""
    return torch.from_numpy(np.ascontiguousarray(values)).to(device, non_blocking=True)


def repeated(counts, total):
    """0, 0, … 1, 1, …: each number so often as ``counts`` says; ``total`` is their sum, known beforehand."""
    return torch.repeat_interleave(torch.arange(len(counts), device=counts.device), counts, output_size=total)


def rows(first, count, device):
    """The numbers of rows in runs, ``count[b]`` of them from ``first[b]`` on, and the run ``b`` of each."""
    shift, sizes = send(np.stack([first - (np.cumsum(count) - count), count], axis=1), device).unbind(1)
    run = repeated(sizes, int(count.sum()))
    return torch.arange(len(run), device=device) + shift[run], run


def turned(x, y, turn, side=1):
    """One of the eight symmetries of the square with that side: transposed when bit 0 is set, then flipped by bits 1 and 2."""
    transposed = (turn & 1).bool()
    x, y = torch.where(transposed, y, x), torch.where(transposed, x, y)
    return torch.where((turn & 2).bool(), side - x, x), torch.where((turn & 4).bool(), side - y, y)


def cell(points, turn, side):
    """The cells of points, clamped to the grid, in the turned grid: i, j."""
    at = (points * side).floor().clamp(0, side - 1).long()
    return turned(at[:, 0], at[:, 1], turn, side - 1)


def outside(extent, turn, side):
    """The cells that reach out of the bounds, which go from 0 to ``extent`` (n, 2): (n, side, side) bool."""
    far = torch.arange(1, side + 1, device=extent.device).expand(len(extent), side)
    reach = extent * side + TOLERANCE
    width, height = reach[:, :1], reach[:, 1:]
    transposed = (turn & 1).bool()[:, None]
    width, height = torch.where(transposed, height, width), torch.where(transposed, width, height)
    x = torch.where((turn & 2).bool()[:, None], side + 1 - far, far) > width
    y = torch.where((turn & 4).bool()[:, None], side + 1 - far, far) > height
    return x[:, :, None] | y[:, None, :]


def grow(marks):
    """The marked cells and their four neighbours."""
    grown = marks.clone()
    grown[..., 1:, :] |= marks[..., :-1, :]
    grown[..., :-1, :] |= marks[..., 1:, :]
    grown[..., 1:] |= marks[..., :-1]
    grown[..., :-1] |= marks[..., 1:]
    return grown


def polygons(lines, side, first, count, turn, layers=1):
    """The cells whose open square meets the interior of a polygon: (pictures, layers, side, side) bool.

    Picture ``b`` shows ``count[b]`` lines from ``first[b]`` on, whole outlines, turned by ``turn[b]``; all three are arrays
    on the host. With one layer all lines are drawn on it. Polygons may overlap but not cross themselves (docs/dataset.md).
    """
    return _draw(lines, side, first, count, turn, layers, True, None)


def paths(lines, side, first, count, turn, ends=None):
    """The closed cells that lines meet: (pictures, side, side) bool; arguments as for ``polygons``.

    ``ends`` are ends on the device to draw instead of the lines' own, each a part of the line that it stands for.
    """
    return _draw(lines, side, first, count, turn, 1, False, ends)[:, 0]


def _draw(lines, side, first, count, turn, layers, filled, ends):
    size = max(1, CELLS // (layers * side * side))
    before = np.cumsum(count) - count
    pictures = []
    for start in range(0, len(first), size):
        part = slice(start, start + size)
        shape = (len(first[part]), layers, side, side)
        # Each column's sum comes back to 0, so one sum runs through all of them.
        grid = torch.zeros(math.prod(shape) + 1, dtype=torch.int32, device=lines.device)
        for pieces in _pieces(lines, side, first[part], count[part], before[part], turn[part]):
            _add(grid, lines, side, pieces, layers, filled, ends)
        pictures.append(grid.cumsum_(0)[:-1].bool().view(shape))
    return pictures[0] if len(pictures) == 1 else torch.cat(pictures)


def _pieces(lines, side, first, count, before, turn):
    """Cuts pictures into pieces of at most EDGES lines, in groups of about PAIRS columns.

    Yields rows of picture, first line, number of lines, lines of all pictures before it, turn; and how many columns they have.
    """
    cuts = -(-count // EDGES)
    picture = np.repeat(np.arange(len(count)), cuts)
    place = (np.arange(len(picture)) - (np.cumsum(cuts) - cuts)[picture]) * EDGES
    begin = first[picture] + place
    number = np.minimum(EDGES, count[picture] - place)
    total, axis = lines.windows(side)[0], turn[picture] & 1
    columns = total[begin + number, axis] - total[begin, axis]
    rows = np.stack([picture, begin, number, before[picture] + place, turn[picture]], axis=1)
    group = np.cumsum(columns) // PAIRS
    for part in np.split(np.arange(len(picture)), np.flatnonzero(np.diff(group)) + 1):
        if columns[part].sum() > 0:
            yield rows[part], int(columns[part].sum())


def _add(grid, lines, side, pieces, layers, filled, ends):
    """Adds lines to the grid of differences.

    A run of rows counts 2 from its first row to its last; after a column's last row comes the next column's first. What is
    inside counts 1 more: each edge adds 1 above it where it runs to the right and −1 where it runs to the left, which comes
    to 1 for each polygon around a cell's centre. (Only rounding at an edge that passes through the centre can take 1 away,
    and there the edge's run counts 2.)
    """
    rows, columns = pieces
    number = int(rows[:, 2].sum())
    picture, begin, sizes, before, turn = send(rows, lines.device).unbind(1)
    piece = repeated(sizes, number)
    place = torch.arange(number, device=lines.device) - (sizes.cumsum(0) - sizes)[piece]
    line, turn = begin[piece] + place, turn[piece]
    ends = lines.ends[line] if ends is None else ends[before[piece] + place]
    x, y = turned(ends[:, 0::2], ends[:, 1::2], turn[:, None])
    x, y = x * side, y * side
    right = (x[:, 0] <= x[:, 1])[:, None]
    x, y = torch.where(right, x, x.flip(1)), torch.where(right, y, y.flip(1))
    # A finite slope for upright lines: 0 times it must be 0.
    steep = (1 / (x[:, 1] - x[:, 0])).clamp(max=1e300)
    window = lines.windows(side)[1][line, turn & 1].long()
    window = torch.where((turn & 2).bool()[:, None], side - 1 - window.flip(1), window)
    widths = (window[:, 1] - window[:, 0] + 1).clamp(min=0)
    layer = lines.layer[line].long() if layers > 1 else 0
    slot = ((picture[piece] * layers + layer) * side + window[:, 0]) * side

    # From here on a row for each line and column.
    pair = repeated(widths, columns)
    step = torch.arange(columns, device=lines.device) - (widths.cumsum(0) - widths)[pair]
    slot = slot[pair] + step * side
    column = (window[:, 0][pair] + step).double()
    x0, x1, y0, rise, steep = torch.stack([*x.unbind(1), y[:, 0], y[:, 1] - y[:, 0], steep], dim=1)[pair].unbind(1)
    margin = TOLERANCE if filled else -TOLERANCE
    enter = ((column + margin - x0) * steep).clamp(min=0)
    leave = ((column + 1 - margin - x0) * steep).clamp(max=1)
    low, high = y0 + enter * rise, y0 + leave * rise
    low, high = torch.minimum(low, high), torch.maximum(low, high)
    first = (low + margin).ceil().sub(1).clamp(0, side).long()
    last = (high - margin).floor().clamp(-1, side - 1).long()
    meets = (enter <= leave) & (first <= last)
    weight = meets.int() * 2
    indices, values = [slot + first, slot + last + 1], [weight, -weight]
    if filled:
        centre = column + 0.5
        crossed = (x0 <= centre) & (centre < x1)
        above = (y0 + (centre - x0) * steep * rise - 0.5).ceil().clamp(0, side).long()
        # A flip, or a transposition, turns counterclockwise into clockwise.
        odd = (turn ^ turn >> 1 ^ turn >> 2) & 1
        sign = ((right[:, 0] ^ odd.bool()).int() * 2 - 1)[pair]
        indices.append(slot + above)
        values.append(crossed.int() * sign)
    grid.index_add_(0, torch.cat(indices), torch.cat(values))
