"""Batches with augmentation, made on the missions' device. A batch depends on seed and step alone, so that training resumes exactly."""

from dataclasses import dataclass

import numpy as np
import torch

from . import drawing, targets
from .graph import Graphs


@dataclass
class Batch:
    """``raster`` (B, 1 + labels, R, R) f32, ``heat`` (B, R, R) in [0, 1], ``visited`` (S) 0 or 1."""

    raster: torch.Tensor
    graphs: Graphs
    heat: torch.Tensor
    visited: torch.Tensor


@dataclass(frozen=True)
class Augment:
    """How samples are varied; ``Augment(False, 0, 0)`` leaves them as they are."""

    symmetries: bool = True
    permute: float = 0.5
    """Share of the samples whose regions get other channels. The rest keep the order of first use, which inference has."""
    jitter: float = 0.3
    """Share of the samples whose start slides along the expert's path, as far as the letter stays the same: what
    remains of an optimal path is optimal from there."""


NONE = Augment(False, 0.0, 0.0)


@dataclass
class Choices:
    """How each sample of a batch is varied."""

    turn: np.ndarray  # (B): the symmetry, see ``drawing.turned``
    columns: np.ndarray  # (B, labels): the channel that each channel's region comes from
    slide: np.ndarray  # (B): how far the start slides, in first legs; 0 not at all


LONGEST = 0.8
"""The start slides so far at most, in first legs."""


def choose(count, labels, augment=NONE, rng=None):
    """Draws the choices for a batch."""
    out = Choices(np.zeros(count, dtype=np.int64), np.tile(np.arange(labels), (count, 1)), np.zeros(count))
    if augment.jitter:
        out.slide = np.where(rng.random(count) < augment.jitter, LONGEST * rng.random(count), 0.0)
    if augment.symmetries:
        out.turn = rng.integers(8, size=count)
    if augment.permute:
        mixed = rng.random(count) < augment.permute
        out.columns[mixed] = rng.permuted(out.columns[mixed], axis=1)
    return out


def indices(count, size, seed, step):
    """The samples of a step: every epoch is a permutation of all of them."""
    first = step * size
    positions = np.arange(first, first + size)
    epochs, places = positions // count, positions % count
    out = np.empty(size, dtype=np.int64)
    for epoch in np.unique(epochs):
        shuffled = np.random.default_rng([seed, 0, int(epoch)]).permutation(count)
        out[epochs == epoch] = shuffled[places[epochs == epoch]]
    return out


def make(missions, chosen, augment=NONE, rng=None, reach=False, heat=True, spread=None):
    """The batch of the missions with these indices.

    The target are the path's cells, with ``reach`` also those where it arrives in regions. With ``spread`` it is not the path's
    cells but the places where the path bends or meets regions, see ``targets.blobs``. Without ``heat`` there is no target; for networks
    that read no raster there is none either.
    """
    choices = choose(len(chosen), missions.labels, augment, rng)
    if missions.resolution is None:
        return undrawn(missions, chosen, choices)
    return drawn(missions, chosen, choices, reach, heat, spread)


def drawn(missions, chosen, choices, reach=False, heat=True, spread=None):
    """The batch of the missions with these indices, varied as chosen."""
    batch = undrawn(missions, chosen, choices)
    scene = scenes(missions, chosen, choices.turn)
    turn = drawing.send(choices.turn, missions.device)
    rows = drawing.send(np.asarray(chosen), missions.device)
    begin, path_begin = missions.on("start")[rows], None
    if choices.slide.any():
        moves, slid = _slide(missions, chosen, choices, scene)
        first = missions.trail().ends[missions.on("points_at")[rows], :2]
        begin, path_begin = torch.where(moves, slid, begin), torch.where(moves, slid, first)
    region = np.take_along_axis(missions.order[chosen], choices.columns, axis=1)
    cell = drawing.cell(begin, turn, missions.resolution)
    batch.raster = encoded(scene, cell, drawing.send(region, missions.device).long())
    if heat:
        batch.heat = targets.heat(missions, chosen, choices.turn, scene[:, 0], reach, spread, path_begin)
    return batch


def undrawn(missions, chosen, choices):
    """The batch's automata with their ways alone."""
    none = torch.empty(len(chosen), 0, device=missions.device)
    graphs, state = _graphs(missions, np.asarray(chosen), choices.columns)
    return Batch(none, graphs, none, missions.on("visited")[state].float())


def scenes(missions, chosen, turn):
    """The maps: obstacles (or out of bounds), then each region, (B, 1 + regions, R, R) bool."""
    maps = missions.map[chosen]
    first = missions.corners_at[missions.polygons_at[maps]]
    count = missions.corners_at[missions.polygons_at[maps + 1]] - first
    scene = drawing.polygons(missions.walls(), missions.resolution, first, count, turn, missions.layers())
    scene[:, 0] |= targets.out_of_bounds(missions, maps, turn, missions.resolution)
    return scene


def encoded(scene, cell, region):
    """The networks' input from maps, the cells of starts, and the region of each channel (B, labels), −1: none."""
    row = torch.arange(len(scene), device=scene.device)
    status = scene[:, :1].float()
    status[row, 0, cell[0], cell[1]] = -1.0
    channels = scene[row[:, None], region + 1] & (region >= 0)[:, :, None, None]
    return torch.cat([status, channels.float()], dim=1)


def _slide(missions, chosen, choices, scene):
    """Starts further along the first leg of the path: which samples' can move so far (B, 1), and where to (B, 2).

    None moves into an obstacle, nor past a cell where the letter is another one.
    """
    side, first = missions.resolution, missions.points_at[chosen]
    able = np.flatnonzero((choices.slide > 0) & (missions.prefix[chosen] > 1))
    slid = torch.zeros(len(chosen), 2, dtype=torch.float64, device=missions.device)
    moves = torch.zeros(len(chosen), 1, dtype=torch.bool, device=missions.device)
    if not len(able):
        return moves, slid
    lines, turn = missions.trail(), choices.turn[able]
    table = drawing.send(np.stack([able, first[able], turn], axis=1), missions.device)
    leg, slide = lines.ends[table[:, 1]], drawing.send(choices.slide[able], missions.device)[:, None]
    to = leg[:, :2] + slide * (leg[:, 2:] - leg[:, :2])
    ends = torch.cat([leg[:, :2], to], dim=1)
    passed = drawing.grow(drawing.paths(lines, side, first[able], np.ones_like(able), turn, ends))[:, None]
    here = scene[table[:, 0]]
    differs = ((here[:, 1:] & passed).flatten(2).any(2) & (~here[:, 1:] & passed).flatten(2).any(2)).any(1)
    i, j = drawing.cell(to, table[:, 2], side)
    blocked = here[torch.arange(len(able), device=missions.device), 0, i, j]
    moves[table[:, 0], 0], slid[table[:, 0]] = ~(differs | blocked), to
    return moves, slid


def _graphs(missions, chosen, columns):
    """The automata of missions, and the rows of their states."""
    states, edges = missions.states_at[chosen], missions.edges_at[chosen]
    sizes = missions.states_at[chosen + 1] - states
    state, state_graph = drawing.rows(states, sizes, missions.device)
    edge, owner = drawing.rows(edges, missions.edges_at[chosen + 1] - edges, missions.device)
    table = drawing.send(np.hstack([np.stack([chosen, np.cumsum(sizes) - sizes], axis=1), columns]), missions.device)
    mission, offset, columns = table[:, :1, None], table[:, 1], table[:, 2:]
    ends = missions.on("edges")[edge].long() + offset[owner][:, None]
    literals = missions.on("literals")[edge].gather(1, columns[owner])
    # The start stays last.
    places = torch.cat([columns, columns.new_full((len(chosen), 1), missions.labels)], dim=1)
    ways = missions.on("ways")[mission, places[:, :, None], places[:, None, :]]
    graphs = Graphs(
        missions.on("states")[state], literals.float(), ends[:, 0], ends[:, 1], state_graph, owner, len(chosen), ways
    )
    return graphs, state
