"""Batches with augmentation. A batch depends on seed and step alone, so that training resumes exactly."""

from dataclasses import dataclass

import numpy as np
import torch
from torch.nn import functional as F

from . import raster
from .data import TARGET_SIDE
from .graph import Graphs


@dataclass
class Batch:
    """``raster`` (B, 1 + labels, R, R) f32, ``heat`` (B, R, R) in [0, 1], ``visited`` (S) 0 or 1."""

    raster: torch.Tensor
    graphs: Graphs
    heat: torch.Tensor
    visited: torch.Tensor

    def to(self, device):
        return Batch(self.raster.to(device), self.graphs.to(device), self.heat.to(device), self.visited.to(device))


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


def target_cells(missions, k, reach):
    """The cells of a mission's target at 200×200; with ``reach`` also where the path arrives in regions."""
    cells = missions.cells[missions.cells_at[k] : missions.cells_at[k + 1]]
    if not reach:
        return cells
    return np.union1d(cells, missions.reach[missions.reach_at[k] : missions.reach_at[k + 1]])


def blobs(points, free, spread):
    """The target of places: 1 at each point of the frame, falling off as a Gaussian of standard deviation ``spread`` (sides of
    the frame), 0 in obstacles."""
    side = free.shape[0]
    centre = (np.arange(side) + 0.5) / side
    out = np.zeros((side, side), dtype=np.float32)
    for x, y in points:
        along, across = np.exp(-0.5 * ((centre - x) / spread) ** 2), np.exp(-0.5 * ((centre - y) / spread) ** 2)
        np.maximum(out, np.outer(along, across), out=out)
    return out * free


def lowered(heat, logits):
    """A target (B, R, R) averaged down to the side of the logits, which divides R."""
    return heat if heat.shape == logits.shape else F.avg_pool2d(heat, heat.shape[-1] // logits.shape[-1])


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


def make(missions, chosen, augment=NONE, rng=None, reach=False, heat=True, spread=None, draw=True):
    """The batch of the missions with these indices; ``reach``: see ``target_cells``; without ``heat`` it stays 0, without
    ``draw`` there is no raster.

    With ``spread`` the target is not the path's cells but the places where the path bends or meets regions: see ``blobs``.
    """
    if not draw:
        return _undrawn(missions, chosen, augment, rng)
    side, labels = missions.resolution, missions.labels
    codes = np.zeros((len(chosen), side, side), dtype=missions.codes.dtype)
    targets = np.zeros((len(chosen), side, side), dtype=np.float32)
    begin = np.zeros((len(chosen), side, side), dtype=bool)
    region = np.full((len(chosen), labels), -1, dtype=np.int64)
    columns = np.tile(np.arange(labels), (len(chosen), 1))
    for b, k in enumerate(chosen):
        code = missions.codes[missions.map[k]]
        start, cells = missions.start[k], target_cells(missions, k, reach)
        if augment.jitter and rng.random() < augment.jitter:
            start, cells = _slide(missions, k, code, rng, cells) or (start, cells)
        cell = np.zeros((side, side), dtype=bool)
        cell[raster.cell(start, side)] = True
        turn = rng.integers(8) if augment.symmetries else 0
        codes[b], begin[b] = turned(code, turn), turned(cell, turn)
        if heat and spread:
            points = missions.points[missions.points_at[k] + 1 : missions.points_at[k + 1]]
            targets[b] = turned(blobs(points, code & 1 == 0, spread), turn)
        elif heat:
            targets[b] = turned(_lower(cells, side), turn)
        region[b] = missions.order[k]
        if augment.permute and rng.random() < augment.permute:
            columns[b] = rng.permutation(labels)
    region = np.take_along_axis(region, columns, axis=1)
    return Batch(
        raster_tensor(codes, begin, region),
        _graphs(missions, chosen, columns),
        torch.from_numpy(targets),
        torch.from_numpy(_gather(missions.visited, missions.states_at, chosen).astype(np.float32)),
    )


def _undrawn(missions, chosen, augment, rng):
    """A batch of automata with their ways alone."""
    columns = np.tile(np.arange(missions.labels), (len(chosen), 1))
    for b in range(len(chosen)):
        if augment.permute and rng.random() < augment.permute:
            columns[b] = rng.permutation(missions.labels)
    none = torch.empty(len(chosen), 0)
    visited = torch.from_numpy(_gather(missions.visited, missions.states_at, chosen).astype(np.float32))
    return Batch(none, _graphs(missions, chosen, columns), none, visited)


def raster_tensor(codes, begin, region):
    """The networks' input from codes, start masks and the region of each channel (−1: none)."""
    kind = torch.uint8 if codes.dtype == np.uint8 else torch.int32
    codes = torch.from_numpy(codes.astype(np.int64) if codes.dtype == np.uint32 else codes).to(kind)
    # A bit per channel; channels without a region ask for no bit.
    bits = torch.from_numpy(np.where(region >= 0, 2 << np.maximum(region, 0), 0)).to(kind)
    count, side = codes.shape[0], codes.shape[1]
    out = torch.empty(count, 1 + region.shape[1], side, side)
    out[:, 0] = (codes & 1).masked_fill_(torch.from_numpy(begin), 0)
    out[:, 0].masked_fill_(torch.from_numpy(begin), -1.0)
    out[:, 1:] = (codes[:, None] & bits[:, :, None, None]) != 0
    return out


def turned(grid, turn):
    """One of the eight symmetries of the square: transposed when bit 0 is set, then flipped by bits 1 and 2."""
    if turn & 1:
        grid = grid.T
    if turn & 2:
        grid = grid[::-1]
    if turn & 4:
        grid = grid[:, ::-1]
    return grid


def _lower(cells, side):
    """The target at (side, side), averaged down from 200×200 by area."""
    factor = TARGET_SIDE // side
    if factor * side != TARGET_SIDE:
        raise ValueError(f"resolution {side} does not divide {TARGET_SIDE}")
    cells = cells.astype(np.int64)
    flat = cells // TARGET_SIDE // factor * side + cells % TARGET_SIDE // factor
    return np.bincount(flat, minlength=side * side).reshape(side, side).astype(np.float32) / factor**2


def _slide(missions, k, code, rng, cells):
    """A start further along the first leg of the path and what is left of the target's cells; None where it cannot move."""
    points = missions.points[missions.points_at[k] : missions.points_at[k + 1]]
    prefix = points[: missions.prefix[k]]
    if len(prefix) < 2:
        return None
    side = missions.resolution
    moved = prefix[0] + np.float32(rng.random() * 0.8) * (prefix[1] - prefix[0])
    passed = raster.grow(raster.path(np.stack([prefix[0], moved]) * side, side))
    if len(np.unique(code[passed] >> 1)) > 1 or code[raster.cell(moved, side)] & 1:
        return None
    left = raster.path(np.concatenate([moved[None], prefix[1:]]) * TARGET_SIDE, TARGET_SIDE)
    left |= raster.path(points[missions.prefix[k] :] * TARGET_SIDE, TARGET_SIDE)
    # What goes is what the part behind the new start marks and the rest of the path does not.
    gone = raster.grow(raster.path(np.stack([prefix[0], moved]) * TARGET_SIDE, TARGET_SIDE)) & ~raster.grow(left)
    return moved, cells[~gone.ravel()[cells]]


def _gather(rows, at, chosen):
    return np.concatenate([rows[at[k] : at[k + 1]] for k in chosen])


def _graphs(missions, chosen, columns):
    sizes = missions.states_at[chosen + 1] - missions.states_at[chosen]
    counts = missions.edges_at[chosen + 1] - missions.edges_at[chosen]
    owner = np.repeat(np.arange(len(chosen)), counts)
    offset = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    edges = _gather(missions.edges, missions.edges_at, chosen) + offset[owner][:, None]
    literals = _gather(missions.literals, missions.edges_at, chosen)
    literals = np.take_along_axis(literals, columns[owner], axis=1)
    # The start stays last.
    places = np.concatenate([columns, np.full((len(chosen), 1), missions.labels)], axis=1)
    ways = missions.ways[np.asarray(chosen)[:, None, None], places[:, :, None], places[:, None, :]]
    return Graphs(
        torch.from_numpy(_gather(missions.states, missions.states_at, chosen)),
        torch.from_numpy(literals.astype(np.float32)),
        torch.from_numpy(edges[:, 0].astype(np.int64)),
        torch.from_numpy(edges[:, 1].astype(np.int64)),
        torch.from_numpy(np.repeat(np.arange(len(chosen)), sizes)),
        torch.from_numpy(owner),
        len(chosen),
        torch.from_numpy(ways),
    )
