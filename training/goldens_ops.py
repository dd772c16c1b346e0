"""Goldens of single operations for the Rust tests: what PyTorch (and PyTorch Geometric) computes.

``python training/goldens_ops.py tests/goldens/ops`` writes one safetensors file per operation. Inputs and
weights come from a hash that both sides compute exactly (``values`` below), so a file holds outputs only; of
a large output every so many values (``step``). The cases stand in the metadata, as JSON.
"""

import argparse
import json
from pathlib import Path

import torch
from safetensors.torch import save_file
from torch.nn import functional as F
from torch_geometric.nn import GATConv

LARGEST = 2000  # values of one output that are stored


def values(seed, *shape):
    """Numbers in [-0.5, 0.5) that are exact in f32; entry i depends on ``seed`` and i alone."""
    count = 1
    for size in shape:
        count *= size
    index = torch.arange(count, dtype=torch.int64) + 1_000_003 * seed
    mixed = (index * 2_654_435_761) % 2**32
    mixed = (mixed ^ (mixed >> 15)) * 2_246_822_519 % 2**32
    return (((mixed >> 8).double() / 2**24) - 0.5).float().reshape(shape)


def whole(seed, count, below):
    """``count`` whole numbers below ``below``."""
    return ((values(seed, count).double() + 0.5) * below).long()


ACTIVATIONS = {
    "none": lambda x: x,
    "relu": torch.relu,
    "leaky_relu": lambda x: F.leaky_relu(x, 0.2),
    "sigmoid": torch.sigmoid,
}


def conv2d(c):
    x = values(1, 1, c["in"], c["height"], c["width"])
    weight = values(2, c["out"], c["in"], c["kernel"], c["kernel"])
    y = F.conv2d(x, weight, values(3, c["out"]), c["stride"], c["padding"])
    if c["residual"]:
        y = y + values(4, *y.shape)
    return ACTIVATIONS[c["activation"]](y)


def conv_transpose2d(c):
    x = values(1, 1, c["in"], c["height"], c["width"])
    weight = values(2, c["in"], c["out"], c["kernel"], c["kernel"])
    y = F.conv_transpose2d(x, weight, values(3, c["out"]), c["stride"], c["padding"], c["extra"])
    return ACTIVATIONS[c["activation"]](y)


def max_pool2d(c):
    x = values(1, 1, c["in"], c["height"], c["width"])
    return F.max_pool2d(x, c["kernel"], c["stride"], c["padding"])


def global_mean_pool(c):
    return values(1, c["in"], c["height"], c["width"]).mean(dim=(1, 2))


def linear(c):
    x = values(1, c["rows"], c["in"])
    if c["second"]:
        x = torch.cat([x, values(4, c["rows"], c["second"])], dim=1)
    y = F.linear(x, values(2, c["out"], x.shape[1]), values(3, c["out"]))
    return ACTIVATIONS[c["activation"]](y)


@torch.no_grad()
def gat(c):
    """A whole GATConv; the Rust side follows its ``gat`` with ``linear``."""
    states, transitions = c["states"], c["transitions"]
    source, target = whole(10, transitions, states), whole(11, transitions, states)
    every, each = torch.arange(states), torch.arange(transitions)
    edges, sources, targets = {
        "transition_to_state": (torch.stack([each, target]), transitions, states),
        "transition_to_source": (torch.stack([each, source]), transitions, states),
        "state_to_transition": (torch.stack([source, each]), states, transitions),
        "target_to_transition": (torch.stack([target, each]), states, transitions),
        "state_to_pool": (torch.stack([every, every * 0]), states, 1),
        "transition_to_pool": (torch.stack([each, each * 0]), transitions, 1),
    }[c["edges"]]
    layer = GATConv((c["in"], c["target"]), c["out"], add_self_loops=False)
    layer.lin_src.weight.copy_(values(2, c["out"], c["in"]))
    layer.lin_dst.weight.copy_(values(3, c["out"], c["target"]))
    # Large, so that some edges win clearly.
    layer.att_src.copy_(8 * values(4, 1, 1, c["out"]))
    layer.att_dst.copy_(8 * values(5, 1, 1, c["out"]))
    layer.bias.copy_(values(6, c["out"]))
    return layer((values(1, sources, c["in"]), values(7, targets, c["target"])), edges)


def mean_rows(c):
    return values(1, c["rows"], c["in"]).mean(dim=0)


def signs(rows, columns):
    return whole(9, rows * columns, 3).reshape(rows, columns) - 1


def chosen_mean(chosen, rows):
    chosen = chosen.double()
    return (chosen @ rows.double() / chosen.sum(1, keepdim=True).clamp(min=1)).float()


def sign_mean(c):
    return chosen_mean(signs(c["rows"], c["labels"]) == c["sign"], values(1, c["labels"], c["in"]))


def region_form(c):
    return chosen_mean((signs(c["rows"], c["labels"]) == c["sign"]).T, values(1, c["rows"], c["in"]))


def masks(labels, height, width):
    """Zero for most cells and wholly for the first."""
    mask = (values(8, labels, height, width) - 0.2).clamp(min=0)
    mask[0] = 0
    return mask


def region_mean(c):
    x, mask = values(1, c["in"], c["height"], c["width"]), masks(c["labels"], c["height"], c["width"])
    weight = mask.sum(dim=(1, 2))[:, None]
    return torch.einsum("lhw,chw->lc", mask, x) / torch.where(weight > 0, weight, 1)


def paint(c):
    mask = masks(c["labels"], c["height"], c["width"])
    return torch.einsum("lhw,lk->khw", mask, values(1, c["labels"], c["out"]))


def upsample(c):
    x = values(1, 1, c["in"], c["height"], c["width"])
    return F.interpolate(x, size=(c["to_height"], c["to_width"]), mode="bilinear", align_corners=False)


def broadcast(c):
    y = values(1, c["in"])[:, None, None].expand(-1, c["height"], c["width"])
    return y + values(2, c["in"], c["height"], c["width"]) if c["add"] else y


def copy_rows(c):
    x = values(1, 1 if c["repeat"] else c["rows"], c["in"])
    return x.expand(c["rows"], -1)


def cases(keys, rows):
    return [dict(zip(keys.split(), row)) for row in rows]


# Sizes where kernels break: 1, one below and above a workgroup or a tile, no multiple of anything, large.
CASES = {
    conv2d: cases(
        "in out height width kernel stride padding activation residual",
        [
            (1, 1, 1, 1, 1, 1, 0, "none", False),
            (1, 1, 1, 1, 3, 1, 1, "relu", True),
            (3, 8, 7, 9, 3, 1, 1, "leaky_relu", False),
            (8, 16, 15, 17, 4, 2, 1, "sigmoid", False),
            (5, 31, 8, 8, 3, 1, 1, "leaky_relu", True),
            (5, 33, 9, 7, 4, 2, 1, "relu", False),
            (3, 7, 23, 21, 7, 2, 3, "relu", False),
            (2, 3, 11, 13, 5, 3, 2, "none", True),
            (63, 65, 13, 5, 1, 1, 0, "relu", True),
            (17, 9, 6, 10, 1, 2, 0, "none", False),
            (96, 96, 6, 6, 3, 1, 1, "leaky_relu", True),
            (2, 130, 1, 127, 3, 1, 1, "none", False),
            (16, 24, 100, 100, 4, 2, 1, "leaky_relu", False),
        ],
    ),
    conv_transpose2d: cases(
        "in out height width kernel stride padding extra activation",
        [
            (1, 1, 1, 1, 4, 2, 1, 0, "none"),
            (3, 5, 6, 6, 4, 2, 1, 0, "relu"),
            (4, 9, 6, 6, 4, 2, 1, 1, "relu"),
            (7, 8, 25, 24, 4, 2, 1, 0, "leaky_relu"),
            (2, 3, 5, 4, 3, 2, 1, 1, "none"),
            (2, 3, 5, 4, 5, 3, 1, 0, "sigmoid"),
            (3, 2, 4, 4, 2, 2, 0, 0, "relu"),
            (2, 2, 5, 5, 3, 1, 1, 0, "none"),
            (31, 33, 3, 11, 4, 2, 1, 0, "relu"),
            (64, 65, 6, 6, 4, 2, 1, 1, "relu"),
            (32, 8, 50, 50, 4, 2, 1, 0, "relu"),
        ],
    ),
    max_pool2d: cases(
        "in height width kernel stride padding",
        [(1, 1, 1, 3, 2, 1), (3, 7, 8, 3, 2, 1), (2, 63, 65, 3, 2, 1), (5, 9, 9, 2, 2, 0), (4, 64, 64, 3, 2, 1)],
    ),
    global_mean_pool: cases(
        "in height width", [(1, 1, 1), (3, 7, 9), (63, 8, 8), (65, 5, 13), (7, 64, 64), (2048, 7, 7)]
    ),
    linear: cases(
        "rows in out second activation",
        [
            (1, 1, 1, 0, "none"),
            (1, 192, 600, 0, "none"),
            (3, 5, 2, 4, "relu"),
            (31, 32, 33, 0, "relu"),
            (64, 63, 65, 17, "leaky_relu"),
            (65, 127, 31, 1, "sigmoid"),
            (7, 256, 1, 0, "sigmoid"),
            (1030, 40, 12, 40, "relu"),
        ],
    ),
    gat: cases(
        "edges states transitions in target out",
        [
            ("transition_to_state", 1, 1, 1, 1, 1),
            ("transition_to_state", 5, 9, 7, 3, 6),
            ("transition_to_state", 63, 130, 48, 48, 16),
            ("transition_to_state", 3, 1000, 65, 30, 9),
            ("transition_to_source", 64, 65, 33, 20, 31),
            ("state_to_transition", 6, 70, 12, 7, 8),
            ("target_to_transition", 65, 64, 3, 5, 8),
            ("state_to_pool", 65, 3, 64, 128, 17),
            ("transition_to_pool", 2, 1100, 20, 128, 12),
            ("transition_to_pool", 2, 64, 7, 9, 5),
        ],
    ),
    mean_rows: cases("rows in", [(1, 1), (3, 63), (64, 65), (1030, 17)]),
    sign_mean: cases(
        "rows labels in sign", [(1, 1, 1, 1), (9, 7, 5, -1), (63, 7, 65, 1), (1030, 3, 12, -1), (2, 64, 3, 1)]
    ),
    region_form: cases(
        "rows labels in sign", [(1, 1, 1, -1), (9, 7, 5, 1), (63, 7, 65, -1), (1030, 3, 12, 1), (2, 64, 3, 1)]
    ),
    region_mean: cases(
        "in labels height width", [(1, 2, 1, 1), (5, 8, 5, 5), (37, 8, 25, 25), (64, 3, 13, 9), (2, 2, 100, 100)]
    ),
    paint: cases(
        "labels out height width", [(1, 1, 1, 1), (7, 8, 9, 7), (3, 1, 8, 8), (2, 65, 5, 13), (7, 8, 64, 65)]
    ),
    upsample: cases(
        "in height width to_height to_width",
        [(1, 1, 1, 3, 2), (2, 4, 5, 8, 10), (1, 7, 3, 10, 10), (3, 5, 5, 5, 5), (1, 9, 9, 4, 5), (1, 100, 100, 200, 200)],
    ),
    broadcast: cases("in height width add", [(1, 1, 1, False), (5, 7, 9, True), (65, 8, 8, False), (3, 50, 50, True)]),
    copy_rows: cases("rows in repeat", [(1, 1, False), (7, 5, True), (64, 65, False), (1030, 3, True)]),
}


def write(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for op, listed in CASES.items():
        outputs = {}
        for number, case in enumerate(listed):
            y = op(case).double().float().flatten()
            case["length"] = y.numel()
            # A prime step walks through all rows and columns.
            case["step"] = next(s for s in (1, 7, 11, 17, 29, 47, 61, 83) if s * LARGEST >= y.numel())
            outputs[f"{number}"] = y[:: case["step"]].contiguous()
        save_file(outputs, folder / f"{op.__name__}.safetensors", {"cases": json.dumps(listed)})


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Writes the goldens of single operations.")
    parser.add_argument("folder", type=Path)
    torch.set_grad_enabled(False)
    write(parser.parse_args().folder)
