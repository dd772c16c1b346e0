"""Our graph layers against PyTorch Geometric's."""

import pytest
import torch

from nngtl_training import graph as gr

pyg = pytest.importorskip("torch_geometric.nn")


def random_graphs(generator, sizes=((5, 9), (3, 1), (4, 0), (2, 6)), labels=3):
    """A batch in which some states have no incoming transition and one graph has none at all."""
    draw = lambda high, n: torch.randint(high, (n,), generator=generator)
    states = sum(s for s, _ in sizes)
    source, target, owner, first = [], [], [], 0
    for g, (s, t) in enumerate(sizes):
        source.append(first + draw(s, t))
        target.append(first + draw(s, t))
        owner += [g] * t
        first += s
    return gr.Graphs(
        torch.randn(states, 3, generator=generator),
        torch.randint(-1, 2, (len(owner), labels), generator=generator).float(),
        torch.cat(source),
        torch.cat(target),
        torch.repeat_interleave(torch.arange(len(sizes)), torch.tensor([s for s, _ in sizes])),
        torch.tensor(owner),
        len(sizes),
    )


def edges(graphs):
    """Edge type → (2, E), all written out."""
    states, transitions = (torch.arange(len(x)) for x in (graphs.states, graphs.transitions))
    pools = torch.arange(graphs.count)
    return {
        "state_to_transition": (graphs.source, transitions),
        "transition_to_state": (transitions, graphs.target),
        "state_self": (states, states),
        "transition_self": (transitions, transitions),
        "pool_self": (pools, pools),
        "state_to_pool": (states, graphs.state_graph),
        "transition_to_pool": (transitions, graphs.transition_graph),
        "target_to_transition": (graphs.target, transitions),
        "transition_to_source": (transitions, graphs.source),
    }


def reference(layer, widths):
    """The HeteroConv with our layer's weights."""
    convs = {}
    for name, part in layer.named_children():
        source, target = gr.ENDS[name]
        conv = pyg.GATConv((widths[source], widths[target]), part.bias.shape[0], add_self_loops=False)
        conv.lin_src.weight.data = part.src.weight.data
        conv.lin_dst.weight.data = part.dst.weight.data
        conv.att_src.data = part.att_src.data.view(1, 1, -1)
        conv.att_dst.data = part.att_dst.data.view(1, 1, -1)
        conv.bias.data = part.bias.data
        convs[source, name, target] = conv
    return pyg.HeteroConv(convs, aggr="mean")


@pytest.mark.parametrize("reverse", [False, True])
def test_layers_equal_torch_geometric(reverse):
    generator = torch.Generator().manual_seed(4)
    torch.manual_seed(4)
    graphs = random_graphs(generator)
    nodes = {"state": graphs.states, "transition": graphs.transitions, "pool": graphs.pool_input()}
    widths = {"state": 3, "transition": 3, "pool": gr.POOL_WIDTH}
    lists = edges(graphs)
    for layer in gr.layers(widths, [6, 5], reverse):
        for parameter in layer.parameters():
            torch.nn.init.normal_(parameter, std=0.5)
        listed = {
            (*gr.ENDS[name][:1], name, gr.ENDS[name][1]): torch.stack(lists[name]) for name, _ in layer.named_children()
        }
        expected = {k: v.relu() for k, v in reference(layer, widths)(nodes, listed).items()}
        found = layer(graphs, nodes)
        for kind in gr.NODES:
            torch.testing.assert_close(found[kind], expected[kind], rtol=1e-5, atol=1e-6)
        nodes, widths = found, dict.fromkeys(gr.NODES, found["state"].shape[1])


def test_gradients_reach_every_attention_that_can_act():
    generator = torch.Generator().manual_seed(5)
    graphs = random_graphs(generator)
    nodes = {"state": graphs.states, "transition": graphs.transitions, "pool": graphs.pool_input()}
    layer = gr.layers({"state": 3, "transition": 3, "pool": gr.POOL_WIDTH}, [6], True)[0]
    sum(v.square().sum() for v in layer(graphs, nodes).values()).backward()
    for name in ("transition_to_state", "transition_to_source", "state_to_pool", "transition_to_pool"):
        part = getattr(layer, name)
        assert part.att_src.grad.abs().sum() > 0, name
    assert layer.state_to_transition.att_src.grad is None


def test_sign_means_by_hand():
    graphs = gr.Graphs(
        torch.zeros(1, 3),
        torch.tensor([[1.0, 1, -1], [0, 0, 0], [1, 0, 0]]),
        torch.zeros(3, dtype=torch.long),
        torch.zeros(3, dtype=torch.long),
        torch.zeros(1, dtype=torch.long),
        torch.zeros(3, dtype=torch.long),
        1,
    )
    regions = torch.tensor([[[2.0], [4.0], [8.0]]])
    assert gr.sign_mean(graphs, regions, 1).tolist() == [[3.0], [0.0], [2.0]]
    assert gr.sign_mean(graphs, regions, -1).tolist() == [[8.0], [0.0], [0.0]]
    transitions = torch.tensor([[1.0], [10.0], [5.0]])
    assert gr.region_form(graphs, transitions, 1).tolist() == [[[3.0], [1.0], [0.0]]]
    assert gr.region_form(graphs, transitions, -1).tolist() == [[[0.0], [0.0], [1.0]]]


def test_mean_rows_of_a_graph_without_rows_is_zero():
    rows = gr.mean_rows(torch.tensor([[1.0], [3.0]]), torch.tensor([1, 1]), 3)
    assert rows.tolist() == [[0.0], [2.0], [0.0]]
