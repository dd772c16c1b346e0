"""The published NNgTL networks with the tensor names and the forward pass of their code, as reference for ``convert``.

Written with PyTorch Geometric's layers from what was found out about that code (docs/networks.md, *Published checkpoints*).
``python training/tests/published.py tests/goldens/models`` writes two small networks, converted, with an input and the output
that these classes give: ``pathnet-published`` and ``statenet-published``, in the form of ``nngtl_training.goldens``.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F
from torch_geometric.nn import GATConv, HeteroConv

sys.path.insert(0, str(Path(__file__).parents[1]))

from nngtl_training import convert, export, goldens  # noqa: E402

TYPES = ("node", "edge", "source")
CONNECTED = (("node", "edge"), ("edge", "node"), ("node", "source"), ("edge", "source"))
EDGE_TYPES = [(a, "connect", b) for a, b in CONNECTED] + [(t, "self_loop", t) for t in TYPES]


def parts(**modules):
    """A module with children of these names."""
    module = nn.Module()
    for name, child in modules.items():
        module.add_module(name, child)
    return module


def attention(width):
    return HeteroConv({edge: GATConv((-1, -1), width, add_self_loops=False) for edge in EDGE_TYPES}, aggr="mean")


def graph_stack(widths):
    return {f"gnn{k}": attention(width) for k, width in enumerate(widths, start=1)}


def rectified(nodes):
    return {kind: F.relu(x) for kind, x in nodes.items()}


def pooled(nodes, owners, count):
    """The means over each type's nodes, side by side."""
    means = []
    for kind in TYPES:
        total = nodes[kind].new_zeros(count, nodes[kind].shape[1]).index_add(0, owners[kind], nodes[kind])
        means.append(total / torch.bincount(owners[kind], minlength=count).clamp(min=1)[:, None])
    return torch.cat(means, dim=1)


class PathNet(nn.Module):
    """``LTL_Net``; ``side`` cells at the bottleneck make 32·side + 8 cells of the map."""

    def __init__(self, n1, labels, graph=(64, 128, 128, 128, 64), side=6):
        super().__init__()
        self.side = side
        down = [1 + labels] + [n1 * 2**i for i in range(5)]
        sides = [16 * side + 4, 8 * side + 2, 4 * side + 1, 2 * side, side]
        self.ba_encoder = parts(**graph_stack(graph))
        self.map_encoder, self.fusion_net, self.path_predict = parts(), parts(), parts()
        for i in range(1, 6):
            conv = nn.Conv2d(down[i - 1], down[i], 4, 2, 1)
            block = nn.Sequential(conv, nn.BatchNorm2d(down[i]), nn.Dropout(0.5), nn.LeakyReLU(0.2))
            self.map_encoder.add_module(f"Conv{i}", parts(conv=block))
            self.fusion_net.add_module(f"project_gnn{i}", nn.Linear(3 * graph[i - 1], down[i] * sides[i - 1] ** 2))
            conv = nn.ConvTranspose2d(2 * down[i], down[i], 4, 2, 1, output_padding=int(i == 4))
            block = nn.Sequential(conv, nn.BatchNorm2d(down[i]), nn.Dropout(0.5), nn.ReLU())
            self.path_predict.add_module(f"Up{i}", parts(up=block))
        self.path_predict.add_module("Conv6", nn.Conv2d(n1, 1, 1))

    def forward(self, maps, nodes, edges, owners):
        """Logits (B, R, R) from maps (B, R, R, 1 + labels)."""
        x = maps.permute(0, 3, 1, 2)
        for i in range(1, 6):
            x = getattr(self.map_encoder, f"Conv{i}").conv(x)
            nodes = rectified(getattr(self.ba_encoder, f"gnn{i}")(nodes, edges))
        feature = self.fusion_net.project_gnn5(pooled(nodes, owners, len(maps)))
        x = torch.cat([x, feature.view(x.shape)], dim=1)
        for i in range(5, 0, -1):
            x = getattr(self.path_predict, f"Up{i}").up(x)
        return self.path_predict.Conv6(x).squeeze(1)


class Residual(nn.Module):
    """ResNet's bottleneck block with torchvision's names."""

    def __init__(self, inputs, width, stride, project):
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, width, 1, bias=False)
        self.conv2 = nn.Conv2d(width, width, 3, stride, 1, bias=False)
        self.conv3 = nn.Conv2d(width, 4 * width, 1, bias=False)
        self.bn1, self.bn2, self.bn3 = nn.BatchNorm2d(width), nn.BatchNorm2d(width), nn.BatchNorm2d(4 * width)
        shortcut = [nn.Conv2d(inputs, 4 * width, 1, stride, bias=False), nn.BatchNorm2d(4 * width)]
        self.downsample = nn.Sequential(*shortcut) if project else nn.Identity()

    def forward(self, x):
        y = self.bn1(self.conv1(x)).relu()
        y = self.bn2(self.conv2(y)).relu()
        return (self.bn3(self.conv3(y)) + self.downsample(x)).relu()


def trunk(widths, blocks):
    """A ResNet without its last layer, its children numbered."""
    layers = [nn.Conv2d(3, widths[0], 7, 2, 3, bias=False), nn.BatchNorm2d(widths[0]), nn.ReLU(), nn.MaxPool2d(3, 2, 1)]
    inputs = widths[0]
    for level, (width, number) in enumerate(zip(widths, blocks)):
        row = [Residual(inputs, width, 1 if level == 0 else 2, True)]
        row += [Residual(4 * width, width, 1, False) for _ in range(number - 1)]
        layers.append(nn.Sequential(*row))
        inputs = 4 * width
    return nn.Sequential(*layers, nn.AdaptiveAvgPool2d(1))


class StateNet(nn.Module):
    """``BA_Predict``."""

    def __init__(
        self, labels, widths=(64, 128, 256, 512), blocks=(3, 4, 6, 3), feature=256, first=64, graph=(128, 256, 512, 256, 128)
    ):
        super().__init__()
        self.image_feature_extractor = parts(
            conv1=nn.Conv2d(1 + labels, 3, 1), resnet=trunk(widths, blocks), fc=nn.Linear(4 * widths[-1], feature)
        )
        head = {"linear1": nn.Linear(graph[-1], 256), "linear2": nn.Linear(256, 2)}
        self.node_classifier = parts(**graph_stack(graph), **head)
        self.gnn1 = attention(first)
        self.depth = len(graph)

    def forward(self, maps, nodes, edges, owners):
        """Logits (S, 2) from maps (B, R, R, 1 + labels)."""
        image, classifier = self.image_feature_extractor, self.node_classifier
        feature = image.fc(image.resnet(image.conv1(maps.permute(0, 3, 1, 2))).flatten(1))
        nodes = self.gnn1(nodes, edges)  # no ReLU here
        nodes = {kind: torch.cat([x, feature[owners[kind]]], dim=1) for kind, x in nodes.items()}
        for k in range(1, self.depth + 1):
            nodes = rectified(getattr(classifier, f"gnn{k}")(nodes, edges))
        return classifier.linear2(F.relu(classifier.linear1(nodes["node"])))


def arguments(raster, graphs):
    """What the published networks are given for a batch of ours."""
    states, transitions, pools = (torch.arange(len(x)) for x in (graphs.states, graphs.transitions, range(graphs.count)))
    ends = {
        ("node", "connect", "edge"): (graphs.source, transitions),
        ("edge", "connect", "node"): (transitions, graphs.target),
        ("node", "connect", "source"): (states, graphs.state_graph),
        ("edge", "connect", "source"): (transitions, graphs.transition_graph),
        ("node", "self_loop", "node"): (states, states),
        ("edge", "self_loop", "edge"): (transitions, transitions),
        ("source", "self_loop", "source"): (pools, pools),
    }
    nodes = {"node": graphs.states, "edge": graphs.transitions, "source": torch.full((graphs.count, 128), 0.5)}
    owners = {"node": graphs.state_graph, "edge": graphs.transition_graph, "source": pools}
    edges = {kind: torch.stack(pair) for kind, pair in ends.items()}
    return raster.permute(0, 2, 3, 1), nodes, edges, owners


@torch.no_grad()
def initialise(network, raster, graphs, seed):
    """Random weights and running statistics that leave nothing idle and saturate nothing; lazy layers run once first."""
    torch.manual_seed(seed)
    network.eval()(*arguments(raster, graphs))
    for name, value in network.state_dict().items():
        if name.endswith("running_mean"):
            value.normal_(0, 0.3)
        elif name.endswith("running_var"):
            value.uniform_(0.5, 1.5)
        elif ".att_" in name:
            value.normal_(0, 1)
        elif value.dim() > 1:
            gain = 4 if "lin_src" in name else 2  # a mean over edge types halves the variance once more
            value.normal_(0, (gain / value[0].numel()) ** 0.5)
        elif name.endswith("bn3.weight"):
            value.uniform_(0.1, 0.3)  # or the sums of sixteen residual blocks grow out of bounds
        elif name.endswith("weight"):
            value.uniform_(0.7, 1.3)
        elif value.is_floating_point():
            value.normal_(0, 0.3)
    # The last layer is set so that probabilities spread: logits around 0, 1.5 wide.
    last = network.path_predict.Conv6 if isinstance(network, PathNet) else network.node_classifier.linear2
    logits = network(*arguments(raster, graphs))
    scale = 1.5 / (logits.std() if isinstance(network, PathNet) else logits.std(dim=0))
    last.weight.mul_(scale.view(-1, *[1] * (last.weight.dim() - 1)))
    middle = logits.mean() if isinstance(network, PathNet) else logits.mean(dim=0)
    last.bias.copy_((last.bias - middle) * scale)
    return network


GOLDEN_BLOCKS = (1, 2, 1, 1)
GOLDENS = {
    "pathnet-published": (lambda: PathNet(1, 3, (4, 5, 6, 5, 4), side=2), 72),
    "statenet-published": (lambda: StateNet(3, (2, 3, 4, 4), GOLDEN_BLOCKS, 6, 8, (6, 8, 8, 6, 5)), 64),
}


def golden(name):
    """A small published network with an input: (network, raster, graphs, conversion)."""
    make, side = GOLDENS[name]
    raster, graphs = goldens.example(3, side, np.random.default_rng(7))
    network = initialise(make(), raster, graphs, seed=7)
    return network, raster, graphs, convert.convert(network.state_dict(), GOLDEN_BLOCKS, side)


@torch.no_grad()
def probabilities(network, raster, graphs):
    """What the planner is given: a heatmap for each map, or a probability for each state."""
    p = torch.sigmoid(network(*arguments(raster, graphs)))
    return p if isinstance(network, PathNet) else p[:, 1]


def main():
    parser = argparse.ArgumentParser(description="Writes the goldens of converted checkpoints.")
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    for name in GOLDENS:
        network, raster, graphs, conversion = golden(name)
        export.write(folder / f"{name}.safetensors", conversion.model, {"golden": name})
        result = probabilities(network, raster, graphs)
        goldens.write_golden(folder / f"{name}.io.safetensors", raster, graphs, result[0] if result.dim() == 3 else result)
        print(f"{name}: output {result.min():.4f} to {result.max():.4f}, deviation {result.std():.4f}")


if __name__ == "__main__":
    main()
