"""Weight files from the checkpoints of the published NNgTL networks (docs/networks.md, *Published checkpoints*).

Their state dictionaries (``LTL_Net`` is PathNet, ``BA_Predict`` StateNet) have other names, a bias in front of
every norm, and tensors that the forward pass never reads. Sizes are read off the shapes.
"""

import argparse
import hashlib
import pickle
import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import torch
from torch.nn.parameter import UninitializedParameter, is_lazy

from . import export, models
from . import graph as gr

PATHNET_PARTS = ("ba_encoder.", "map_encoder.", "fusion_net.", "path_predict.")
STATENET_PARTS = ("gnn1.", "image_feature_extractor.", "node_classifier.")
NODE_TYPES = {"state": "node", "transition": "edge", "pool": "source"}
LAYERS = 5
RESNET50 = (3, 4, 6, 3)
RESOLUTION = 200
# The inputs that these weights were trained with are encoded in the published code's way.
PUBLISHED_ENCODING = 2
HIDDEN = 256
# Stands in for a size that no tensor of the checkpoint tells: then those that would are missing and told as such.
PUBLISHED = {"n1": 64, "labels": 7, "side": 6, "map_feature": 256, "first": 64}
PUBLISHED_GRAPHS = {"pathnet": (64, 128, 128, 128, 64), "statenet": (128, 256, 512, 256, 128)}
PUBLISHED_TRUNK = (64, 128, 256, 512)


class CheckpointError(ValueError):
    """What is wrong with a checkpoint: ``faults`` are all of it, a sentence each."""

    def __init__(self, faults):
        super().__init__("\n".join(faults))
        self.faults = list(faults)


@dataclass
class Conversion:
    """A network with a checkpoint's weights, and the checkpoint's tensors that it does without: name → reason."""

    model: torch.nn.Module
    unread: dict


def load(path):
    """The state dictionary of a checkpoint file, as bare weights or as what the published training script saves.

    Nothing in the file is executed: a pickle with more than tensors and plain containers is refused.
    """
    path = Path(path)
    if not path.is_file():
        raise CheckpointError([f"{path} is no file"])
    try:
        loaded = _unpickle(path)
    except pickle.UnpicklingError as error:
        reason = str(error).replace("\n", " ")
        _, _, told = reason.partition("WeightsUnpickler error: ")
        raise CheckpointError(
            [
                f"{path} is not a checkpoint of tensors alone, and loading other objects could run code that it "
                f"brings along: save `model.state_dict()` instead ({(told or reason)[:200].strip()})"
            ]
        ) from error
    except Exception as error:  # a damaged archive fails in many ways, deep inside PyTorch
        first = (str(error).splitlines() or [type(error).__name__])[0]
        raise CheckpointError([f"{path} cannot be read as a file of `torch.save` ({first[:200]})"]) from error
    return state_dictionary(loaded, str(path))


def _unpickle(path):
    # Lazy layers that never ran are saved as this class, which holds no value.
    with torch.serialization.safe_globals([UninitializedParameter]), open(path, "rb") as file:
        archive = file.read(4) == b"PK\x03\x04"
        # Mapped, because most of a published PathNet's bytes are projections that nothing reads.
        return torch.load(path, map_location="cpu", weights_only=True, mmap=True if archive else None)


def state_dictionary(loaded, place="the checkpoint"):
    """The state dictionary in what a checkpoint file holds."""
    if isinstance(loaded, dict):
        for key in ("model_state_dict", "state_dict"):
            if isinstance(loaded.get(key), dict):
                loaded = loaded[key]
    if not isinstance(loaded, dict) or not any(torch.is_tensor(value) for value in loaded.values()):
        kind = type(loaded).__name__
        raise CheckpointError([f"{place} holds a {kind}, expected a state dictionary: names and their tensors"])
    wrong = [f"{name!r} is a {type(value).__name__}, expected a tensor" for name, value in loaded.items()
             if not isinstance(name, str) or not torch.is_tensor(value)]  # fmt: skip
    if wrong:
        raise CheckpointError(wrong)
    return loaded


def convert(state, blocks=RESNET50, resolution=RESOLUTION):
    """The network of a published state dictionary; raises ``CheckpointError`` with all that is wrong.

    A StateNet's shapes tell neither ``blocks``, the residual blocks of each layer of its trunk, nor ``resolution``.
    """
    parts = {"pathnet": PATHNET_PARTS, "statenet": STATENET_PARTS}
    known = {kind: sum(name.startswith(part) for name in state) for kind, part in parts.items()}
    if not any(known.values()):
        expected = ", ".join(PATHNET_PARTS + STATENET_PARTS[1:])
        raise CheckpointError(
            [f"no tensor is one of the published networks', whose names begin with {expected}"]
            + [f"{name} is unknown" for name in state]
        )
    if known["pathnet"] >= known["statenet"]:
        config, plan = _pathnet(state)
    else:
        config, plan = _statenet(state, blocks, resolution)
    faults = plan.faults(state)
    if faults:
        raise CheckpointError(faults)
    model = models.build(config)
    made = {target: make(state) for target, make in plan.made.items()}
    missing, unknown = model.load_state_dict(made, strict=False)
    missing = [name for name in missing if not name.endswith("num_batches_tracked")]
    assert not missing and not unknown, f"the mapping of names is at fault: {missing} {unknown}"
    return Conversion(model.eval(), {name: why for name, why in plan.unread.items() if name in state})


@dataclass
class Plan:
    """Which tensors a checkpoint must have, and what becomes of them."""

    shapes: dict = field(default_factory=dict)
    """Published name → shape."""
    made: dict = field(default_factory=dict)
    """Our name → function of the state dictionary."""
    unread: dict = field(default_factory=dict)
    """Published name → why it is not needed."""

    def take(self, target, name, *shape):
        self.shapes[name] = shape
        self.made[target] = lambda state: state[name].float()

    def flat(self, target, name, *shape):
        self.shapes[name] = shape
        self.made[target] = lambda state: state[name].float().flatten()

    def layer(self, target, name, *shape):
        """A linear layer or a convolution with its bias."""
        self.take(f"{target}.weight", f"{name}.weight", *shape)
        self.take(f"{target}.bias", f"{name}.bias", shape[0])

    def norm(self, target, name, width):
        for part in ("weight", "bias", "running_mean", "running_var"):
            self.take(f"{target}.{part}", f"{name}.{part}", width)
        self.unread[f"{name}.num_batches_tracked"] = "a counter of training"

    def block(self, target, name, width, *shape):
        """A convolution with a bias and its norm; ours has no bias: the norm's mean takes it up."""
        conv, norm = f"{name}.0", f"{name}.1"
        self.take(f"{target}.conv.weight", f"{conv}.weight", *shape)
        self.norm(f"{target}.norm", norm, width)
        self.shapes[f"{conv}.bias"] = (width,)
        self.made[f"{target}.norm.running_mean"] = lambda state: (
            state[f"{norm}.running_mean"].double() - state[f"{conv}.bias"].double()
        ).float()

    def graph_layer(self, target, prefix, style, widths, out):
        """A ``HeteroConv`` of ``GATConv``; ``widths`` are the features' by our node types."""
        for edges, (source, end) in _edge_types():
            ours, theirs = f"{target}.{edges}", f"{prefix}.convs.{_edge_key(source, end, style)}"
            self.take(f"{ours}.src.weight", f"{theirs}.lin_src.weight", out, widths[source])
            for vector in ("att_src", "att_dst"):
                self.flat(f"{ours}.{vector}", f"{theirs}.{vector}", 1, 1, out)
            self.take(f"{ours}.bias", f"{theirs}.bias", out)
            if source != end:
                self.take(f"{ours}.dst.weight", f"{theirs}.lin_dst.weight", out, widths[end])
                continue
            # Older releases of PyTorch Geometric leave it uninitialised, newer ones read it to no effect.
            self.unread[f"{theirs}.lin_dst.weight"] = "the softmax over a node's own loop is 1"
            zeros = (out, widths[end])
            self.made[f"{ours}.dst.weight"] = lambda state, zeros=zeros: torch.zeros(zeros)

    def faults(self, state):
        """All that is wrong with a state dictionary."""
        found = [
            f"{name} is missing, expected shape {_text(shape)}" for name, shape in self.shapes.items() if name not in state
        ]
        for name, value in state.items():
            if name in self.shapes:
                found += _tensor_faults(name, value, self.shapes[name])
            elif name not in self.unread:
                found.append(f"{name} is unknown")
        return found


def _tensor_faults(name, value, shape):
    if is_lazy(value):
        return [f"{name} was never initialised: run the network once before saving it"]
    if value.layout != torch.strided:
        return [f"{name} is sparse, expected a dense tensor"]
    if not value.is_floating_point():
        return [f"{name} holds {str(value.dtype).removeprefix('torch.')}, expected floating-point numbers"]
    found = []
    if tuple(value.shape) != shape:
        found.append(f"{name} has shape {_text(value.shape)}, expected {_text(shape)}")
    if not bool(torch.isfinite(value.float()).all()):
        found.append(f"{name} holds values that are not finite")
    elif name.endswith("running_var") and bool((value < 0).any()):
        found.append(f"{name} holds negative variances")
    return found


def _text(shape):
    return "×".join(map(str, shape)) if len(shape) else "a single value"


def _edge_types():
    return [(name, ends) for name, ends in gr.ENDS.items() if name not in gr.REVERSE]


def _edge_key(source, end, style):
    relation = "self_loop" if source == end else "connect"
    return style.format(NODE_TYPES[source], relation, NODE_TYPES[end])


def _style(state):
    """How PyTorch Geometric spelled edge types when the checkpoint was made: before and since its release 2.4."""
    older = sum(".convs." in name and ".convs.<" not in name for name in state)
    newer = sum(".convs.<" in name for name in state)
    return "{}__{}__{}" if older > newer else "<{}___{}___{}>"


def _vote(state, published, places):
    """A size that several tensors tell, so that one of a wrong shape is named instead of all others.

    A place is (name, axis, factor, offset): the tensor has ``factor · size + offset`` there.
    """
    votes = Counter()
    for name, axis, factor, offset in places:
        value = state.get(name)
        if value is None or is_lazy(value) or value.dim() <= axis:
            continue
        size, rest = divmod(value.shape[axis] - offset, factor)
        if size >= 1 and not rest:
            votes[size] += 1
    return votes.most_common(1)[0][0] if votes else published


def _norm_places(name, factor=1):
    return [(f"{name}.{part}", 0, factor, 0) for part in ("weight", "bias", "running_mean", "running_var")]


def _graph_width(state, prefix, style, published):
    keys = [f"{prefix}.convs.{_edge_key(*ends, style)}" for _, ends in _edge_types()]
    places = [(f"{key}.{part}", axis, 1, 0) for key in keys for part, axis in (("bias", 0), ("att_src", 2), ("att_dst", 2))]
    return _vote(state, published, places)


def _labels(state, style, conv, prefix):
    """The first convolution sees the status and the labels, the first graph layer the labels on transitions."""
    places = [(f"{conv}.weight", 1, 1, 1)]
    for _, (source, end) in _edge_types():
        key = f"{prefix}.convs.{_edge_key(source, end, style)}"
        if source == "transition":
            places.append((f"{key}.lin_src.weight", 1, 1, 0))
        elif end == "transition":
            places.append((f"{key}.lin_dst.weight", 1, 1, 0))
    return _vote(state, PUBLISHED["labels"], places)


def _pathnet(state):
    style = _style(state)
    places = []
    for i in range(LAYERS):
        places += _norm_places(f"map_encoder.Conv{i + 1}.conv.1", 2**i)
        places += _norm_places(f"path_predict.Up{i + 1}.up.1", 2**i)
    n1 = _vote(state, PUBLISHED["n1"], places)
    labels = _labels(state, style, "map_encoder.Conv1.conv.0", "ba_encoder.gnn1")
    widths = [n1 * 2**i for i in range(LAYERS)]
    graph = [
        _graph_width(state, f"ba_encoder.gnn{k + 1}", style, published)
        for k, published in enumerate(PUBLISHED_GRAPHS["pathnet"])
    ]
    side = _side(state, widths[-1])

    plan = Plan()
    for i, (inputs, width) in enumerate(zip([1 + labels] + widths, widths)):
        plan.block(f"encoder.{i}", f"map_encoder.Conv{i + 1}.conv", width, width, inputs, 4, 4)
    features = {"state": 3, "transition": labels, "pool": gr.POOL_WIDTH}
    for k, out in enumerate(graph):
        plan.graph_layer(f"graph.{k}", f"ba_encoder.gnn{k + 1}", style, features, out)
        features = dict.fromkeys(gr.NODES, out)
    plan.layer("fusion", "fusion_net.project_gnn5", widths[-1] * side * side, 3 * graph[-1])
    for level in range(1, LAYERS):
        for part in ("weight", "bias"):
            plan.unread[f"fusion_net.project_gnn{level}.{part}"] = "nothing reads what is projected for a skip connection"
    for i, width in enumerate(reversed(widths)):
        inputs = 2 * width  # the fusion doubles the bottleneck; after that each level is twice as wide as the next
        plan.block(f"decoder.{i}", f"path_predict.Up{LAYERS - i}.up", width, inputs, width, 4, 4)
    plan.layer("head", "path_predict.Conv6", 1, n1, 1, 1)
    config = {
        "kind": "pathnet",
        "variant": "paper",
        "labels": labels,
        # Five up-convolutions, the second with an output padding of 1: side → 2·side → 4·side + 1 → … → 32·side + 8.
        "resolution": 32 * side + 8,
        "n1": n1,
        "graph": graph,
        "fusion": "dense",
        "skip": "none",
    }
    return config, plan


def _side(state, width):
    """Cells per side at the bottleneck: the projection has a row for each of its values."""
    votes = Counter()
    for part in ("weight", "bias"):
        value = state.get(f"fusion_net.project_gnn5.{part}")
        if value is not None and not is_lazy(value) and value.dim():
            side = round((value.shape[0] / width) ** 0.5)
            votes[side] += side >= 1 and side * side * width == value.shape[0]
    side, number = votes.most_common(1)[0] if votes else (0, 0)
    return side if number else PUBLISHED["side"]


def _statenet(state, blocks, resolution):
    style = _style(state)
    image, nodes = "image_feature_extractor", "node_classifier"
    labels = _labels(state, style, f"{image}.conv1", "gnn1")
    fc = [(f"{image}.fc.weight", 0, 1, 0), (f"{image}.fc.bias", 0, 1, 0)]
    map_feature = _vote(state, PUBLISHED["map_feature"], fc)
    first = _graph_width(state, "gnn1", style, PUBLISHED["first"])
    graph = [
        _graph_width(state, f"{nodes}.gnn{k + 1}", style, published)
        for k, published in enumerate(PUBLISHED_GRAPHS["statenet"])
    ]
    trunk = []
    for level, published in enumerate(PUBLISHED_TRUNK):
        places = []
        for b in range(blocks[level]):
            for k, factor in ((1, 1), (2, 1), (3, 4)):
                places += _norm_places(f"{image}.resnet.{4 + level}.{b}.bn{k}", factor)
        trunk.append(_vote(state, published, places))

    plan = Plan()
    plan.layer("squeeze", f"{image}.conv1", 3, 1 + labels, 1, 1)
    _trunk(plan, f"{image}.resnet", trunk, blocks)
    plan.layer("project", f"{image}.fc", map_feature, 4 * trunk[-1])
    features = {"state": 3, "transition": labels, "pool": gr.POOL_WIDTH}
    plan.graph_layer("first", "gnn1", style, features, first)
    features = dict.fromkeys(gr.NODES, first + map_feature)
    for k, out in enumerate(graph):
        plan.graph_layer(f"graph.{k}", f"{nodes}.gnn{k + 1}", style, features, out)
        features = dict.fromkeys(gr.NODES, out)
    plan.layer("head.0", f"{nodes}.linear1", HIDDEN, graph[-1])
    plan.layer("head.1", f"{nodes}.linear2", 2, HIDDEN)
    config = {
        "kind": "statenet",
        "variant": "paper",
        "labels": labels,
        "resolution": resolution,
        "trunk": "bottleneck",
        "trunk_widths": trunk,
        "trunk_blocks": list(blocks),
        "map_feature": map_feature,
        "first": first,
        "first_relu": False,
        "graph": graph,
    }
    return config, plan


def _trunk(plan, name, widths, blocks):
    """A ResNet whose parts are numbered: 0 and 1 the stem's convolution and norm, 4 to 7 the layers."""
    plan.take("trunk.conv1.weight", f"{name}.0.weight", widths[0], 3, 7, 7)
    plan.norm("trunk.bn1", f"{name}.1", widths[0])
    inputs = widths[0]
    for level, (width, number) in enumerate(zip(widths, blocks)):
        for b in range(number):
            ours, theirs = f"trunk.layer{level + 1}.{b}", f"{name}.{4 + level}.{b}"
            parts = [(1, width, inputs, 1), (2, width, width, 3), (3, 4 * width, width, 1)]
            for k, out, entering, kernel in parts:
                plan.take(f"{ours}.conv{k}.weight", f"{theirs}.conv{k}.weight", out, entering, kernel, kernel)
                plan.norm(f"{ours}.bn{k}", f"{theirs}.bn{k}", out)
            if b == 0:
                plan.take(f"{ours}.downsample.0.weight", f"{theirs}.downsample.0.weight", 4 * width, inputs, 1, 1)
                plan.norm(f"{ours}.downsample.1", f"{theirs}.downsample.1", 4 * width)
            inputs = 4 * width


def convert_files(checkpoints, folder):
    """Writes ``pathnet.safetensors`` and ``statenet.safetensors`` from checkpoint files, all of them or none.

    Returns the files written with their conversions.
    """
    faults, done = [], {}
    for checkpoint in map(Path, checkpoints):
        try:
            conversion = convert(load(checkpoint))
        except CheckpointError as error:
            several = len(checkpoints) > 1
            faults += [f"{checkpoint}: {fault}" if several else fault for fault in error.faults]
            continue
        kind = conversion.model.config["kind"]
        if kind in done:
            faults.append(f"{checkpoint} and {done[kind][0]} are both a {kind}: give one of each kind at most")
        done[kind] = (checkpoint, conversion)
    if faults:
        raise CheckpointError(faults)
    written = {}
    for kind, (checkpoint, conversion) in done.items():
        path = Path(folder) / f"{kind}.safetensors"
        source = {"file": checkpoint.name, "sha256": _digest(checkpoint)}
        export.write(path, conversion.model, {"converted_from": source}, {"encoding": PUBLISHED_ENCODING})
        written[path] = conversion
    return written


def _digest(path):
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while chunk := file.read(1 << 20):
            digest.update(chunk)
    return digest.hexdigest()


def main(arguments=None):
    parser = argparse.ArgumentParser(
        description="Turns checkpoints (.pth) of the published NNgTL networks into weight files; "
        "which of both networks a checkpoint is, its width and its labels are read off its tensors."
    )
    parser.add_argument("checkpoint", type=Path, nargs="+", help="state dictionary of LTL_Net or of BA_Predict")
    parser.add_argument("--out", type=Path, required=True, help="folder of the weight files, for example models/published")
    options = parser.parse_args(arguments)
    try:
        written = convert_files(options.checkpoint, options.out)
    except CheckpointError as error:
        print(f"{parser.prog}: nothing is written:", *error.faults, sep="\n  ", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return 2
    for path, conversion in written.items():
        config = conversion.model.config
        width = f"n1 = {config['n1']}, " if "n1" in config else ""
        print(f"{path}: {config['kind']}, {width}{config['labels']} labels, {config['resolution']} cells a side")
        print(f"  left out, since the output does not depend on them ({len(conversion.unread)}):")
        for name, why in conversion.unread.items():
            print(f"    {name}: {why}")
    return 0
