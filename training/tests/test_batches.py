"""Vectors to batches: what is drawn on the missions' device against the reference, and what stays as it was."""

import gzip
import hashlib
import json

import numpy as np
import pytest
import reference
import torch

from nngtl_training import batches, data, drawing, targets
from nngtl_training import graph as gr

CONFIG = {"labels": 7, "resolution": 100}
DEVICES = ["cpu", pytest.param("cuda", marks=pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device"))]


def test_the_raster_has_the_contracts_layout(data_set):
    folder, maps = data_set
    batch = batches.make(data.load(folder, CONFIG), np.array([0]))
    mission = maps[0]["missions"][0]
    i, j = (int(v * 100) for v in mission["start"])
    assert batch.raster[0, 0, i, j] == -1 and (batch.raster[0, 0] == -1).sum() == 1
    for channel, region in enumerate(mission["order"]):
        expected = reference.polygon(np.array(maps[0]["regions"][region]) * 100, 100)
        assert np.array_equal(batch.raster[0, 1 + channel].numpy(), expected)
    assert (batch.raster[0, 1 + len(mission["order"]) :] == 0).all()
    assert set(batch.raster[0, 0].unique().tolist()) == {-1.0, 0.0, 1.0}


def test_the_target_covers_the_path_and_avoids_obstacles(data_set):
    folder, maps = data_set
    missions = data.load(folder, {**CONFIG, "resolution": 200})
    marks = batches.make(missions, np.array([0])).heat[0].numpy() == 1
    obstacles = reference.map_codes([np.array(o) for o in maps[0]["obstacles"]], [], (1, 1), 200) == 1
    assert not (marks & obstacles).any()
    points = np.array(maps[0]["missions"][0]["prefix"]) * 200
    share = np.linspace(0, 1, 1001)[:, None]
    for a, b in zip(points, points[1:]):
        i, j = np.clip((a + share * (b - a)).astype(int), 0, 199).T
        assert (marks | obstacles)[i, j].all()


def awkward(maps):
    """Maps with overlapping and touching shapes on cell borders, slivers and many corners, in bounds of any kind."""
    out = []
    for number, entry in enumerate(json.loads(json.dumps(maps))):
        rng = np.random.default_rng(number)
        x, y = rng.integers(0, 40, 2) / 50
        angles = np.sort(rng.uniform(0, 2 * np.pi, 3000))
        radii = rng.uniform(0.02, 0.15, 3000)
        star = rng.uniform(0, 1, 2) + radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        entry["obstacles"] += [
            [[x, y], [x + 0.1, y], [x + 0.1, y + 0.04], [x, y + 0.04]],
            [[x + 0.1, y], [x + 0.2, y], [x + 0.2, y + 0.08], [x + 0.1, y + 0.08]][::-1],
            [[x, y + 0.1], [x + 0.2, y + 0.13], [x + 0.2, y + 0.1301]],
            star.tolist() if number % 2 else [[x + 0.05, y + 0.02], [x + 0.15, y + 0.02], [x + 0.1, y + 0.1]],
        ]
        entry["regions"][0] = [[x, y], [x + 0.16, y], [x + 0.08, y + 0.16]]
        for mission in entry["missions"]:
            mission["suffix"] += [[round(v, 2) for v in rng.uniform(0, 1, 2)], mission["suffix"][0]]
            if number % 3 == 0:
                mission["start"] = mission["prefix"][0] = [round(v * 50) / 50 for v in mission["start"]]
        low, size = [([0, 0], [1, 1]), ([0, 0], [1, 0.7]), ([0.1, -0.2], [0.9, 1.3])][number % 3]
        entry["bounds"] = [low, [low[0] + size[0], low[1] + size[1]]]
        out.append(entry)
    return out


@pytest.fixture(scope="module")
def hard(data_set, tmp_path_factory):
    """A data set that is hard to draw: (folder, [(map, mission)])."""
    folder, maps = data_set
    entries = awkward(maps)
    target = tmp_path_factory.mktemp("hard")
    manifest = json.loads((folder / "manifest.json").read_text())
    for shard in manifest["shards"]:
        lines = "".join(json.dumps(entry) + "\n" for entry in entries[shard["from"] : shard["to"]])
        (target / shard["file"]).write_bytes(gzip.compress(lines.encode()))
        shard["sha256"] = hashlib.sha256((target / shard["file"]).read_bytes()).hexdigest()
    (target / "manifest.json").write_text(json.dumps(manifest))
    return target, [(entry, mission) for entry in entries for mission in entry["missions"]]


KINDS = {
    "compact": dict(resolution=50, spread=0.015),
    "places of the prefix": dict(resolution=50, spread=0.015, suffix=False),
    "cells": dict(resolution=50, reach=False),
    "cells of the prefix": dict(resolution=100, reach=False, suffix=False),
    "reach": dict(resolution=100, reach=True),
    "paper": dict(resolution=200, reach=False),
}


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("source", ["hard", "made_by_nngtl"])
def test_a_batch_is_what_the_reference_draws_in_every_turn(source, kind, device, request):
    folder, wanted = request.getfixturevalue(source)
    if source == "made_by_nngtl":
        wanted = [(entry, mission) for entry in wanted for mission in entry["missions"]]
    how = {"reach": False, "spread": None, "suffix": True, **KINDS[kind]}
    side = how["resolution"]
    missions = data.load(folder, {"labels": 7, "resolution": side, "suffix": how["suffix"]}).to(device)
    rng = np.random.default_rng(8)
    count = min(16, len(missions))
    chosen = np.sort(rng.permutation(len(missions))[:count])
    slide = np.where(rng.random(count) < 0.7, 0.8 * rng.random(count), 0)
    columns = rng.permuted(np.tile(np.arange(7), (count, 1)), axis=1)
    expected, moved = [], 0
    for b, k in enumerate(chosen):
        sample = reference.Sample(*wanted[k], side)
        start, prefix = sample.start, sample.prefix
        slid = sample.slid(slide[b]) if slide[b] else None
        if slid is not None:
            start, prefix = slid, np.concatenate([[slid], prefix[1:]])
            moved += 1
        entries = missions.entries[missions.entries_at[k] : missions.entries_at[k + 1]] if how["reach"] else ()
        expected.append((sample.raster(start, columns[b]), sample.heat(prefix, how["suffix"], entries, how["spread"])))
    assert 0 < moved < count
    for first in range(8):
        choices = batches.Choices((np.arange(count) + first) % 8, columns, slide)
        batch = batches.drawn(missions, chosen, choices, how["reach"], True, how["spread"])
        for b, (turn, (raster, heat)) in enumerate(zip(choices.turn, expected)):
            turned = np.stack([reference.turned(channel, turn) for channel in raster])
            assert np.array_equal(batch.raster[b].cpu().numpy(), turned), (b, turn)
            close = dict(rtol=0, atol=1e-6 if how["spread"] else 0)
            np.testing.assert_allclose(batch.heat[b].cpu().numpy(), reference.turned(heat, turn), **close, err_msg=f"{b} {turn}")


@pytest.mark.parametrize("kind", [*KINDS, "undrawn"])
def test_a_batch_is_made_without_waiting_for_the_device(kind, made_by_nngtl):
    """The meta device computes shapes alone: whoever reads a value from it fails."""
    how = {"reach": False, "spread": None, **KINDS.get(kind, {})}
    config = {"labels": 7} if kind == "undrawn" else {"labels": 7, "resolution": how["resolution"]}
    missions = data.load(made_by_nngtl[0], config).to("meta")
    augment, rng = batches.Augment(True, 0.5, 0.9), np.random.default_rng(1)
    batch = batches.make(missions, np.arange(12), augment, rng, how["reach"], True, how["spread"])
    graphs = [value for value in vars(batch.graphs).values() if torch.is_tensor(value)]
    assert {value.device.type for value in [batch.raster, batch.heat, batch.visited, *graphs]} == {"meta"}
    assert kind == "undrawn" or batch.raster.shape == (12, 8, how["resolution"], how["resolution"])


def test_starts_slide_only_as_far_as_the_letter_stays(data_set):
    missions = data.load(data_set[0], CONFIG)
    chosen = np.arange(len(missions))
    choices = batches.choose(len(chosen), 7, batches.Augment(False, 0, 1.0), np.random.default_rng(0))
    assert ((choices.slide > 0) & (choices.slide < batches.LONGEST)).all()
    scene = batches.scenes(missions, chosen, choices.turn)
    moves, slid = batches._slide(missions, chosen, choices, scene)
    assert len(missions) // 3 < moves.sum() < len(missions)
    turn = torch.zeros(len(missions), dtype=torch.int64)
    letters = [scene[chosen, 1:, *drawing.cell(at, turn, 100)] for at in (missions.on("start"), slid)]
    assert torch.equal(letters[0][moves[:, 0]], letters[1][moves[:, 0]])
    assert not scene[chosen, 0, *drawing.cell(slid, turn, 100)][moves[:, 0]].any()
    whole = batches.drawn(missions, chosen, batches.choose(len(chosen), 7)).heat
    left = batches.drawn(missions, chosen, choices).heat
    assert (left <= whole).all() and (left.sum((1, 2)) > 0).all() and not torch.equal(left, whole)


def test_permuted_channels_move_masks_and_literals_together(data_set):
    missions = data.load(data_set[0], CONFIG)
    chosen = np.array([1])
    plain = batches.make(missions, chosen)
    mixed = batches.make(missions, chosen, batches.Augment(False, 1.0, 0.0), np.random.default_rng(2))
    # Column by column, mask and literals together are the same set of pairs.
    pair = lambda b: sorted(
        (b.raster[0, 1 + c].numpy().tobytes(), b.graphs.transitions[:, c].numpy().tobytes()) for c in range(7)
    )
    assert pair(plain) == pair(mixed)
    assert not np.array_equal(plain.raster, mixed.raster)


def test_choices_are_made_as_often_as_asked_for():
    augment = batches.Augment(True, 0.5, 0.3)
    found = batches.choose(4000, 7, augment, np.random.default_rng(1))
    again = batches.choose(4000, 7, augment, np.random.default_rng(1))
    assert all(np.array_equal(a, b) for a, b in zip(vars(found).values(), vars(again).values()))
    assert abs((found.slide > 0).mean() - 0.3) < 0.03
    assert abs((found.columns != np.arange(7)).any(axis=1).mean() - 0.5) < 0.03
    assert (np.sort(found.columns, axis=1) == np.arange(7)).all()
    assert (np.abs(np.bincount(found.turn) / 4000 - 1 / 8) < 0.02).all()


def test_the_place_of_arrival_lies_in_the_region_near_the_path(data_set):
    folder, maps = data_set
    missions = data.load(folder, {**CONFIG, "resolution": 200})
    chosen, turn = np.array([0]), np.array([0])
    everywhere = torch.ones(1, 200, 200, dtype=torch.bool)
    reach = targets.reach_cells(missions, chosen, turn, everywhere)[0].numpy()
    inside = np.zeros((200, 200), dtype=bool)
    for region in maps[0]["missions"][0]["order"]:
        inside |= reference.polygon(np.array(maps[0]["regions"][region]) * 200, 200)
    assert reach.any() and inside[reach].all()
    alone, both = (batches.make(missions, chosen, reach=with_reach).heat[0] > 0 for with_reach in (False, True))
    free = ~targets.obstacles(missions, chosen, turn, 200)[0]
    assert torch.equal(both, alone | torch.from_numpy(reach) & free)


def test_places_are_marked_where_the_plan_bends_and_not_at_its_start(data_set):
    folder, maps = data_set
    missions = data.load(folder, CONFIG)
    heat = batches.make(missions, np.array([0]), spread=0.015).heat[0].numpy()
    mission = maps[0]["missions"][0]
    blocked = batches.scenes(missions, np.array([0]), np.array([0]))[0, 0].numpy()
    assert (heat[blocked] == 0).all()
    for at in mission["prefix"][1:] + mission["suffix"]:
        cell = reference.cell(at, 100)
        # A place lies within a cell's half diagonal of its centre.
        assert blocked[cell] or heat[cell] >= np.exp(-0.5 * (0.0071 / 0.015) ** 2)
    others = np.array(mission["prefix"][1:] + mission["suffix"])
    centres = (np.stack(np.meshgrid(range(100), range(100), indexing="ij"), -1) + 0.5) / 100
    away = np.linalg.norm(centres[:, :, None] - others, axis=-1).min(axis=-1)
    assert np.allclose(heat, np.where(blocked, 0, np.exp(-0.5 * (away / 0.015) ** 2)), atol=1e-6)


def test_an_epoch_visits_every_mission_once_and_depends_on_the_seed():
    seen = np.concatenate([batches.indices(10, 4, 7, step) for step in range(5)])
    assert sorted(seen[:10]) == list(range(10)) and sorted(seen[10:]) == list(range(10))
    assert not np.array_equal(seen[:10], seen[10:])
    assert not np.array_equal(batches.indices(10, 10, 7, 0), batches.indices(10, 10, 8, 0))


def test_ways_follow_the_channels(data_set):
    folder, maps = data_set
    missions = data.load(folder, {"labels": 7})  # no resolution: nothing is drawn
    wanted = [(m, entry) for entry in maps for m in entry["missions"]]
    chosen = np.arange(len(wanted))
    plain = batches.make(missions, chosen).graphs.ways.numpy()
    for (mission, entry), found in zip(wanted, plain):
        used = len(mission["order"])
        for c, k in enumerate(mission["order"]):
            assert found[c, 7] == found[7, c] == pytest.approx(mission["ways"][k], abs=1e-6)
            for d, l in enumerate(mission["order"]):
                assert found[c, d] == pytest.approx(entry["ways"][max(k, l)][min(k, l)], abs=1e-6)
        assert not found[used:7].any() and not found[:, used:7].any() and found[7, 7] == 0
    # With other channels for the regions, what a transition needs is still as far from the start.
    turned = batches.make(missions, chosen, batches.Augment(False, 1.0, 0.0), np.random.default_rng(1)).graphs
    straight = batches.make(missions, chosen).graphs
    assert not torch.equal(turned.transitions, straight.transitions)
    far = lambda g: gr.sign_mean(g, g.ways, 1)[:, 7]
    assert torch.equal(far(turned), far(straight))


def test_a_resolution_that_does_not_divide_the_targets_is_refused(data_set):
    with pytest.raises(ValueError, match="resolution 60 does not divide 200"):
        batches.make(data.load(data_set[0], {**CONFIG, "resolution": 60}), np.array([0]))
