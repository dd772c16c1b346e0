"""The loop: learning, exact resume, export, hand-over."""

import csv
import gzip
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open

import synthetic

from nngtl_training import batches, configs, data, evaluate, export, metrics, models, train

SMALL = {
    "pathnet": ["network.widths=[4,8,8]", "network.graph=[8,8]", "network.embedding=3", "network.top=4"],
    "statenet": ["network.graph=[16,16,16,16]", "network.head=16"],
}
RASTER = {**SMALL, "statenet": [*SMALL["statenet"], "network.widths=[4,8,8]"]}


def small(kind, *changes):
    return configs.get("compact", kind, [*SMALL[kind], "training.batch=8", "training.warm_up=2", *changes])


def begin(config, folder, cls=train.Run):
    return cls(config, data.load(folder, config["network"]), seed=1)


@pytest.mark.parametrize("kind", ["pathnet", "statenet"])
def test_a_resumed_run_equals_one_that_never_stopped(kind, data_set, tmp_path):
    config = small(kind)
    whole = begin(config, data_set[0])
    for step in range(6):
        whole.train_step(step / 6)
    half = begin(config, data_set[0])
    for step in range(3):
        half.train_step(step / 6)
    half.save(tmp_path / "checkpoint.pt")
    resumed = begin(config, data_set[0])
    resumed.restore(tmp_path / "checkpoint.pt")
    for step in range(3, 6):
        resumed.train_step(step / 6)
    for name, value in whole.model.state_dict().items():
        assert torch.equal(value, resumed.model.state_dict()[name]), name


def test_batches_made_ahead_change_nothing(data_set, tmp_path):
    config = small("pathnet")
    plain, early, resumed = (begin(config, data_set[0]) for _ in range(3))
    early.early = resumed.early = True
    losses = [plain.train_step(step / 4) for step in range(4)]
    assert [early.train_step(step / 4) for step in range(2)] == losses[:2]
    early.save(tmp_path / "checkpoint.pt")
    resumed.train_step(0)  # what it has made ahead is for a step that it then never takes
    resumed.restore(tmp_path / "checkpoint.pt")
    for run in (early, resumed):
        assert [run.train_step(step / 4) for step in range(2, 4)] == losses[2:]


def test_dropout_resumes_exactly_too(data_set, tmp_path):
    config = configs.get("paper", "pathnet", ["network.n1=1", "network.resolution=100", "network.graph=[4,4,4,4,4]", "training.batch=4"])
    runs = [begin(config, data_set[0]) for _ in range(2)]
    runs[0].train_step(0)
    runs[0].save(tmp_path / "checkpoint.pt")
    runs[1].restore(tmp_path / "checkpoint.pt")
    torch.rand(5)  # a generator that has moved on must not matter
    assert runs[0].train_step(0.5) == runs[1].train_step(0.5)


def test_a_checkpoint_of_another_configuration_is_refused(data_set, tmp_path):
    begin(small("pathnet"), data_set[0]).save(tmp_path / "checkpoint.pt")
    with pytest.raises(SystemExit, match="another configuration"):
        begin(small("pathnet", "network.embedding=4"), data_set[0]).restore(tmp_path / "checkpoint.pt")


def test_the_state_network_learns_its_training_set(data_set):
    run = begin(small("statenet", "training.symmetries=false", "training.jitter=0", "training.permute=0"), data_set[0])
    before = metrics.evaluate(run.model, run.missions)["all"]
    for step in range(150):
        run.train_step(0.3)
    after = metrics.evaluate(run.model, run.missions)["all"]
    assert after["ap"] > 0.9 and after["loss"] < 0.6 * before["loss"]


def test_the_command_trains_continues_and_exports(data_set, tmp_path, capsys):
    folder, out = str(data_set[0]), tmp_path / "run"
    base = ["pathnet", "--data", folder, "--held-out", folder, "--out", str(out), "--device", "cpu"]
    for change in [*SMALL["pathnet"], "training.batch=4"]:
        base += ["--set", change]
    train.main([*base, "--steps", "2"])
    train.main([*base, "--steps", "3"])
    assert "continuing at step 2" in capsys.readouterr().out
    record = json.loads((out / "record.json").read_text())
    assert record["steps"] == 3 and record["held_out"]["all"]["missions"] > 0
    model, exported = export.read(out / "pathnet.safetensors")
    assert exported == record
    export.main([str(out), str(tmp_path / "models" / "p.safetensors"), "--power", "4"])
    with safe_open(tmp_path / "models" / "p.safetensors", "pt") as file:
        assert json.loads(file.metadata()["config"])["power"] == 4


def test_a_run_ends_with_its_minutes_and_keeps_to_its_families(made_by_nngtl, tmp_path):
    out = tmp_path / "run"
    base = ["statenet", "--data", str(made_by_nngtl[0]), "--out", str(out), "--device", "cpu", "--families", "mazes"]
    for change in [*SMALL["statenet"], "training.batch=4"]:
        base += ["--set", change]
    train.main([*base, "--minutes", "0.02"])
    record = json.loads((out / "record.json").read_text())
    assert record["steps"] >= 1 and set(record["families"]) == {"mazes"}
    train.main([*base, "--minutes", "0.02"])  # nothing is left to do
    assert json.loads((out / "record.json").read_text())["steps"] <= record["steps"] + 1


def test_a_given_trunk_stands_still_for_its_first_epochs(data_set, tmp_path):
    """IV-D: the ImageNet trunk is frozen first, and trained with the rest then."""
    names = ["network.trunk_widths=[2,2,4,4]", "network.trunk_blocks=[1,1,1,1]", "network.map_feature=8", "network.graph=[8,8]", "network.first=4"]
    changes = [*names, "training.batch=4", "training.frozen_epochs=1", "training.precision=f32"]
    torch.manual_seed(5)
    given = models.build(configs.get("paper", "statenet", names)["network"]).trunk.state_dict()
    torch.save(given, tmp_path / "trunk.pt")
    base = ["statenet", "--config", "paper", "--data", str(data_set[0]), "--out", str(tmp_path / "run"), "--device", "cpu", "--trunk", str(tmp_path / "trunk.pt")]
    for change in changes:
        base += ["--set", change]

    def moved():
        model, record = export.read(tmp_path / "run" / "statenet.safetensors")
        assert record["trunk"] == "trunk.pt"
        state = model.trunk.state_dict()
        return any(not torch.equal(state[name], value) for name, value in given.items())

    train.main([*base, "--steps", "2"])
    assert not moved()
    # An epoch passes each mission seven times (IV-D, augmentation).
    run = begin(configs.get("paper", "statenet", changes), data_set[0])
    assert run.passes == 7 * len(run.missions)
    train.main([*base, "--steps", str(run.passes // 4 - 1)])
    assert not moved()
    train.main([*base, "--steps", str(run.passes // 4 + 3)])
    assert moved()


TEAM_STEPS = 6


def two_processes(folder, out, *program):
    """Runs ``program`` under ``torchrun`` with the command line of a small training run."""
    options = [word for change in [*SMALL["statenet"], "training.batch=8", "training.warm_up=2"] for word in ("--set", change)]
    team = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2", *program]
    run = ["statenet", "--data", str(folder), "--out", str(out), "--steps", str(TEAM_STEPS), "--seed", "1", "--device", "cpu"]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(Path(train.__file__).parents[1])}
    return subprocess.run([*team, *run, *options, "--save-minutes", "0"], timeout=300, env=environment, capture_output=True, text=True)


def saved(folder):
    return torch.load(folder / "checkpoint.pt", weights_only=False)


@pytest.fixture(scope="module")
def team_run(data_set, tmp_path_factory):
    """The folder of a run by two processes that nothing interrupted."""
    out = tmp_path_factory.mktemp("team")
    done = two_processes(data_set[0], out, "-m", "nngtl_training.train")
    assert done.returncode == 0, done.stderr
    return out


def test_two_processes_train_as_one_does(data_set, team_run):
    """Under ``torchrun`` the batch is shared out and gradients are averaged; batch statistics are each process's own."""
    config = small("statenet")
    alone = begin(config, data_set[0])
    before = {name: value.clone() for name, value in alone.model.named_parameters()}
    for step in range(TEAM_STEPS):
        alone.train_step(step / TEAM_STEPS)
    assert saved(team_run)["step"] == TEAM_STEPS
    assert (team_run / "statenet.safetensors").is_file()
    moves = [
        torch.cat([(model[name] - start).flatten() for name, start in before.items()])
        for model in (dict(alone.model.named_parameters()), saved(team_run)["model"])
    ]
    alike = torch.cosine_similarity(*moves, dim=0)
    assert alike > 0.3, alike


def test_two_processes_that_were_killed_go_on_where_they_were(data_set, team_run, tmp_path):
    done = two_processes(data_set[0], tmp_path, str(Path(__file__).with_name("killed.py")), "4")
    assert done.returncode != 0 and "SIGKILL" in done.stderr
    # One process may have been ended while the other had not saved the last step yet.
    at = saved(tmp_path)["step"]
    assert at in (3, 4) and not (tmp_path / "statenet.safetensors").exists()
    done = two_processes(data_set[0], tmp_path, "-m", "nngtl_training.train")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count(f"continuing at step {at}") == 2
    whole, resumed = saved(team_run), saved(tmp_path)
    assert whole["step"] == resumed["step"] == TEAM_STEPS
    for name, value in whole["model"].items():
        assert torch.equal(value, resumed["model"][name]), name


def test_a_path_network_starts_from_the_graph_layers_of_a_state_network(data_set, tmp_path, capsys):
    base = lambda kind, name: [kind, "--data", str(data_set[0]), "--device", "cpu", "--out", str(tmp_path / name)]
    words = lambda changes: [word for change in changes for word in ("--set", change)]
    same = words(["network.graph=[8,8,8]", "training.batch=4", "training.weight_decay=0"])
    train.main([*base("statenet", "states"), *words(SMALL["statenet"]), *same, "--steps", "1"])
    file = tmp_path / "states" / "statenet.safetensors"
    # A step that changes nothing but the norms' statistics.
    still = ["--set", "training.rate=0", "--steps", "1", "--statenet", str(file)]
    train.main([*base("pathnet", "paths"), *words(SMALL["pathnet"]), *same, *still])
    # The first layers read different features; the others agree.
    handed = ["graph.1 -> graph.1", "graph.2 -> graph.2"]
    assert f"layers handed over: {handed}" in capsys.readouterr().out
    giver, _ = export.read(file)
    taker, record = export.read(tmp_path / "paths" / "pathnet.safetensors")
    assert record["handed"] == handed
    for layer in (1, 2):
        for name, value in giver.graph[layer].state_dict().items():
            assert torch.equal(value, taker.graph[layer].state_dict()[name]), name


def test_tensorboard_is_given_what_the_log_holds(data_set, tmp_path):
    pytest.importorskip("tensorboard", reason="tensorboard is not installed")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    out = tmp_path / "run"
    base = ["statenet", "--data", str(data_set[0]), "--held-out", str(data_set[0]), "--out", str(out), "--device", "cpu", "--steps", "2"]
    for change in [*SMALL["statenet"], "training.batch=4"]:
        base += ["--set", change]
    train.main([*base, "--tensorboard"])
    events = EventAccumulator(str(out)).Reload()
    with open(out / "log.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert "held-out ap" in {row["name"] for row in rows}
    # Event names know no blanks.
    seen = {name.replace("_", " "): events.Scalars(name)[0] for name in events.Tags()["scalars"]}
    assert set(seen) == {row["name"] for row in rows}
    for row in rows:
        event = seen[row["name"]]
        assert event.step == int(row["step"]) and event.value == pytest.approx(float(row["value"]), rel=1e-4)


def test_a_run_begins_from_a_weight_file(data_set, tmp_path):
    folder = str(data_set[0])
    base = ["pathnet", "--data", folder, "--device", "cpu"]
    for change in [*SMALL["pathnet"], "training.batch=4", "training.weight_decay=0"]:
        base += ["--set", change]
    train.main([*base, "--out", str(tmp_path / "one"), "--steps", "2"])
    file = tmp_path / "one" / "pathnet.safetensors"
    # Another target, and a step that changes nothing but the norms' statistics.
    change = ["--set", "training.spread=null", "--set", "training.rate=0"]
    train.main([*base, *change, "--out", str(tmp_path / "two"), "--begin", str(file), "--steps", "1"])
    given, _ = export.read(file)
    found, record = export.read(tmp_path / "two" / "pathnet.safetensors")
    for (name, a), (_, b) in zip(given.named_parameters(), found.named_parameters()):
        assert torch.equal(a, b), name
    assert record["began"] == hashlib.sha256(file.read_bytes()).hexdigest()


@pytest.mark.parametrize("name", ["compact", "raster", "paper"])
@pytest.mark.parametrize("kind", ["pathnet", "statenet"])
def test_an_exported_model_computes_what_it_did(name, kind, data_set, tmp_path):
    changes = {
        ("compact", "pathnet"): SMALL["pathnet"],
        ("compact", "statenet"): SMALL["statenet"],
        ("raster", "pathnet"): RASTER["pathnet"],
        ("raster", "statenet"): RASTER["statenet"],
        ("paper", "pathnet"): ["network.n1=1"],
        ("paper", "statenet"): ["network.trunk_widths=[2,2,4,4]", "network.trunk_blocks=[1,1,1,1]", "network.map_feature=8", "network.graph=[8,8]", "network.first=4"],
    }[name, kind]
    torch.manual_seed(0)
    config = configs.get(name, kind, changes)["network"]
    model = models.build(config)
    missions = data.load(data_set[0], config)
    batch = batches.make(missions, np.arange(5))
    model.train()(batch.raster, batch.graphs)  # moves the running statistics
    export.write(tmp_path / "x.safetensors", model, {"steps": 0})
    again, record = export.read(tmp_path / "x.safetensors")
    assert record == {"steps": 0}
    with torch.no_grad():
        assert torch.equal(model.eval()(batch.raster, batch.graphs), again(batch.raster, batch.graphs))


@pytest.mark.parametrize("name", ["compact", "raster", "paper"])
@pytest.mark.parametrize("kind", ["pathnet", "statenet"])
def test_mixed_precision_learns_what_single_precision_does(name, kind, data_set):
    changes = {
        ("compact", "pathnet"): SMALL["pathnet"],
        ("compact", "statenet"): SMALL["statenet"],
        ("raster", "pathnet"): RASTER["pathnet"],
        ("raster", "statenet"): RASTER["statenet"],
        ("paper", "pathnet"): ["network.n1=2", "network.resolution=100", "network.graph=[8,8,8]"],
        ("paper", "statenet"): ["network.trunk_widths=[2,2,4,4]", "network.trunk_blocks=[1,1,1,1]", "network.map_feature=8", "network.graph=[8,8]", "network.first=4"],
    }[name, kind]
    changes = [*changes, "training.batch=8", "training.precision=%s"]
    losses = {}
    for precision in ("f32", "bf16"):
        run = begin(configs.get(name, kind, [change.replace("%s", precision) for change in changes]), data_set[0])
        assert run.half == (precision == "bf16")
        losses[precision] = [run.train_step(step / 4) for step in range(4)]
    assert np.allclose(losses["f32"], losses["bf16"], rtol=0.05), losses


def test_a_set_that_the_program_made_is_learned_from(made_by_nngtl):
    for kind in ("pathnet", "statenet"):
        run = begin(small(kind), made_by_nngtl[0])
        assert len(run.missions) > 8
        assert np.isfinite([run.train_step(step / 4) for step in range(4)]).all()


def test_the_same_weights_give_the_same_bytes(tmp_path):
    model = models.build(small("statenet")["network"])
    files = [tmp_path / str(k) for k in range(4)]
    for file in files:
        export.write(file, model, {"seed": 1, "steps": 2}, {"power": 2})
    assert len({file.read_bytes() for file in files}) == 1


def test_a_changed_weight_file_is_refused(tmp_path):
    config = small("statenet")["network"]
    path = tmp_path / "x.safetensors"
    export.write(path, models.build(config))
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    with pytest.raises(ValueError, match="digest"):
        export.read(path)


def test_a_batch_gives_what_its_missions_give_alone(data_set):
    for kind in ("pathnet", "statenet"):
        torch.manual_seed(2)
        config = small(kind)["network"]
        model = models.build(config).eval()
        missions = data.load(data_set[0], config)
        with torch.no_grad():
            together = batches.make(missions, np.arange(4))
            whole = model(together.raster, together.graphs)
            alone = []
            for k in range(4):
                single = batches.make(missions, np.array([k]))
                alone.append(model(single.raster, single.graphs))
        torch.testing.assert_close(whole, torch.cat(alone), rtol=1e-4, atol=1e-5)


def test_layers_of_equal_shape_are_handed_over():
    torch.manual_seed(3)
    statenet = models.build(small("statenet", "network.graph=[8,8,8]")["network"])
    pathnet = models.build(small("pathnet", "network.graph=[8,8,8]")["network"])
    # The first layers read different features; the others agree.
    assert models.handed_layers(statenet, pathnet) == ["graph.1 -> graph.1", "graph.2 -> graph.2"]
    assert torch.equal(pathnet.graph[2].state_self.src.weight, statenet.graph[2].state_self.src.weight)


def test_the_papers_first_layer_is_handed_over():
    names = ["network.trunk_widths=[2,2,4,4]", "network.trunk_blocks=[1,1,1,1]"]
    statenet = models.build(configs.get("paper", "statenet", names)["network"])
    pathnet = models.build(configs.get("paper", "pathnet", ["network.n1=1"])["network"])
    assert models.handed_layers(statenet, pathnet) == ["first -> graph.0"]


def test_resnet50_has_the_published_size():
    trunk = models.Trunk("bottleneck", [64, 128, 256, 512], [3, 4, 6, 3])
    assert trunk.outputs == 2048
    assert sum(p.numel() for p in trunk.parameters()) == 23_508_032  # ResNet-50 without its last layer


def test_the_balanced_state_loss_by_hand(data_set):
    run = begin(small("statenet"), data_set[0])
    batch = batches.make(run.missions, np.arange(2), heat=False)
    batch.graphs.state_graph = torch.tensor([0, 0, 0, 0, 1])
    batch.visited = torch.tensor([1.0, 1, 1, 1, 1])
    logits = torch.tensor([[0.0], [0.0], [0.0], [0.0], [5.0]])
    high, low = np.log(2), np.log1p(np.exp(-5))
    expected = (4 * high / 2 + low) / (4 / 2 + 1)
    assert abs(run.loss(logits, batch).item() - expected) < 1e-6


def test_draws_by_hand(data_set):
    missions = data.load(data_set[0], configs.get("compact", "pathnet")["network"])
    k = int(np.flatnonzero(np.diff(missions.legs_at) == 1)[0])
    region = missions.legs[missions.legs_at[k], 2]
    masks = batches.make(missions, np.array([k])).raster[0, 1:].numpy()
    factor = 200 // missions.resolution
    inside = np.kron(masks[missions.order[k].tolist().index(region)], np.ones((factor, factor))) == 1
    draws = lambda heat: metrics._draws(heat, masks, missions, k)
    # All weight on the region: the first draw is in it. No weight there: never.
    assert set(draws(inside.astype(np.float32)).values()) >= {1.0}
    assert draws((~inside).astype(np.float32))["draws1"] == metrics.CAP
    assert draws(np.ones((200, 200)))["draws8"] == draws(inside)["draws0"]


def test_average_precision_by_hand():
    counted = metrics.counts(np.array([0.9, 0.8, 0.7, 0.1]), np.array([True, False, True, False]))
    assert abs(metrics.average_precision(counted) - (1 / 2 * 1 + 1 / 2 * 2 / 3)) < 1e-9


def test_the_evaluate_command_reads_weight_and_data(data_set, tmp_path, capsys):
    export.write(tmp_path / "x.safetensors", models.build(small("statenet")["network"]))
    evaluate.main([str(tmp_path / "x.safetensors"), str(data_set[0]), "--limit", "6"])
    found = json.loads(capsys.readouterr().out)
    assert found["all"]["missions"] == 6 and 0 < found["all"]["ap"] <= 1
    assert sum(v["missions"] for k, v in found.items() if k.startswith("pattern")) == 6


def test_a_set_without_ways_trains_the_networks_that_read_none(tmp_path):
    entries = synthetic.write(tmp_path / "set", maps=2)
    for entry in entries:
        for part in (entry, *entry["missions"]):
            del part["ways"]
    rewrite(tmp_path / "set", entries)
    base = ["statenet", "--data", str(tmp_path / "set"), "--device", "cpu", "--steps", "1", "--set", "training.batch=4"]
    small = lambda changes: [word for change in changes for word in ("--set", change)]
    with pytest.raises(SystemExit, match="no lengths of ways"):
        train.main([*base, *small(SMALL["statenet"]), "--out", str(tmp_path / "ways")])
    train.main([*base, "--config", "raster", *small(RASTER["statenet"]), "--out", str(tmp_path / "raster")])
    assert (tmp_path / "raster" / "statenet.safetensors").is_file()


def rewrite(folder, entries):
    """Puts other lines into the one shard of a data set."""
    manifest = json.loads((folder / "manifest.json").read_text())
    for shard in manifest["shards"]:
        lines = [json.dumps(entry) + "\n" for entry in entries[shard["from"] : shard["to"]]]
        path = folder / shard["file"]
        path.write_bytes(gzip.compress("".join(lines).encode(), mtime=0))
        shard["sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(manifest))
