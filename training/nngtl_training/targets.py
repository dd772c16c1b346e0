"""What PathNet learns: target heatmaps, drawn on the missions' device (docs/dataset.md, *What training makes of it*)."""

import numpy as np
import torch
from torch.nn import functional as F

from . import drawing

SIDE = 200
"""Cells per side of the target heatmap (nngtl.md, IV-D)."""

REACH = 0.04
"""Radius, in sides of the frame, of the part of a region around the expert's entry that counts as its place of arrival."""

AROUND = int(REACH * SIDE)
WINDOW = 2 * AROUND + 1
"""Cells per side of the square around an entry that holds its place of arrival."""


def heat(missions, chosen, turn, blocked, reach, spread, start=None):
    """Targets (B, R, R) in [0, 1] for obstacle cells ``blocked`` (B, R, R); see ``batches.make``.

    ``start`` (B, 2), where paths begin instead of at their first point, is a place on their first leg.
    """
    if spread:
        return blobs(missions, chosen, turn, ~blocked, spread)
    free = ~blocked if blocked.shape[-1] == SIDE else ~obstacles(missions, chosen, turn, SIDE)
    cells = path_cells(missions, chosen, turn, free, start)
    if reach:
        cells |= reach_cells(missions, chosen, turn, free)
    return averaged(cells, blocked.shape[-1])


def averaged(cells, side):
    """The marked share of each of (B, side, side) larger cells."""
    factor = cells.shape[-1] // side
    if factor * side != cells.shape[-1]:
        raise ValueError(f"resolution {side} does not divide {cells.shape[-1]}")
    # Counted rows first, then columns: on a processor much faster than pooling.
    rows = sum(cells[:, k::factor].short() for k in range(factor))
    return sum(rows[..., k::factor] for k in range(factor)).float() / factor**2


def lowered(heat, logits):
    """A target (B, R, R) averaged down to the side of the logits, which divides R."""
    return heat if heat.shape == logits.shape else F.avg_pool2d(heat, heat.shape[-1] // logits.shape[-1])


def obstacles(missions, chosen, turn, side):
    """The obstacle cells, and those out of bounds: (B, side, side) bool."""
    maps = missions.map[chosen]
    polygons = missions.polygons_at[maps]
    first = missions.corners_at[polygons]
    count = missions.corners_at[polygons + missions.obstacles[maps]] - first
    marks = drawing.polygons(missions.walls(), side, first, count, turn)[:, 0]
    return marks | out_of_bounds(missions, maps, turn, side)


def out_of_bounds(missions, maps, turn, side):
    """The cells that reach beyond the bounds: (B, side, side) bool."""
    extent = missions.on("extent")[drawing.send(maps, missions.device).long()]
    return drawing.outside(extent, drawing.send(turn, missions.device), side)


def path_cells(missions, chosen, turn, free, start=None):
    """The free cells at 200×200 on the path or next to it: (B, 200, 200) bool."""
    first = missions.points_at[chosen]
    count = (missions.points_at[chosen + 1] - first) if missions.suffix else missions.prefix[chosen].astype(np.int64)
    lines, ends = missions.trail(), None
    if start is not None:
        ends = lines.ends[drawing.rows(first, count, missions.device)[0]]
        ends[drawing.send(np.cumsum(count) - count, missions.device), :2] = start
    return drawing.grow(drawing.paths(lines, SIDE, first, count, turn, ends)) & free


def reach_cells(missions, chosen, turn, free):
    """The free cells at 200×200 of regions that the path enters, within REACH of the entry: (B, 200, 200) bool."""
    outlines, at, corner = missions.kept("reached", lambda: _reached(missions))
    device, first = missions.device, missions.entries_at[chosen]
    count = missions.entries_at[chosen + 1] - first
    owner = np.repeat(np.arange(len(chosen)), count)
    entry = np.arange(len(owner)) + (first - (np.cumsum(count) - count))[owner]
    marks = drawing.polygons(outlines, WINDOW, at[entry], at[entry + 1] - at[entry], turn[owner])[:, 0]
    owner, entry, turn = drawing.send(np.stack([owner, entry, turn[owner]], axis=1), device).unbind(1)
    corner, point = corner[entry], missions.on("entries")[entry, :2]
    # The cells of the turned window, (entries, WINDOW, WINDOW), and which cells of the map they are.
    there = torch.arange(WINDOW, device=device).expand(len(entry), WINDOW)
    x = torch.where((turn & 2).bool()[:, None], WINDOW - 1 - there, there)
    y = torch.where((turn & 4).bool()[:, None], WINDOW - 1 - there, there)
    transposed = (turn & 1)[:, None]
    first_axis, second_axis = transposed, 1 - transposed
    off = lambda k, axis: ((corner.gather(1, axis) + k + 0.5) / SIDE - point.gather(1, axis)) ** 2
    marks &= off(x, first_axis)[:, :, None] + off(y, second_axis)[:, None, :] <= REACH**2
    i, j = drawing.turned(corner[:, 0], corner[:, 1], turn, SIDE - WINDOW)
    cell = ((owner * SIDE + i)[:, None] + there)[:, :, None] * SIDE + (j[:, None] + there)[:, None, :]
    # Windows overlap: marks are counted.
    found = torch.zeros(free.numel(), dtype=torch.int32, device=device)
    found.index_add_(0, cell.flatten(), marks.flatten().int())
    return found.view(free.shape).bool() & free


def _reached(missions):
    """For each entry the outline of its region, in a frame that is the window around the entry.

    Returns the lines, where each entry's begin, and the windows' lowest cells (entries, 2).
    """
    mission = np.repeat(np.arange(len(missions)), np.diff(missions.entries_at))
    maps = missions.map[mission]
    polygon = missions.polygons_at[maps] + missions.obstacles[maps] + missions.entries[:, 2].astype(np.int64)
    first = missions.corners_at[polygon]
    count = missions.corners_at[polygon + 1] - first
    at = np.concatenate([[0], np.cumsum(count)])
    owner = np.repeat(np.arange(len(count)), count)
    corner = np.clip(np.floor(missions.entries[:, :2] * SIDE) - AROUND, 0, SIDE - WINDOW)
    corners = missions.corners[np.arange(len(owner)) + (first - at[:-1])[owner]]
    lines = drawing.Lines(drawing.outlines((corners * SIDE - corner[owner]) / WINDOW, at), missions.device)
    return lines, at, torch.from_numpy(corner.astype(np.int64)).to(missions.device)


def blobs(missions, chosen, turn, free, spread):
    """The target of places: 1 at each point of the path (without its suffix if the missions leave it out) but its start, falling off as a Gaussian of standard deviation ``spread``
    (sides of the frame), the greatest counts, 0 in obstacles."""
    first = missions.points_at[chosen] + 1
    count = (missions.points_at[chosen + 1] if missions.suffix else missions.points_at[chosen] + missions.prefix[chosen]) - first
    # Longest paths first: the p-th points are those of the first few.
    order = np.argsort(-count, kind="stable")
    number = (count[:, None] > np.arange(count.max())).sum(axis=0)
    table = drawing.send(np.stack([first[order], turn[order]], axis=1), missions.device)
    point, turn = table[:, :1] + torch.arange(len(number), device=missions.device), table[:, 1:]
    x, y = missions.on("points")[point.clamp(max=len(missions.points) - 1)].unbind(2)
    x, y = drawing.turned(x, y, turn)
    side = free.shape[-1]
    centre = (torch.arange(side, device=missions.device) + 0.5).double() / side
    along, across = (torch.exp(-0.5 * ((centre - at[:, :, None]) / spread) ** 2).float() for at in (x, y))
    out = torch.zeros(free.shape, device=missions.device)
    for p, n in enumerate(number.tolist()):
        torch.maximum(out[:n], along[:n, p, :, None] * across[:n, p, None, :], out=out[:n])
    back = drawing.send(np.argsort(order), missions.device)
    return out[back] * free
