"""PathNet and StateNet in all variants. Layers and names: docs/networks.md."""

import torch
from torch import nn
from torch.nn import functional as F

from . import graph as gr
from .resnet import Trunk


class Block(nn.Module):
    """A convolution with its norm; the activation is the caller's."""

    def __init__(self, conv, width):
        super().__init__()
        self.conv = conv
        self.norm = nn.BatchNorm2d(width)

    def forward(self, x):
        return self.norm(self.conv(x))


def conv(inputs, outputs, kernel, stride, padding=1):
    return Block(nn.Conv2d(inputs, outputs, kernel, stride, padding, bias=False), outputs)


STEMS = {1: (3, 1), 2: (4, 2), 4: (4, 4, 0)}
"""Kernel, stride and padding of the first convolution by what it divides the resolution by."""


def up(inputs, outputs, extra):
    return Block(nn.ConvTranspose2d(inputs, outputs, 4, 2, 1, output_padding=extra, bias=False), outputs)


def rare(head):
    """Starts a head at the share of path cells (about 2 %) instead of one half."""
    nn.init.constant_(head.bias, -4.0)
    return head


def leaky(x):
    return F.leaky_relu(x, 0.2)


def halves(resolution, number):
    """``number`` sizes, each half of the one before it, from the first half of ``resolution`` on."""
    sizes = [resolution]
    for _ in range(number):
        sizes.append(sizes[-1] // 2)
    return sizes


def looking_nodes(graphs, features, masks, start):
    """Node features extended by what the map is like where they look: transitions at their regions, the rest at the start."""
    return seeing_nodes(graphs, region_mean(features, torch.cat([masks, start], dim=1)))


def seeing_nodes(graphs, looked):
    """Node features extended by rows ``looked`` (B, labels + 1, C) of the regions and of the start."""
    regions, here = looked[:, :-1], looked[:, -1]
    need, forbid = gr.sign_mean(graphs, regions, 1), gr.sign_mean(graphs, regions, -1)
    return {
        "state": torch.cat([graphs.states, here[graphs.state_graph]], dim=1),
        "transition": torch.cat([graphs.transitions, need, forbid], dim=1),
        "pool": torch.cat([graphs.pool_input(), here], dim=1),
    }


def looking_widths(config, looked):
    plain = plain_widths(config)
    return {
        "state": plain["state"] + looked,
        "transition": plain["transition"] + 2 * looked,
        "pool": plain["pool"] + looked,
    }


class UNet(nn.Module):
    """The map network that our variants share; its parts bear the names of the file."""

    def build_unet(self, inputs, config, stop):
        widths, self.stem = config["widths"], config["stem"]
        base = config["resolution"] // self.stem
        self.sizes = [base] + halves(base, len(widths) - 1)[1:]
        self.encoder = nn.ModuleList([conv(inputs, widths[0], *STEMS[self.stem])])
        for a, b in zip(widths, widths[1:]):
            self.encoder.append(conv(a, b, 4, 2))
        self.middle = nn.ModuleList(conv(widths[-1], widths[-1], 3, 1) for _ in range(config["middle"]))
        # Keyed by level, so that the name of a block is the level that it leaves.
        self.decoder = nn.ModuleDict()
        entering = widths[-1]
        for level in range(len(widths) - 1, stop, -1):
            extra = self.sizes[level - 1] - 2 * self.sizes[level]
            self.decoder[str(level)] = up(entering, widths[level - 1], extra)
            entering = 2 * widths[level - 1]
        self.stop = stop

    def run_unet(self, x, condition=None):
        levels = []
        for block in self.encoder:
            x = leaky(block(x))
            levels.append(x)
        if condition is not None:
            x = x + condition[:, :, None, None]
        for block in self.middle:
            x = leaky(block(x) + x)
        for level in range(len(self.encoder) - 1, self.stop, -1):
            x = torch.cat([F.relu(self.decoder[str(level)](x)), levels[level - 1]], dim=1)
        return x


def drop(x, p, training):
    return F.dropout(x, p, training) if p else x


def run_graph(stack, graphs, nodes, dropout=0.0, training=False):
    """All layers' node features, after each layer."""
    after = []
    for layer in stack:
        nodes = {k: drop(v, dropout, training) for k, v in layer(graphs, nodes).items()}
        after.append(nodes)
    return after


def plain_nodes(graphs):
    return {"state": graphs.states, "transition": graphs.transitions, "pool": graphs.pool_input()}


def plain_widths(config):
    return {"state": 3, "transition": config["labels"], "pool": gr.POOL_WIDTH}


class PathNetPaper(nn.Module):
    """The paper's PathNet (IV-C), without the projections that the published code computes and drops."""

    def __init__(self, config):
        super().__init__()
        self.config, n1 = config, config["n1"]
        widths = [n1 * 2**i for i in range(5)]
        self.sizes = halves(config["resolution"], 5)
        self.encoder = nn.ModuleList(
            conv(a, b, 4, 2) for a, b in zip([1 + config["labels"]] + widths, widths)
        )
        self.graph = gr.layers(plain_widths(config), config["graph"], False)
        dense = self.sizes[5] ** 2 if config["fusion"] == "dense" else 1
        self.fusion = nn.Linear(3 * config["graph"][-1], widths[4] * dense)
        third = config["skip"] == "third"
        if third:
            self.skip = nn.Linear(3 * config["graph"][2], widths[2])
        self.decoder = nn.ModuleList()
        inputs = 2 * widths[4]
        for i, width in enumerate(reversed(widths)):
            if i == 2 and third:
                inputs += 2 * widths[2]
            extra = self.sizes[4 - i] - 2 * self.sizes[5 - i]
            self.decoder.append(up(inputs, width, extra))
            inputs = width
        self.head = rare(nn.Conv2d(n1, 1, 1))

    def forward(self, raster, graphs):
        """Logits (B, R, R) from rasters (B, 1 + labels, R, R)."""
        p, x, levels = self.config.get("dropout", 0.0), raster, []
        for block in self.encoder:
            x = leaky(drop(block(x), p, self.training))
            levels.append(x)
        with torch.autocast(raster.device.type, enabled=False):
            after = run_graph(self.graph, graphs, plain_nodes(graphs), p, self.training)
            feature = gr.graph_feature(graphs, after[-1])
            middle = gr.graph_feature(graphs, after[2]) if self.config["skip"] == "third" else None
        feature = self.fusion(feature).to(x.dtype)
        feature = feature.view(x.shape[0], x.shape[1], *(x.shape[2:] if self.config["fusion"] == "dense" else (1, 1)))
        x = torch.cat([x, feature.expand_as(x)], dim=1)
        for i, block in enumerate(self.decoder):
            if i == 2 and self.config["skip"] == "third":
                skip = self.skip(middle).to(levels[2].dtype)
                x = torch.cat([x, levels[2], skip[:, :, None, None].expand_as(levels[2])], dim=1)
            x = F.relu(drop(block(x), p, self.training))
        return self.head(x)[:, 0]


class Paint(nn.Module):
    """Region embeddings from the transitions that need and that forbid each region: (B, labels, K)."""

    def __init__(self, width, k):
        super().__init__()
        self.need = nn.Linear(width, k, bias=False)
        self.forbid = nn.Linear(width, k, bias=False)
        # Positive, so that no value is dead at the start.
        self.bias = nn.Parameter(torch.full((k,), 0.1))

    def forward(self, graphs, transitions):
        need = gr.region_form(graphs, transitions, 1)
        forbid = gr.region_form(graphs, transitions, -1)
        return F.relu(self.need(need) + self.forbid(forbid) + self.bias)


class PathNetPaint(UNet):
    """Our PathNet: the automaton's embedding of each region is painted onto the region's cells."""

    def __init__(self, config):
        super().__init__()
        self.config, width, k = config, config["graph"][-1], config["embedding"]
        widths = looking_widths(config, PLANES) if config["look"] else plain_widths(config)
        self.graph = gr.layers(widths, config["graph"], config["reverse"])
        self.paint = Paint(width, k)
        self.build_unet(2 + k, config, 0)
        self.condition = nn.Linear(3 * width, config["widths"][-1])
        entering = 2 * config["widths"][0]
        if self.stem == 1:
            self.top = conv(entering, config["top"], 3, 1)
        else:
            # To the full resolution, with a stem of 4 to half of it.
            finest = config["resolution"] // (self.stem // 2)
            self.top = up(entering, config["top"], finest - 2 * self.sizes[0])
        self.head = rare(nn.Conv2d(config["top"], 1, 1))

    def forward(self, raster, graphs):
        """Logits (B, R, R), with a stem of 4 (B, R/2, R/2), from rasters (B, 1 + labels, R, R)."""
        status, masks = raster[:, :1], raster[:, 1:]
        start = (-status).clamp(min=0)
        with torch.autocast(raster.device.type, enabled=False):
            nodes = plain_nodes(graphs)
            if self.config["look"]:
                nodes = looking_nodes(graphs, planes(start, self.config["look"]), masks, start)
            nodes = run_graph(self.graph, graphs, nodes)[-1]
            embedding = self.paint(graphs, nodes["transition"])
            condition = self.condition(gr.graph_feature(graphs, nodes))
        painted = torch.einsum("blxy,blk->bkxy", masks, embedding)
        x = torch.cat([status.clamp(min=0), start, painted], dim=1)
        x = self.run_unet(x.contiguous(memory_format=torch.channels_last), condition)
        return self.head(F.relu(self.top(x)))[:, 0]


class StateNetPaper(nn.Module):
    """The paper's StateNet (IV-C) with a choice of trunk."""

    def __init__(self, config):
        super().__init__()
        self.config = config
        self.squeeze = nn.Conv2d(1 + config["labels"], 3, 1)
        self.trunk = Trunk(config["trunk"], config["trunk_widths"], config["trunk_blocks"])
        self.project = nn.Linear(self.trunk.outputs, config["map_feature"])
        self.first = gr.GraphLayer(plain_widths(config), config["first"], False, config.get("first_relu", True))
        inputs = dict.fromkeys(gr.NODES, config["first"] + config["map_feature"])
        self.graph = gr.layers(inputs, config["graph"], False)
        self.head = nn.ModuleList([nn.Linear(config["graph"][-1], 256), nn.Linear(256, 2)])

    def forward(self, raster, graphs):
        """Logits (S, 2); the probability is the sigmoid of the last."""
        p = self.config.get("dropout", 0.0)
        feature = self.project(self.trunk(self.squeeze(raster))).float()
        with torch.autocast(raster.device.type, enabled=False):
            nodes = run_graph([self.first], graphs, plain_nodes(graphs), p, self.training)[-1]
            owners = {"state": graphs.state_graph, "transition": graphs.transition_graph}
            nodes = {
                kind: torch.cat([x, feature[owners[kind]] if kind in owners else feature], dim=1)
                for kind, x in nodes.items()
            }
            states = run_graph(self.graph, graphs, nodes, p, self.training)[-1]["state"]
            return self.head[1](F.relu(self.head[0](states)))


class StateNetLookup(UNet):
    """Our StateNet: transitions and states look up the map where they need it."""

    def __init__(self, config):
        super().__init__()
        self.config = config
        self.build_unet(3, config, config["stop"])
        widths = looking_widths(config, 2 * config["widths"][config["stop"]] + PLANES)
        self.graph = gr.layers(widths, config["graph"], config["reverse"])
        self.head = nn.ModuleList(
            [nn.Linear(config["graph"][-1], config["head"]), nn.Linear(config["head"], 1)]
        )

    def forward(self, raster, graphs):
        """Logits (S, 1)."""
        status, masks = raster[:, :1], raster[:, 1:]
        start = (-status).clamp(min=0)
        x = torch.cat([status.clamp(min=0), start, masks.sum(1, keepdim=True).clamp(max=1)], dim=1)
        x = self.run_unet(x.contiguous(memory_format=torch.channels_last)).float()
        with torch.autocast(raster.device.type, enabled=False):
            x = torch.cat([x, planes(start, x.shape[2])], dim=1)
            nodes = looking_nodes(graphs, x, masks, start)
            states = run_graph(self.graph, graphs, nodes)[-1]["state"]
            return self.head[1](F.relu(self.head[0](states)))


class StateNetWays(nn.Module):
    """Our StateNet: nodes know how far the regions are from each other and from the start."""

    def __init__(self, config):
        super().__init__()
        self.config = config
        self.graph = gr.layers(looking_widths(config, config["labels"] + 1), config["graph"], config["reverse"])
        self.head = nn.ModuleList(
            [nn.Linear(config["graph"][-1], config["head"]), nn.Linear(config["head"], 1)]
        )

    def forward(self, raster, graphs):
        """Logits (S, 1)."""
        with torch.autocast(graphs.states.device.type, enabled=False):
            nodes = seeing_nodes(graphs, graphs.ways)
            states = run_graph(self.graph, graphs, nodes)[-1]["state"]
            return self.head[1](F.relu(self.head[0](states)))


PLANES = 5


def planes(start, side):
    """Where each cell is, and where it is from the start: (B, 5, side, side)."""
    count, resolution = start.shape[0], start.shape[2]
    flat = start.flatten(1).argmax(dim=1)
    cell = torch.stack([flat // resolution, flat % resolution], dim=1)
    at = ((cell + 0.5) / resolution)[:, :, None, None]
    centre = (torch.arange(side, device=start.device, dtype=torch.float32) + 0.5) / side
    grid = torch.stack(torch.meshgrid(centre, centre, indexing="ij")).expand(count, 2, side, side)
    away = grid - at
    return torch.cat([grid, away, away.square().sum(1, keepdim=True).sqrt()], dim=1)


def region_mean(features, masks):
    """The mean feature under each mask, 0 under an empty one: (B, n, C)."""
    masks = F.avg_pool2d(masks, masks.shape[2] // features.shape[2]).flatten(2)
    total = masks @ features.flatten(2).transpose(1, 2)
    return total / masks.sum(2, keepdim=True).clamp(min=1e-12)


VARIANTS = {
    ("pathnet", "paper"): PathNetPaper,
    ("pathnet", "paint"): PathNetPaint,
    ("statenet", "paper"): StateNetPaper,
    ("statenet", "lookup"): StateNetLookup,
    ("statenet", "ways"): StateNetWays,
}


def build(config):
    """The network that a configuration describes."""
    key = (config["kind"], config["variant"])
    if key not in VARIANTS:
        known = ", ".join("/".join(k) for k in VARIANTS)
        raise ValueError(f"there is no network {'/'.join(key)}: choose one of {known}")
    return VARIANTS[key](config)


def handed_layers(statenet, pathnet):
    """Copies graph layers of equal shape, layer by layer in order, from a StateNet to a PathNet (IV-D).

    Returns the names of the layers that were copied.
    """
    giving = ([("first", statenet.first)] if hasattr(statenet, "first") else []) + [
        (f"graph.{k}", layer) for k, layer in enumerate(statenet.graph)
    ]
    copied = []
    for k, layer in enumerate(pathnet.graph):
        if k >= len(giving):
            break
        have = {n: v.shape for n, v in layer.state_dict().items()}
        offered = giving[k][1].state_dict()
        if have == {n: v.shape for n, v in offered.items()}:
            layer.load_state_dict(offered)
            copied.append(f"{giving[k][0]} -> graph.{k}")
    return copied
