"""Shards to batches."""

import dataclasses
import gzip
import json
import shutil

import numpy as np
import pytest
import torch

from nngtl_training import batches, data, raster, shards
from nngtl_training import graph as gr

CONFIG = {"labels": 7, "resolution": 100}


@pytest.mark.parametrize("source", ["data_set", "made_by_nngtl"])
def test_a_data_set_comes_back_as_it_was_written(source, request):
    folder, maps = request.getfixturevalue(source)
    missions = data.load(folder, CONFIG)
    wanted = [(m, entry) for entry in maps for m in entry["missions"]]
    assert not missions.skipped or source == "made_by_nngtl"
    assert len(missions) == len(wanted)
    for k, (mission, entry) in enumerate(wanted):
        states = slice(missions.states_at[k], missions.states_at[k + 1])
        assert np.flatnonzero(missions.visited[states]).tolist() == mission["visited"]
        assert missions.states[states].shape[0] == mission["automaton"]["states"]
        rows = slice(missions.edges_at[k], missions.edges_at[k + 1])
        found = [
            [int(a), int(b), e[: len(mission["order"])].tolist()]
            for (a, b), e in zip(missions.edges[rows], missions.literals[rows])
        ]
        assert found == mission["automaton"]["transitions"]
        code = missions.codes[missions.map[k]]
        for bit, shape in enumerate(entry["regions"]):
            assert np.array_equal(code >> (bit + 1) & 1, raster.polygon(np.array(shape) * 100, 100))


def test_the_target_covers_the_path_and_avoids_obstacles(data_set):
    folder, maps = data_set
    missions = data.load(folder, CONFIG)
    obstacles = raster.map_codes([np.array(o) for o in maps[0]["obstacles"]], [], (1, 1), 200) == 1
    marks = np.zeros((200, 200), dtype=bool)
    marks.ravel()[missions.cells[: missions.cells_at[1]]] = True
    assert not (marks & obstacles).any()
    points = np.array(maps[0]["missions"][0]["prefix"]) * 200
    share = np.linspace(0, 1, 1001)[:, None]
    for a, b in zip(points, points[1:]):
        i, j = np.clip((a + share * (b - a)).astype(int), 0, 199).T
        assert (marks | obstacles)[i, j].all()


def test_other_bounds_are_letterboxed(data_set, tmp_path):
    _, maps = data_set
    entry = json.loads(json.dumps(maps[0]))
    # Stretch the frame: bounds 4 wide and 2 high from (1, −1), everything at twice the size.
    move = lambda points: [[1 + 2 * x, -1 + 2 * y] for x, y in points]
    entry["bounds"] = [[1, -1], [5, 1]]
    entry["obstacles"], entry["regions"] = ([move(p) for p in entry[k]] for k in ("obstacles", "regions"))
    for mission in entry["missions"]:
        mission["prefix"], mission["suffix"] = move(mission["prefix"]), move(mission["suffix"])
        mission["start"] = move([mission["start"]])[0]
    builder = data._Builder(100, 7, True, 4000)
    builder.add(entry)
    arrays = builder.arrays()
    assert (arrays["codes"][0][:, 50:] & 1).all()
    plain = data._Builder(50, 7, True, 4000)
    plain.add(maps[0])
    assert np.array_equal(arrays["codes"][0][:50, :50], plain.arrays()["codes"][0])


def test_a_cached_set_equals_a_fresh_one(data_set, tmp_path):
    folder, _ = data_set
    fresh = data.load(folder, CONFIG, tmp_path)
    cached = data.load(folder, CONFIG, tmp_path)
    for field in dataclasses.fields(fresh):
        a, b = getattr(fresh, field.name), getattr(cached, field.name)
        assert np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b, field.name


def test_missions_that_do_not_fit_are_counted(data_set):
    folder, maps = data_set
    missions = data.load(folder, {**CONFIG, "labels": 2})
    large = sum(len(m["order"]) > 2 for entry in maps for m in entry["missions"])
    assert large > 0 and missions.skipped == {"more regions than channels": large}


@pytest.fixture
def broken(data_set, tmp_path):
    return shutil.copytree(data_set[0], tmp_path / "set")


def test_a_changed_shard_is_refused(broken):
    shard = broken / "shard-00001.jsonl.gz"
    shard.write_bytes(shard.read_bytes()[:-1] + b"x")
    with pytest.raises(shards.DataError, match="shard-00001.*SHA-256"):
        data.load(broken, CONFIG)


def test_a_missing_shard_and_another_format_are_refused(broken):
    (broken / "shard-00000.jsonl.gz").unlink()
    with pytest.raises(shards.DataError, match="shard-00000.*missing"):
        data.load(broken, CONFIG)
    manifest = json.loads((broken / "manifest.json").read_text())
    (broken / "manifest.json").write_text(json.dumps({**manifest, "format": 2}))
    with pytest.raises(shards.DataError, match="format 2"):
        data.load(broken, CONFIG)


def rewrite(folder, number, change):
    """Changes the first map of a shard, and its digest with it."""
    manifest = json.loads((folder / "manifest.json").read_text())
    shard = manifest["shards"][number]
    path = folder / shard["file"]
    first, *others = gzip.decompress(path.read_bytes()).decode().splitlines()
    entry = json.loads(first)
    change(entry)
    path.write_bytes(gzip.compress("".join(line + "\n" for line in [json.dumps(entry), *others]).encode()))
    shard["sha256"] = shards.digest(path)
    (folder / "manifest.json").write_text(json.dumps(manifest))


@pytest.mark.parametrize(
    "change, says",
    [
        (lambda e: e["ways"].pop(), "ways: expected a list for each of the 7 regions"),
        (lambda e: e.update(ways=0.5), "ways: expected a list for each of the 7 regions, found 0.5"),
        (lambda e: e["ways"][2].pop(), "ways of region l3: expected 3 lengths"),
        (lambda e: e["ways"].__setitem__(1, [0.1, "far"]), 'ways of region l2: expected 2 lengths, found .0.1, "far".'),
        (lambda e: e["ways"].__setitem__(1, None), "ways of region l2: expected 2 lengths, found null"),
        (lambda e: e["missions"][1].update(ways=[]), r"mission 2: ways: expected 7 lengths, found \[\]"),
    ],
)
def test_malformed_ways_are_refused_where_they_stand(broken, change, says):
    rewrite(broken, 1, change)
    with pytest.raises(shards.DataError, match=f"shard-00001.jsonl.gz: line 1: {says}.*dataset.md"):
        data.load(broken, CONFIG)


def test_a_set_without_ways_and_one_with_ways_that_nothing_walks_are_read(broken):
    count = len(data.load(broken, CONFIG))
    rewrite(broken, 0, lambda e: [part.pop("ways") for part in (e, *e["missions"])])
    rewrite(broken, 1, lambda e: e["missions"][0].update(ways=[None] * 7))
    missions = data.load(broken, {"labels": 7})
    assert len(missions) == count and np.isnan(missions.ways[0]).all()
    assert (missions.ways == data.FARTHEST).any()


def test_the_raster_has_the_contracts_layout(data_set):
    folder, maps = data_set
    missions = data.load(folder, CONFIG)
    batch = batches.make(missions, np.array([0]))
    mission = maps[0]["missions"][0]
    i, j = (int(v * 100) for v in mission["start"])
    assert batch.raster[0, 0, i, j] == -1 and (batch.raster[0, 0] == -1).sum() == 1
    for channel, region in enumerate(mission["order"]):
        expected = raster.polygon(np.array(maps[0]["regions"][region]) * 100, 100)
        assert np.array_equal(batch.raster[0, 1 + channel].numpy(), expected)
    assert (batch.raster[0, 1 + len(mission["order"]) :] == 0).all()
    assert set(batch.raster[0, 0].unique().tolist()) == {-1.0, 0.0, 1.0}


@pytest.mark.parametrize("turn", range(8))
def test_symmetries_turn_everything_alike(data_set, turn):
    missions = data.load(data_set[0], CONFIG)
    plain = batches.make(missions, np.array([3]))

    class Fixed:
        integers = staticmethod(lambda n: turn)
        random = staticmethod(lambda: 1.0)

    turned = batches.make(missions, np.array([3]), batches.Augment(True, 0.0, 0.0), Fixed)
    for channel in range(8):
        expected = batches.turned(plain.raster[0, channel].numpy(), turn)
        assert np.array_equal(turned.raster[0, channel].numpy(), expected)
    assert np.array_equal(turned.heat[0].numpy(), batches.turned(plain.heat[0].numpy(), turn))


def test_the_eight_symmetries_differ():
    grid = np.arange(9).reshape(3, 3)
    assert len({batches.turned(grid, t).tobytes() for t in range(8)}) == 8


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


def test_a_start_that_slides_keeps_a_part_of_the_target(data_set):
    missions = data.load(data_set[0], CONFIG)
    moved = 0
    for k in range(len(missions)):
        code = missions.codes[missions.map[k]]
        whole = batches.target_cells(missions, k, True)
        slid = batches._slide(missions, k, code, np.random.default_rng(k), whole)
        if slid is None:
            continue
        moved += 1
        start, cells = slid
        assert set(cells.tolist()) <= set(whole.tolist())
        i, j = raster.cell(start, 200)
        assert i * 200 + j in set(cells.tolist())
        assert code[raster.cell(start, 100)] >> 1 == code[raster.cell(missions.start[k], 100)] >> 1
    assert moved > len(missions) // 3


def test_arrivals_by_hand():
    box = lambda x, y: np.array([[x, y], [x + 0.2, y], [x + 0.2, y + 0.2], [x, y + 0.2]])
    regions = [(3, box(0.4, 0.0)), (5, box(0.8, 0.5))]
    # Straight (by way of a point on the line) through the first region, round a corner, into the second, on inside it.
    path = np.array([[0.1, 0.1], [0.3, 0.1001], [0.9, 0.1], [0.9, 0.51], [0.85, 0.6]])
    entries, legs = data.arrivals(path, regions)
    assert [shape is r for (_, shape), (_, r) in zip(entries, regions)] == [True, True]
    assert np.allclose([p for p, _ in entries], [[0.4, 0.1], [0.9, 0.5]], atol=0.005)
    assert [leg[2] for leg in legs] == [3]
    assert legs[0][:2] == (0.1, 0.1)


def test_the_place_of_arrival_lies_in_the_region_near_the_path(data_set):
    folder, maps = data_set
    missions = data.load(folder, CONFIG)
    mission = maps[0]["missions"][0]
    reach = missions.reach[: missions.reach_at[1]]
    assert len(reach) > 0
    inside = np.zeros(200 * 200, dtype=bool)
    for region in mission["order"]:
        inside |= raster.polygon(np.array(maps[0]["regions"][region]) * 200, 200).ravel()
    assert inside[reach].all()
    both = batches.target_cells(missions, 0, True)
    assert set(both) == set(reach) | set(missions.cells[: missions.cells_at[1]])


def test_places_are_marked_where_the_plan_bends_and_not_at_its_start(data_set):
    folder, maps = data_set
    missions = data.load(folder, CONFIG)
    heat = batches.make(missions, np.array([0]), spread=0.015).heat[0].numpy()
    mission = maps[0]["missions"][0]
    blocked = missions.codes[missions.map[0]] & 1 == 1
    assert (heat[blocked] == 0).all()
    for at in mission["prefix"][1:] + mission["suffix"]:
        cell = raster.cell(at, 100)
        # A place lies within a cell's half diagonal of its centre.
        assert blocked[cell] or heat[cell] >= np.exp(-0.5 * (0.0071 / 0.015) ** 2)
    others = np.array(mission["prefix"][1:] + mission["suffix"])
    centres = (np.stack(np.meshgrid(range(100), range(100), indexing="ij"), -1) + 0.5) / 100
    away = np.linalg.norm(centres[:, :, None] - others, axis=-1).min(axis=-1)
    assert np.allclose(heat, np.where(blocked, 0, np.exp(-0.5 * (away / 0.015) ** 2)), atol=1e-6)
    turned = batches.make(missions, np.array([0]), batches.Augment(True, 0, 0), np.random.default_rng(1), spread=0.015).heat[0].numpy()
    assert any(np.array_equal(turned, batches.turned(heat, turn)) for turn in range(8))


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
    plain = batches.make(missions, chosen, draw=False).graphs.ways.numpy()
    for (mission, entry), found in zip(wanted, plain):
        used = len(mission["order"])
        for c, k in enumerate(mission["order"]):
            assert found[c, 7] == found[7, c] == pytest.approx(mission["ways"][k], abs=1e-6)
            for d, l in enumerate(mission["order"]):
                assert found[c, d] == pytest.approx(entry["ways"][max(k, l)][min(k, l)], abs=1e-6)
        assert not found[used:7].any() and not found[:, used:7].any() and found[7, 7] == 0
    # With other channels for the regions, what a transition needs is still as far from the start.
    turned = batches.make(missions, chosen, batches.Augment(False, 1.0, 0.0), np.random.default_rng(1), draw=False).graphs
    straight = batches.make(missions, chosen, draw=False).graphs
    assert not torch.equal(turned.transitions, straight.transitions)
    far = lambda g: gr.sign_mean(g, g.ways, 1)[:, 7]
    assert torch.equal(far(turned), far(straight))
