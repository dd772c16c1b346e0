"""Checkpoints of the published networks give the same outputs as weight files, and faulty ones are refused whole."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file

pytest.importorskip("torch_geometric", reason="the published networks are rebuilt with it")

import published  # noqa: E402
from nngtl_training import convert, export, goldens  # noqa: E402
from nngtl_training.graph import Graphs  # noqa: E402

TOLERANCE = 1e-4
SMALL = {"blocks": (1, 2, 1, 1), "resolution": 48}
FOLDER = Path(__file__).parents[2] / "tests" / "goldens" / "models"


def random_batch(rng, labels, side, count=2):
    """Random maps and automata: (raster, graphs)."""
    raster = np.zeros((count, 1 + labels, side, side), dtype=np.float32)
    for picture in raster:
        for channel in (*range(1 + labels), 0, 0):
            x, y = rng.integers(0, side - 3, 2)
            w, h = rng.integers(2, max(3, side // 4), 2)
            picture[channel, x : x + w, y : y + h] = 1
        picture[0, rng.integers(side), rng.integers(side)] = -1
    lists = [], [], [], [], [], []
    offset = 0
    for graph in range(count):
        states, transitions = rng.integers(1, 9), rng.integers(1, 20)
        features = np.concatenate([rng.integers(0, 2, (states, 2)), rng.uniform(-1, 1, (states, 1))], axis=1)
        ends = offset + rng.integers(0, states, (2, transitions))
        rows = (features, rng.integers(-1, 2, (transitions, labels)), *ends, [graph] * states, [graph] * transitions)
        for all_rows, own in zip(lists, rows):
            all_rows.append(np.asarray(own))
        offset += states
    tensors = [torch.from_numpy(np.concatenate(rows)) for rows in lists]
    return torch.from_numpy(raster), Graphs(tensors[0].float(), tensors[1].float(), *tensors[2:], count)


def largest_difference(network, model, labels, side, number, seed):
    """Of probabilities, over several random inputs; the outputs must not be all the same."""
    rng = np.random.default_rng(seed)
    off, seen = 0.0, []
    for _ in range(number):
        raster, graphs = random_batch(rng, labels, side)
        expected = published.probabilities(network, raster, graphs)
        with torch.no_grad():
            logits = model(raster, graphs)
        found = torch.sigmoid(logits if logits.dim() == 3 else logits[:, -1])
        assert found.shape == expected.shape
        seen.append(expected.flatten())
        off = max(off, (found - expected).abs().max().item())
    seen = torch.cat(seen)
    assert seen.std() > 0.05 and 0.01 < seen.median() < 0.99
    return off


def made(network, labels, side, seed=1):
    return published.initialise(network, *random_batch(np.random.default_rng(seed), labels, side), seed)


@pytest.fixture(scope="module")
def pathnet():
    return made(published.PathNet(2, 3, (4, 6, 5, 4, 3), side=1), 3, 40)


@pytest.fixture(scope="module")
def statenet():
    network = published.StateNet(3, (4, 4, 6, 8), SMALL["blocks"], feature=6, first=7, graph=(8, 8, 6, 6, 5))
    return made(network, 3, SMALL["resolution"])


@pytest.mark.parametrize("n1, labels", [(1, 7), (2, 5)])
def test_pathnet_agrees_at_published_widths(tmp_path, n1, labels):
    network = made(published.PathNet(n1, labels), labels, 200)
    checkpoint = tmp_path / "LTL_Net.pth"
    torch.save(network.state_dict(), checkpoint)
    convert.convert_files([checkpoint], tmp_path)
    model, record = export.read(tmp_path / "pathnet.safetensors")
    config = model.config
    assert (config["n1"], config["labels"], config["resolution"], config["skip"]) == (n1, labels, 200, "none")
    assert record["converted_from"]["file"] == "LTL_Net.pth"
    off = largest_difference(network, model, labels, 200, 3, seed=n1)
    print(f"n1 = {n1}: off by {off:.1e}")
    assert off < TOLERANCE


def test_statenet_agrees_at_published_widths(tmp_path):
    network = made(published.StateNet(7), 7, 200)
    checkpoint = tmp_path / "BA_Predict.pth"
    torch.save({"epoch": 3, "best_loss": 0.5, "model_state_dict": network.state_dict()}, checkpoint)
    convert.convert_files([checkpoint], tmp_path)
    model, _ = export.read(tmp_path / "statenet.safetensors")
    assert model.config["trunk_widths"] == [64, 128, 256, 512] and model.config["graph"] == [128, 256, 512, 256, 128]
    off = largest_difference(network, model, 7, 200, 2, seed=5)
    print(f"off by {off:.1e}")
    assert off < TOLERANCE


def test_small_networks_agree_on_many_inputs(pathnet, statenet):
    assert largest_difference(pathnet, convert.convert(pathnet.state_dict()).model, 3, 40, 10, seed=2) < TOLERANCE
    conversion = convert.convert(statenet.state_dict(), **SMALL)
    assert largest_difference(statenet, conversion.model, 3, 48, 10, seed=3) < TOLERANCE


def test_what_the_comparison_would_notice(statenet):
    """A ReLU after StateNet's first layer, which the published code lacks, is far outside the tolerance."""
    model = convert.convert(statenet.state_dict(), **SMALL).model
    model.first.relu = True
    assert largest_difference(statenet, model, 3, 48, 3, seed=3) > 10 * TOLERANCE


def test_names_of_older_releases(tmp_path, pathnet):
    """Up to PyTorch Geometric 2.3: other spelling of edge types, loops without a second projection, and lazily so."""
    state = {}
    for name, value in pathnet.state_dict().items():
        loop = "self_loop" in name and name.endswith("lin_dst.weight")
        name = name.replace("<", "").replace(">", "").replace("___", "__")
        state[name] = torch.nn.parameter.UninitializedParameter() if loop else value
    torch.save(state, tmp_path / "old.pth")
    conversion = convert.convert(convert.load(tmp_path / "old.pth"))
    expected = convert.convert(pathnet.state_dict()).model.state_dict()
    for name, value in conversion.model.state_dict().items():
        assert torch.equal(value, expected[name]), name
    without = {name: value for name, value in state.items() if not torch.nn.parameter.is_lazy(value)}
    assert len(without) == len(state) - 15
    convert.convert(without)
    # Lazy where values are needed: the network never ran.
    lazy = next(name for name in state if name.endswith("node__connect__edge.lin_src.weight"))
    state[lazy] = torch.nn.parameter.UninitializedParameter()
    assert faults(state) == [f"{lazy} was never initialised: run the network once before saving it"]


def test_tensors_that_are_not_read(pathnet):
    state = pathnet.state_dict()
    unread = convert.convert(state).unread
    projections = {f"fusion_net.project_gnn{k}.{part}" for k in range(1, 5) for part in ("weight", "bias")}
    counters = {name for name in state if name.endswith("num_batches_tracked")}
    loops = {name for name in state if "self_loop" in name and name.endswith("lin_dst.weight")}
    assert set(unread) == projections | counters | loops and len(counters) == 10 and len(loops) == 15
    # They may be garbage or absent: nothing depends on them.
    rest = {name: value for name, value in state.items() if name not in unread}
    first = convert.convert(rest)
    second = convert.convert({**rest, **{name: torch.full((2,), float("nan")) for name in unread}})
    assert first.unread == {}
    for name, value in first.model.state_dict().items():
        assert torch.equal(value, second.model.state_dict()[name]), name


def test_half_and_double_precision(pathnet):
    half = {name: value.half() if value.is_floating_point() else value for name, value in pathnet.state_dict().items()}
    for value in convert.convert(half).model.state_dict().values():
        assert value.dtype in (torch.float32, torch.int64)
    double = {name: value.double() if value.is_floating_point() else value for name, value in pathnet.state_dict().items()}
    model = convert.convert(double).model
    assert largest_difference(pathnet, model, 3, 40, 1, seed=4) < TOLERANCE
    double["path_predict.Conv6.bias"] = torch.tensor([1e300], dtype=torch.float64)
    assert faults(double) == ["path_predict.Conv6.bias holds values that are not finite"]


def faults(state, **options):
    with pytest.raises(convert.CheckpointError) as error:
        convert.convert(state, **options)
    return error.value.faults


def test_every_fault_is_named(pathnet):
    state = dict(pathnet.state_dict())
    del state["map_encoder.Conv1.conv.0.weight"]
    del state["ba_encoder.gnn3.convs.<edge___connect___node>.att_dst"]
    state["fusion_net.project_gnn5.weight"] = state["fusion_net.project_gnn5.weight"][:-1]
    state["path_predict.Up5.up.0.weight"] = state["path_predict.Up5.up.0.weight"].transpose(0, 1)
    state["path_predict.Up1.up.1.running_var"] = torch.full((2,), -1.0)
    state["map_encoder.Conv2.conv.0.bias"] = torch.tensor([0.0, float("nan"), 0.0, 0.0])
    state["path_predict.Conv6.bias"] = torch.tensor([3])
    state["path_predict.Conv6.weight"] = state["path_predict.Conv6.weight"].to_sparse()
    state["path_predict.Up6.up.0.weight"] = torch.zeros(1)
    state["image_feature_extractor.fc.bias"] = torch.zeros(1)
    assert sorted(faults(state)) == sorted(
        [
            "map_encoder.Conv1.conv.0.weight is missing, expected shape 2×4×4×4",
            "ba_encoder.gnn3.convs.<edge___connect___node>.att_dst is missing, expected shape 1×1×5",
            "fusion_net.project_gnn5.weight has shape 31×9, expected 32×9",
            "path_predict.Up5.up.0.weight has shape 32×64×4×4, expected 64×32×4×4",
            "path_predict.Up1.up.1.running_var holds negative variances",
            "map_encoder.Conv2.conv.0.bias holds values that are not finite",
            "path_predict.Conv6.bias holds int64, expected floating-point numbers",
            "path_predict.Conv6.weight is sparse, expected a dense tensor",
            "path_predict.Up6.up.0.weight is unknown",
            "image_feature_extractor.fc.bias is unknown",
        ]
    )


def test_one_wrong_size_is_told_as_one_fault(pathnet, statenet):
    """Sizes are what most tensors say, so that the odd one out is named and not all others."""
    for network, options in ((pathnet, {}), (statenet, SMALL)):
        state = network.state_dict()
        unread = convert.convert(state, **options).unread
        for name, value in state.items():
            if name in unread:
                continue
            wrong = torch.zeros([*value.shape[:-1], value.shape[-1] + 1])
            told = faults({**state, name: wrong}, **options)
            assert len(told) == 1 and told[0].startswith(f"{name} has shape "), told
            told = faults({key: kept for key, kept in state.items() if key != name}, **options)
            assert len(told) == 1 and told[0].startswith(f"{name} is missing, expected shape "), told
            assert told[0].endswith("×".join(map(str, value.shape))), told


def test_another_trunk_is_refused(statenet):
    """The published one is ResNet-50; this one lacks nine blocks of 15 tensors."""
    told = faults(statenet.state_dict())
    assert len(told) == 11 * 15 and all(".resnet." in fault and "is missing" in fault for fault in told)


def test_other_networks(pathnet):
    assert "begin with ba_encoder." in faults({"conv1.weight": torch.zeros(3)})[0]
    # Only a few of the names: all others are told, with the published sizes where none is left to tell.
    told = faults({"map_encoder.Conv1.conv.0.bias": torch.zeros(64)})
    assert "map_encoder.Conv1.conv.0.weight is missing, expected shape 64×8×4×4" in told
    assert len(told) == len(convert._pathnet({})[1].shapes) - 1


class Runs:
    """What a hostile pickle could hold."""

    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return Path.write_text, (self.mark, "ran")


def test_files_that_are_no_checkpoint(tmp_path, pathnet):
    mark = tmp_path / "mark"
    state = pathnet.state_dict()
    cases = {
        "text": (lambda p: p.write_text("hello"), "cannot be read|not a checkpoint"),
        "empty": (lambda p: p.write_bytes(b""), "cannot be read"),
        "object": (lambda p: torch.save({**state, "extra": Runs(mark)}, p), "could run code"),
        "network": (lambda p: torch.save(pathnet, p), "could run code"),
        "tensor": (lambda p: torch.save(torch.zeros(3), p), "holds a Tensor, expected a state dictionary"),
        "list": (lambda p: torch.save([torch.zeros(3)], p), "holds a list"),
        "nothing": (lambda p: torch.save({}, p), "holds a dict"),
        "mixed": (lambda p: torch.save({**state, "step": 3}, p), "'step' is a int, expected a tensor"),
        "number": (lambda p: torch.save({**state, 3: torch.zeros(1)}, p), "3 is a Tensor, expected|3 is a"),
        "legacy": (lambda p: torch.save({"a.b": torch.zeros(1)}, p, _use_new_zipfile_serialization=False), "a.b is unknown"),
    }
    for name, (write, pattern) in cases.items():
        path = tmp_path / f"{name}.pth"
        write(path)
        with pytest.raises(convert.CheckpointError, match=pattern):
            convert.convert_files([path], tmp_path / "out")
    whole = tmp_path / "whole.pth"
    torch.save(state, whole)
    data = whole.read_bytes()
    for share in (0.2, 0.9, 0.999):
        (tmp_path / "cut.pth").write_bytes(data[: int(share * len(data))])
        with pytest.raises(convert.CheckpointError, match="cannot be read|not a checkpoint"):
            convert.convert_files([tmp_path / "cut.pth"], tmp_path / "out")
    with pytest.raises(convert.CheckpointError, match="is no file"):
        convert.convert_files([tmp_path / "absent.pth"], tmp_path / "out")
    assert not mark.exists() and not (tmp_path / "out").exists()


def test_legacy_format(tmp_path, pathnet):
    torch.save(pathnet.state_dict(), tmp_path / "old.pth", _use_new_zipfile_serialization=False)
    assert convert.convert(convert.load(tmp_path / "old.pth")).model.config["n1"] == 2


def test_all_or_nothing(tmp_path, pathnet, monkeypatch):
    good, bad, out = tmp_path / "good.pth", tmp_path / "bad.pth", tmp_path / "out"
    torch.save(pathnet.state_dict(), good)
    torch.save({**pathnet.state_dict(), "x": torch.zeros(1)}, bad)
    with pytest.raises(convert.CheckpointError, match="bad.pth: x is unknown"):
        convert.convert_files([good, bad], out)
    with pytest.raises(convert.CheckpointError, match="both a pathnet"):
        convert.convert_files([good, good], out)
    assert not out.exists()

    # A disk that fills up leaves what stood there before.
    convert.convert_files([good], out)
    before = (out / "pathnet.safetensors").read_bytes()

    def full(path, data):
        with open(path, "wb") as file:
            file.write(data[:100])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError):
        convert.convert_files([good], out)
    monkeypatch.undo()
    assert [path.name for path in out.iterdir()] == ["pathnet.safetensors"]
    assert (out / "pathnet.safetensors").read_bytes() == before


def test_command_line(tmp_path, pathnet):
    script = Path(__file__).parents[1] / "convert_checkpoint.py"
    run = lambda *words: subprocess.run([sys.executable, script, *words], capture_output=True, text=True)  # noqa: E731
    good, out = tmp_path / "good.pth", tmp_path / "models"
    torch.save(pathnet.state_dict(), good)
    done = run(good, "--out", out)
    assert done.returncode == 0, done.stderr
    assert "pathnet, n1 = 2, 3 labels, 40 cells a side" in done.stdout
    assert "fusion_net.project_gnn1.weight: nothing reads" in done.stdout
    with safe_open(out / "pathnet.safetensors", "pt") as file:
        config = json.loads(file.metadata()["config"])
    assert config["fusion"] == "dense" and config["graph"] == [4, 6, 5, 4, 3] and config["format"] == export.FORMAT
    torch.save({**pathnet.state_dict(), "x": torch.zeros(1), "y": torch.zeros(1)}, good)
    failed = run(good, "--out", tmp_path / "none")
    assert failed.returncode == 2 and not (tmp_path / "none").exists()
    assert "nothing is written:\n  x is unknown\n  y is unknown" in failed.stderr


@pytest.mark.parametrize("name", published.GOLDENS)
def test_committed_goldens(name):
    """They are what the published forward pass gives, and the committed weights give the same."""
    network, raster, graphs, conversion = published.golden(name)
    committed, _ = export.read(FOLDER / f"{name}.safetensors")
    assert committed.config == conversion.model.config
    for key, value in conversion.model.state_dict().items():
        torch.testing.assert_close(committed.state_dict()[key], value, rtol=1e-6, atol=1e-6)
    expected = load_file(FOLDER / f"{name}.io.safetensors")["output"]
    assert expected.std() > 1e-2
    found = published.probabilities(network, raster, graphs)
    torch.testing.assert_close(found[0] if found.dim() == 3 else found, expected, rtol=1e-5, atol=1e-6)
    torch.testing.assert_close(goldens.output(committed, raster, graphs), expected, rtol=0, atol=1e-5)
