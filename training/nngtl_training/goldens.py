"""Goldens for the Rust tests: small random networks with an input and PyTorch's output, and map rasters.

``python -m nngtl_training.goldens tests/goldens`` writes ``rasters.json`` (see ``rasters``) and, in ``models/``, for each network, ``NAME.safetensors`` (a weight file as any other)
and ``NAME.io.safetensors``: ``raster`` (1 + labels, R, R) i8, ``states`` (S, 3) f32, ``transitions`` (T, labels) i8, ``source`` and ``target`` (T) i32,
``ways`` (labels + 1, labels + 1) f32 for networks that read them,
``output``: heatmap (side, side) or state probabilities (S), f32.
"""

import argparse
import json
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import save
from torch.nn import functional as F

from . import batches, drawing, export, models
from .graph import Graphs

PAINT = dict(
    kind="pathnet", variant="paint", labels=3, resolution=50, graph=[8, 6], reverse=True, look=25, embedding=4,
    widths=[4, 6, 8], stem=2, middle=1, top=3, output=100,
)  # fmt: skip
PATH = dict(
    kind="pathnet", variant="paper", labels=3, resolution=100, n1=1, graph=[4, 5, 6, 5, 4], fusion="dense", skip="third"
)
LOOKUP = dict(
    kind="statenet", variant="lookup", labels=3, resolution=100, widths=[4, 6, 8], stem=2, middle=1, stop=1,
    graph=[8, 8], reverse=True, head=6,
)  # fmt: skip
WAYS = dict(kind="statenet", variant="ways", labels=3, graph=[8, 8], reverse=True, head=6)
STATE = dict(
    kind="statenet", variant="paper", labels=3, resolution=64, trunk="bottleneck", trunk_widths=[2, 3, 4, 4],
    trunk_blocks=[2, 1, 1, 1], map_feature=6, first=8, graph=[8, 8],
)  # fmt: skip

GOLDENS = {
    "pathnet-paint": PAINT,
    "pathnet-paint-stem1": {**PAINT, "stem": 1, "resolution": 50, "widths": [3, 4, 6, 8], "middle": 2, "reverse": False, "look": 0},
    "pathnet-paint-stem4": {**PAINT, "stem": 4, "resolution": 100, "output": 200},
    "pathnet-paint-200": {**PAINT, "resolution": 100, "labels": 7, "output": 200},
    "pathnet-paper": PATH,
    "pathnet-paper-broadcast": {**PATH, "fusion": "broadcast", "skip": "none", "resolution": 64, "n1": 2},
    "pathnet-paper-200": {**PATH, "resolution": 200, "labels": 2, "graph": [3, 3, 3, 3, 3]},
    "statenet-lookup": LOOKUP,
    "statenet-lookup-stem1": {**LOOKUP, "stem": 1, "resolution": 48, "widths": [4, 6], "stop": 0, "reverse": False, "middle": 0},
    "statenet-ways": WAYS,
    "statenet-paper-bottleneck": STATE,
    "statenet-paper-basic": {**STATE, "trunk": "basic", "trunk_blocks": [1, 2, 1, 1], "resolution": 50},
}

LATER = ("pathnet-paint-stem4", "statenet-ways")
"""Those that came later are numbered last: a golden's number is its seed."""


def randomise(model):
    """Weights and running statistics that leave no part of a network idle and saturate nothing."""
    for name, value in model.state_dict().items():
        if name.endswith("running_mean"):
            value.normal_(0, 0.2)
        elif name.endswith("running_var"):
            value.uniform_(0.5, 1.5)
        elif name.endswith(("norm.weight", "bn1.weight", "bn2.weight", "bn3.weight")) or ".downsample.1.weight" in name:
            value.uniform_(0.7, 1.3)
        elif ".att_" in name:
            value.normal_(0, 1)  # attention far from uniform
        elif name.startswith("head") and value.dim() > 1:
            value.normal_(0, 3 * (2 / value[0].numel()) ** 0.5)
        elif value.dim() > 1:
            value.normal_(0, (2 / value[0].numel()) ** 0.5)
        elif value.is_floating_point():
            value.normal_(0, 0.2)


def example(labels, side, rng, ways=False):
    """A map with overlapping regions and an automaton with every kind of node: unreachable, idle, parallel cubes."""
    box = lambda x, y, w, h: np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]]) * 1.0
    obstacles = [box(0.1, 0.55, 0.4, 0.2), np.array([[0.6, 0.1], [0.9, 0.2], [0.65, 0.45]])]
    regions = [box(*rng.uniform(0.05, 0.75, 2), *rng.uniform(0.08, 0.2, 2)) for _ in range(labels)]
    scene, start = _scene(obstacles, regions, (1.0, 0.9), side), _cell((0.313, 0.271), side)
    order = np.arange(labels)[None].copy()
    order[0, -1] = -1  # a channel that the formula does not use
    literals = rng.integers(-1, 2, (9, labels)).astype(np.int8)
    literals[:, -1] = 0
    literals[4] = 0
    states = np.array([[1, 0, 1], [0, 0, 2 / 3], [0, 0, 2 / 3], [0, 1, 0], [0, 0, -1], [1, 0, 1 / 3]], dtype=np.float32)
    source = np.array([0, 0, 0, 1, 2, 1, 3, 3, 5])
    target = np.array([0, 1, 2, 3, 3, 1, 3, 3, 3])
    graphs = Graphs(
        torch.from_numpy(states),
        torch.from_numpy(literals).float(),
        torch.from_numpy(source),
        torch.from_numpy(target),
        torch.zeros(6, dtype=torch.long),
        torch.zeros(9, dtype=torch.long),
        1,
    )
    if ways:
        lengths = rng.uniform(0, 1.5, (labels + 1, labels + 1)).astype(np.float32)
        lengths[labels - 1] = lengths[:, labels - 1] = 0
        graphs.ways = torch.from_numpy(lengths + lengths.T)[None]
    return batches.encoded(scene, start, torch.from_numpy(order)), graphs


_UPRIGHT = np.zeros(1, dtype=np.int64)


def _scene(obstacles, regions, extent, side):
    """A map as ``batches.scenes`` gives them: (1, 1 + regions, side, side) bool."""
    shapes = [np.asarray(shape, dtype=np.float64) for shape in (*obstacles, *regions)]
    sizes = np.array([len(shape) for shape in shapes])
    at = np.concatenate([[0], np.cumsum(sizes)])
    layer = np.repeat(np.maximum(np.arange(len(shapes)) - len(obstacles) + 1, 0), sizes)
    lines = drawing.Lines(drawing.outlines(np.concatenate(shapes), at), layer=layer)
    scene = drawing.polygons(lines, side, at[:1], at[-1:], _UPRIGHT, 1 + len(regions))
    scene[:, 0] |= drawing.outside(torch.tensor([extent], dtype=torch.float64), torch.from_numpy(_UPRIGHT), side)
    return scene


def _cell(point, side):
    """The cell of a point of the frame: i, j, a tensor of one each."""
    return drawing.cell(torch.tensor([point], dtype=torch.float64), torch.from_numpy(_UPRIGHT), side)


def example_for(config, number):
    """The example of this number that a network with this configuration reads."""
    side = config.get("resolution", 8)
    return example(config["labels"], side, np.random.default_rng(number), config["variant"] == "ways")


@torch.no_grad()
def output(model, tensor, graphs):
    """What inference gives: the heatmap at ``output`` cells a side, or a probability per state."""
    logits = model(tensor, graphs)
    if model.config["kind"] == "statenet":
        return torch.sigmoid(logits[:, -1])
    heat = torch.sigmoid(logits)[:, None]
    side = model.config.get("output", heat.shape[-1])
    if side != heat.shape[-1]:
        heat = F.interpolate(heat, size=side, mode="bilinear", align_corners=False)
    return heat[0, 0]


def write(folder):
    """Writes all goldens; returns their names with the spread of their outputs."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    spreads = {}
    for number, (name, config) in enumerate(sorted(GOLDENS.items(), key=lambda item: item[0] in LATER)):
        torch.manual_seed(number)
        model = models.build(config).eval()
        randomise(model)
        tensor, graphs = example_for(config, number)
        export.write(folder / f"{name}.safetensors", model, {"golden": name})
        spreads[name] = write_example(folder / f"{name}.io.safetensors", model, tensor, graphs)
    return spreads


def write_example(path, model, tensor, graphs):
    """Writes an input with the model's output; returns the output's least and greatest value and deviation."""
    result = output(model, tensor, graphs)
    write_golden(path, tensor, graphs, result)
    return result.min().item(), result.max().item(), result.std().item()


def write_golden(path, tensor, graphs, result):
    """Writes an input with an output."""
    held = {
        "raster": tensor[0].to(torch.int8),
        "states": graphs.states,
        "transitions": graphs.transitions.to(torch.int8),
        "source": graphs.source.int(),
        "target": graphs.target.int(),
        "output": result.contiguous(),
    }
    if graphs.ways is not None:
        held["ways"] = graphs.ways[0]
    path.write_bytes(save(held))


def shipped(folder, models_folder):
    """Writes what the weights of a model's folder make of an example, as ``shipped-NETWORK.io.safetensors``."""
    spreads = {}
    for network in ("pathnet", "statenet"):
        model, _ = export.read(Path(models_folder) / f"{network}.safetensors")
        tensor, graphs = example_for(model.config, 99)
        name = f"shipped-{network}"
        spreads[name] = write_example(Path(folder) / f"{name}.io.safetensors", model, tensor, graphs)
    return spreads


def rasters(number=6):
    """Maps as data sets hold them, with the runs of marked cells of each raster channel.

    A run ``[i, j, n]`` marks the cells (i, j) to (i, j + n − 1). ``channels[0]`` are the obstacles, before the start is
    put in, ``channels[1..]`` the regions, all in use; ``start_cell`` is where the status is −1.
    """
    out = []
    for index in range(number):
        rng = np.random.default_rng([9, index])
        low = np.zeros(2) if index % 2 == 0 else np.array([2.0, -1.0])
        size = [np.ones(2), np.array([3.0, 2.0]), np.ones(2), np.array([1.5, 4.0])][index % 4]
        side = [100, 200, 50, 100][index % 4]
        shapes = [(low + size * _shape(rng, k)).round(4).tolist() for k in range(8)]
        start = (low + size * rng.uniform(0, 1, 2)).round(4).tolist()
        frame = lambda points: (np.array(points) - low) / size.max()
        scene = _scene([frame(p) for p in shapes[:4]], [frame(p) for p in shapes[4:]], (size / size.max()).tolist(), side)[0]
        out.append(
            {
                "resolution": side,
                "bounds": [low.tolist(), (low + size).tolist()],
                "obstacles": shapes[:4],
                "regions": shapes[4:],
                "start": start,
                "start_cell": [int(i) for i in _cell(frame(start).tolist(), side)],
                "channels": [_runs(marks) for marks in scene.numpy()],
            }
        )
    return out


def _shape(rng, kind):
    """A polygon in the unit square: rectangles on a coarse grid (so that edges lie on cell borders), stars, slivers."""
    if kind % 4 < 2:
        x, y, w, h = rng.integers(0, 16), rng.integers(0, 16), rng.integers(1, 5), rng.integers(1, 5)
        return np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]]) * 0.05
    angles = np.sort(rng.uniform(0, 2 * np.pi, 9))
    radii = rng.uniform(0.03, 0.25, 9) if kind % 4 == 2 else np.array([0.3, 0.01] * 4 + [0.2])
    star = rng.uniform(0.2, 0.8, 2) + radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.clip(star, 0, 1)


def _runs(marks):
    out = []
    for i, row in enumerate(marks):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(np.int8), [0]])))
        out += [[i, int(a), int(b - a)] for a, b in zip(edges[::2], edges[1::2])]
    return out


def main():
    parser = argparse.ArgumentParser(description="Writes the goldens of the Rust tests.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--shipped", type=Path, help="only what these weights give, for example models/compact")
    options = parser.parse_args()
    folder = options.folder
    spreads = write(folder / "models") if options.shipped is None else shipped(folder / "models", options.shipped)
    for name, (low, high, spread) in spreads.items():
        print(f"{name}: output {low:.4f} to {high:.4f}, deviation {spread:.4f}")
    if options.shipped is not None:
        return
    lines = ",\n".join(json.dumps(entry, separators=(",", ":")) for entry in rasters())
    (folder / "rasters.json").write_text(f"[{lines}]\n", encoding="utf-8")


if __name__ == "__main__":
    main()
