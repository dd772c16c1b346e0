"""Network and training configurations by name."""

import copy
import json
from pathlib import Path

LABELS = 7

RASTER_PATHNET = {
    "kind": "pathnet",
    "variant": "paint",
    "labels": LABELS,
    "resolution": 100,
    "graph": [48, 48, 48, 48, 48, 48],
    "reverse": True,
    "look": 25,
    "embedding": 8,
    "widths": [16, 32, 64, 96],
    "stem": 2,
    "middle": 4,
    "top": 8,
    "output": 200,
}

COMPACT_PATHNET = {
    **RASTER_PATHNET,
    "resolution": 50,
    "graph": [32] * 6,
    "widths": [16, 32, 64],
    "middle": 2,
    "top": 4,
}

RASTER_STATENET = {
    "kind": "statenet",
    "variant": "lookup",
    "labels": LABELS,
    "resolution": 100,
    "widths": [12, 32, 48],
    "stem": 2,
    "middle": 2,
    "stop": 1,
    "graph": [48, 48, 48, 48, 48, 48],
    "reverse": True,
    "head": 64,
}

COMPACT_STATENET = {
    "kind": "statenet",
    "variant": "ways",
    "labels": LABELS,
    "graph": [48] * 8,
    "reverse": True,
    "head": 64,
}

PAPER_PATHNET = {
    "kind": "pathnet",
    "variant": "paper",
    "labels": LABELS,
    "resolution": 200,
    "n1": 64,
    "graph": [64, 128, 128, 128, 64],
    "fusion": "dense",
    "skip": "third",
    "dropout": 0.5,
}

PAPER_STATENET = {
    "kind": "statenet",
    "variant": "paper",
    "labels": LABELS,
    "resolution": 200,
    "trunk": "bottleneck",
    "trunk_widths": [64, 128, 256, 512],
    "trunk_blocks": [3, 4, 6, 3],
    "map_feature": 256,
    # 64 in the published code, 256 in the paper's text; with 256 no layer has the shape of one of PathNet's, to which IV-D hands them.
    "first": 64,
    "first_relu": False,
    "graph": [128, 256, 512, 256, 128],
    "dropout": 0.5,
}

COMPACT_TRAINING = {
    "batch": 32,
    "rate": 2e-3,
    "schedule": "cosine",
    "warm_up": 100,
    "weight_decay": 1e-4,
    "positive_weight": 1.0,
    "balance": 0.5,
    "suffix": True,
    "reach": True,
    "spread": 0.015,
    "symmetries": True,
    "permute": 0.5,
    "jitter": 0.3,
    "precision": "auto",
}

# Automata and ways alone: the start cannot be moved, symmetries change nothing.
WAYS_TRAINING = {
    **COMPACT_TRAINING,
    "batch": 128,
    "warm_up": 200,
    "symmetries": False,
    "permute": 0.7,
    "jitter": 0.0,
    "precision": "f32",
}

# nngtl.md, IV-D: Adam, batch 128, StateNet 100 epochs with a fixed trunk and 20 with a free one at 1e-3, PathNet 150 epochs at 1e-4.
# Its seven-fold augmentation is done on the fly: an epoch passes each mission seven times, each time by a symmetry drawn anew.
PAPER_TRAINING = {
    **COMPACT_TRAINING,
    "repeats": 7,
    "batch": 128,
    "schedule": "constant",
    "weight_decay": 0.0,
    "warm_up": 0,
    "balance": 0.0,
    "reach": False,
    "spread": None,
    "permute": 0.0,
    "jitter": 0.0,
}

CONFIGS = {
    "compact": {
        "pathnet": {"network": COMPACT_PATHNET, "training": COMPACT_TRAINING},
        "statenet": {"network": COMPACT_STATENET, "training": WAYS_TRAINING},
    },
    "raster": {
        "pathnet": {"network": RASTER_PATHNET, "training": COMPACT_TRAINING},
        "statenet": {"network": RASTER_STATENET, "training": {**COMPACT_TRAINING, "batch": 64}},
    },
    "paper": {
        "pathnet": {"network": PAPER_PATHNET, "training": {**PAPER_TRAINING, "rate": 1e-4, "epochs": 150}},
        "statenet": {
            "network": PAPER_STATENET,
            "training": {**PAPER_TRAINING, "rate": 1e-3, "epochs": 120, "frozen_epochs": 100},
        },
    },
}
"""``paper`` at any width: ``--set network.n1=16``."""


def get(name, kind, changes=()):
    """The configuration called ``name`` (or in the JSON file of that path) for ``pathnet`` or ``statenet``.

    ``changes`` are texts ``network.n1=16`` or ``training.rate=0.001``; values are JSON.
    """
    if name in CONFIGS:
        config = copy.deepcopy(CONFIGS[name][kind])
    elif Path(name).is_file():
        config = json.loads(Path(name).read_text(encoding="utf-8"))[kind]
    else:
        raise ValueError(f"no configuration {name!r}: expected {', '.join(CONFIGS)} or a JSON file")
    for change in changes:
        path, found, value = change.partition("=")
        part, dot, key = path.partition(".")
        if not found or not dot or part not in config:
            raise ValueError(f"cannot read {change!r}: expected network.KEY=VALUE or training.KEY=VALUE")
        try:
            config[part][key] = json.loads(value)
        except json.JSONDecodeError:
            config[part][key] = value
    return config
