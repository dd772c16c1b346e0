"""What the networks are worth on missions they never saw."""

import numpy as np
import torch
from torch.nn import functional as F

from . import batches, targets

POWERS = (1, 2, 4, 8)
CAP = 1000
"""Draws for one leg count as at most so many."""

_BINS = 4096


def counts(scores, positive):
    """Histogram of scores in [0, 1] for negatives and positives, (2, bins), from which ``average_precision`` reads."""
    # Spread by the logit, so that scores near 0 and 1 keep their order.
    scores = np.clip(scores.astype(np.float64), 1e-9, 1 - 1e-9)
    at = (np.log(scores / (1 - scores)) / 42 + 0.5) * _BINS
    at = np.clip(at.astype(np.int64), 0, _BINS - 1)
    return np.stack([np.bincount(at[positive == kind], minlength=_BINS) for kind in (False, True)])


def average_precision(counted):
    """0 when there is no positive."""
    right = np.cumsum(counted[1, ::-1])
    every = right + np.cumsum(counted[0, ::-1])
    if right[-1] == 0:
        return 0.0
    gained = np.diff(right, prepend=0) / right[-1]
    return float((gained * right / np.maximum(every, 1)).sum())


def heatmap(logits):
    """Probabilities at 200×200 from logits at the network's resolution, as inference makes them."""
    heat = torch.sigmoid(logits.float())[:, None]
    if heat.shape[-1] != targets.SIDE:
        heat = F.interpolate(heat, size=targets.SIDE, mode="bilinear", align_corners=False)
    return heat[:, 0]


@torch.no_grad()
def evaluate(model, missions, limit=None, size=32, device="cpu", spread=None):
    """Held-out metrics of a network, whole and by family and pattern.

    PathNet: ``loss``, ``ap`` (average precision of path cells at 200×200); for the heatmap to the k-th power
    ``mass<k>``, the share that lies on the path, and ``draws<k>``, the mean number of draws from the rectangle of rule C-2 until one lies in the region
    that a straight leg of the expert's path leads to; ``draws0`` is the flat heatmap's. StateNet: ``loss``, ``accuracy`` and ``ap`` over states, ``exact``, the share of missions with all states
    right. ``spread``: the target that ``loss`` is taken against, see ``batches.make``. ``base`` is what a constant would reach (share of positives).
    """
    model.eval()
    missions = missions.to(device)
    paths = model.config["kind"] == "pathnet"
    number = len(missions) if limit is None else min(limit, len(missions))
    # Spread over the set, which may be ordered by family.
    chosen = np.linspace(0, len(missions) - 1, number).astype(np.int64)
    rows = []  # one per mission
    groups = {}
    for first in range(0, number, size):
        part = chosen[first : first + size]
        batch = batches.make(missions, part, spread=spread)
        logits = model(batch.raster, batch.graphs).float()
        if paths:
            rows += _path_rows(logits, batch, missions, part)
        else:
            rows += _state_rows(logits[:, -1], batch)
    for k, row in zip(chosen, rows):
        for key in ("all", f"family {missions.family[k]}", f"pattern {missions.pattern[k]}"):
            groups.setdefault(key, []).append(row)
    model.train()
    return {key: _summary(rows) for key, rows in sorted(groups.items())}


def _path_rows(logits, batch, missions, chosen):
    target = targets.lowered(batch.heat, logits)
    loss = F.binary_cross_entropy_with_logits(logits, target, reduction="none").mean(dim=(1, 2))
    upright = np.zeros_like(chosen)
    free = ~targets.obstacles(missions, chosen, upright, targets.SIDE)
    truth = targets.path_cells(missions, chosen, upright, free).cpu().numpy()
    heat, regions = heatmap(logits).cpu().numpy(), batch.raster[:, 1:].bool().cpu().numpy()
    out = []
    for k, value, scores, positive, masks in zip(chosen, loss.tolist(), heat, truth, regions):
        row = {"loss": value, "_counts": counts(scores.ravel(), positive.ravel()), **_draws(scores, masks, missions, k)}
        for power in POWERS:
            weight = scores.astype(np.float64) ** power
            row[f"mass{power}"] = float(weight[positive].sum() / max(weight.sum(), 1e-300))
        out.append(row)
    return out


def _draws(heat, masks, missions, k):
    """Means over the mission's straight legs, for the masks (labels, R, R) of its channels; none: no entry."""
    legs = missions.legs[missions.legs_at[k] : missions.legs_at[k + 1]]
    factor = targets.SIDE // missions.resolution
    expected = {power: [] for power in (0, *POWERS)}
    for x, y, region in legs:
        mask = masks[np.flatnonzero(missions.order[k] == region)[0]]
        inside = np.kron(mask, np.ones((factor, factor), dtype=np.uint8)) == 1
        if not inside.any():
            continue
        begin = np.clip(np.floor(np.array([x, y]) * targets.SIDE), 0, targets.SIDE - 1)
        cells = np.array([begin, np.argwhere(inside).mean(axis=0)]).astype(int)
        (i0, j0), (i1, j1) = cells.min(axis=0), cells.max(axis=0) + 1
        there = inside[i0:i1, j0:j1]
        if inside[tuple(cells[0])] or not there.any():
            continue
        for power, draws in expected.items():
            weight = np.round((heat[i0:i1, j0:j1].astype(np.float64) / heat.max()) ** power * 65535)
            draws.append(min(CAP, weight.sum() / max(weight[there].sum(), 1e-9)) if weight.any() else CAP)
    return {f"draws{power}": float(np.mean(draws)) for power, draws in expected.items() if draws}


def _state_rows(logits, batch):
    loss = F.binary_cross_entropy_with_logits(logits, batch.visited, reduction="none").cpu().numpy()
    scores, truth = torch.sigmoid(logits).cpu().numpy(), batch.visited.cpu().numpy() > 0.5
    owner = batch.graphs.state_graph.cpu().numpy()
    out = []
    for graph in range(batch.graphs.count):
        mine = owner == graph
        right = (scores[mine] > 0.5) == truth[mine]
        out.append(
            {
                "loss": float(loss[mine].mean()),
                "accuracy": float(right.mean()),
                "exact": float(right.all()),
                "_counts": counts(scores[mine], truth[mine]),
            }
        )
    return out


def _summary(rows):
    out = {"missions": len(rows)}
    for key in sorted({key for row in rows for key in row if not key.startswith("_")}):
        out[key] = float(np.mean([row[key] for row in rows if key in row]))
    counted = sum(row["_counts"] for row in rows)
    out["ap"] = average_precision(counted)
    out["base"] = float(counted[1].sum() / counted.sum())
    return out
