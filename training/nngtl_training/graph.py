"""Graph attention on automata (docs/networks.md, *Automaton graph* and *Ops*), in plain PyTorch.

Equal to PyTorch Geometric's ``HeteroConv({type: GATConv(...)}, aggr="mean")`` followed by ReLU, which the
tests check; written out because a batch of automata needs only a gather where each target has one incoming edge.
"""

from dataclasses import dataclass

import torch
from torch import nn
from torch.nn import functional as F

POOL_WIDTH = 128
POOL_VALUE = 0.5

ENDS = {
    "state_to_transition": ("state", "transition"),
    "transition_to_state": ("transition", "state"),
    "state_self": ("state", "state"),
    "transition_self": ("transition", "transition"),
    "pool_self": ("pool", "pool"),
    "state_to_pool": ("state", "pool"),
    "transition_to_pool": ("transition", "pool"),
    "target_to_transition": ("state", "transition"),
    "transition_to_source": ("transition", "state"),
}
"""Node types that each edge type connects."""

REVERSE = ("target_to_transition", "transition_to_source")
NODES = ("state", "transition", "pool")


@dataclass
class Graphs:
    """A batch of automata, node lists concatenated.

    ``states`` is (S, 3), ``transitions`` (T, labels) of −1, 0, 1; ``source`` and ``target`` (T) number
    states of the whole batch; ``state_graph`` (S) and ``transition_graph`` (T) say whose they are. ``ways``
    (count, labels + 1, labels + 1) are lengths of ways between regions and the start (docs/networks.md, *Ways*), where they are known.
    """

    states: torch.Tensor
    transitions: torch.Tensor
    source: torch.Tensor
    target: torch.Tensor
    state_graph: torch.Tensor
    transition_graph: torch.Tensor
    count: int
    ways: torch.Tensor | None = None

    def pool_input(self):
        return self.states.new_full((self.count, POOL_WIDTH), POOL_VALUE)


class Attention(nn.Module):
    """One edge type of one layer: a GATConv with one head."""

    def __init__(self, sources, targets, width):
        super().__init__()
        self.src = nn.Linear(sources, width, bias=False)
        self.dst = nn.Linear(targets, width, bias=False)
        self.att_src = nn.Parameter(torch.empty(width))
        self.att_dst = nn.Parameter(torch.empty(width))
        self.bias = nn.Parameter(torch.zeros(width))
        nn.init.xavier_uniform_(self.src.weight)
        nn.init.xavier_uniform_(self.dst.weight)
        bound = (6.0 / (1 + width)) ** 0.5
        nn.init.uniform_(self.att_src, -bound, bound)
        nn.init.uniform_(self.att_dst, -bound, bound)

    def single(self, sources):
        """The output for targets with exactly one incoming edge, before it is gathered."""
        return F.linear(sources, self.src.weight, self.bias)

    def forward(self, sources, targets, source, target):
        """``source`` and ``target`` list the edges' ends."""
        values = self.src(sources)
        # att·(W x) = (attᵀ W)·x spares the projection of the targets.
        score = (values @ self.att_src)[source] + (targets @ (self.att_dst @ self.dst.weight))[target]
        weight = edge_softmax(F.leaky_relu(score, 0.2), target, targets.shape[0])
        summed = values.new_zeros(targets.shape[0], values.shape[1])
        return summed.index_add(0, target, values[source] * weight[:, None]) + self.bias


def edge_softmax(score, target, count):
    """Softmax over the edges that share a target."""
    top = score.new_zeros(count).scatter_reduce(0, target, score.detach(), "amax", include_self=False)
    weight = (score - top[target]).exp()
    total = weight.new_zeros(count).index_add(0, target, weight)
    return weight / total[target]


class GraphLayer(nn.Module):
    """Mean over the edge types that end in a node type, then ReLU."""

    def __init__(self, widths, out, reverse, relu=True):
        """``widths``: node type → width of its features; without ``relu`` the mean is the output."""
        super().__init__()
        self.reverse, self.relu = reverse, relu
        for name, (source, target) in ENDS.items():
            if reverse or name not in REVERSE:
                self.add_module(name, Attention(widths[source], widths[target], out))

    def forward(self, graphs, nodes):
        state, transition, pool = (nodes[kind] for kind in NODES)
        to_state = self.transition_to_state(transition, state, _arange(transition), graphs.target)
        to_state = to_state + self.state_self.single(state)
        to_transition = self.state_to_transition.single(state)[graphs.source]
        to_transition = to_transition + self.transition_self.single(transition)
        to_pool = self.state_to_pool(state, pool, _arange(state), graphs.state_graph)
        to_pool = to_pool + self.transition_to_pool(
            transition, pool, _arange(transition), graphs.transition_graph
        )
        to_pool = to_pool + self.pool_self.single(pool)
        kinds = 2
        if self.reverse:
            kinds = 3
            to_state = to_state + self.transition_to_source(
                transition, state, _arange(transition), graphs.source
            )
            to_transition = to_transition + self.target_to_transition.single(state)[graphs.target]
        after = {"state": to_state / kinds, "transition": to_transition / kinds, "pool": to_pool / 3}
        return {kind: F.relu(x) for kind, x in after.items()} if self.relu else after


def _arange(rows):
    return torch.arange(rows.shape[0], device=rows.device)


def layers(widths, outs, reverse):
    """A stack of graph layers; ``widths`` are the input widths by node type."""
    stack = nn.ModuleList()
    for out in outs:
        stack.append(GraphLayer(widths, out, reverse))
        widths = dict.fromkeys(NODES, out)
    return stack


def mean_rows(rows, graph, count):
    """The mean row of each graph, 0 where it has none: (count, width)."""
    total = rows.new_zeros(count, rows.shape[1]).index_add(0, graph, rows)
    number = torch.bincount(graph, minlength=count).clamp(min=1)
    return total / number[:, None]


def graph_feature(graphs, nodes):
    """Means over states and transitions, and the pool node: (count, 3·width)."""
    state = mean_rows(nodes["state"], graphs.state_graph, graphs.count)
    transition = mean_rows(nodes["transition"], graphs.transition_graph, graphs.count)
    return torch.cat([state, transition, nodes["pool"]], dim=1)


def _entries(graphs, sign):
    """The (transition, channel) pairs with a literal of that sign."""
    return (graphs.transitions == sign).nonzero(as_tuple=True)


def sign_mean(graphs, rows, sign):
    """For each transition the mean of the rows (count, labels, C) of its channels of that sign: (T, C)."""
    transition, channel = _entries(graphs, sign)
    picked = rows[graphs.transition_graph[transition], channel]
    total = rows.new_zeros(graphs.transitions.shape[0], rows.shape[2]).index_add(0, transition, picked)
    number = torch.bincount(transition, minlength=total.shape[0]).clamp(min=1)
    return total / number[:, None]


def region_form(graphs, rows, sign):
    """For each channel the mean of the transitions' rows (T, C) with that sign: (count, labels, C)."""
    labels = graphs.transitions.shape[1]
    transition, channel = _entries(graphs, sign)
    slot = graphs.transition_graph[transition] * labels + channel
    total = rows.new_zeros(graphs.count * labels, rows.shape[1]).index_add(0, slot, rows[transition])
    number = torch.bincount(slot, minlength=total.shape[0]).clamp(min=1)
    return (total / number[:, None]).view(graphs.count, labels, -1)
