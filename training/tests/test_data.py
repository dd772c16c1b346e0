"""Shards to vectors."""

import dataclasses
import gzip
import json
import shutil

import numpy as np
import pytest

from nngtl_training import data, shards
from nngtl_training.arrivals import arrivals

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
        first = missions.polygons_at[missions.map[k]]
        assert missions.obstacles[missions.map[k]] == len(entry["obstacles"])
        for polygon, shape in enumerate(entry["obstacles"] + entry["regions"], start=first):
            assert missions.corners[missions.corners_at[polygon] : missions.corners_at[polygon + 1]].tolist() == shape
        points = missions.points[missions.points_at[k] : missions.points_at[k + 1]].tolist()
        assert points[: missions.prefix[k]] == mission["prefix"] and points[missions.prefix[k] :] == mission["suffix"]


def test_other_bounds_are_letterboxed(data_set):
    _, maps = data_set
    plain, moved = (arrays_of(entry) for entry in (maps[0], stretched(maps[0])))
    assert moved["extent"].tolist() == [[1, 0.5]] and plain["extent"].tolist() == [[1, 1]]
    for name in ("corners", "start", "points"):
        assert np.allclose(moved[name], plain[name] / 2, atol=1e-12), name


def arrays_of(entry):
    builder = data._Builder(7, True, 4000)
    builder.add(entry)
    return builder.arrays()


def stretched(entry):
    """The same in bounds 4 wide and 2 high from (1, −1), everything at twice the size."""
    entry = json.loads(json.dumps(entry))
    move = lambda points: [[1 + 2 * x, -1 + 2 * y] for x, y in points]
    entry["bounds"] = [[1, -1], [5, 1]]
    entry["obstacles"], entry["regions"] = ([move(p) for p in entry[k]] for k in ("obstacles", "regions"))
    for mission in entry["missions"]:
        mission["prefix"], mission["suffix"] = move(mission["prefix"]), move(mission["suffix"])
        mission["start"] = move([mission["start"]])[0]
    return entry


def test_a_cached_set_equals_a_fresh_one(data_set, tmp_path):
    folder, _ = data_set
    fresh = data.load(folder, CONFIG, tmp_path)
    cached = data.load(folder, CONFIG, tmp_path)
    assert len(list(tmp_path.iterdir())) == 1
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


def test_arrivals_by_hand():
    box = lambda x, y: np.array([[x, y], [x + 0.2, y], [x + 0.2, y + 0.2], [x, y + 0.2]])
    regions = [(3, box(0.4, 0.0)), (5, box(0.8, 0.5))]
    # Straight (by way of a point on the line) through the first region, round a corner, into the second, on inside it.
    path = np.array([[0.1, 0.1], [0.3, 0.1001], [0.9, 0.1], [0.9, 0.51], [0.85, 0.6]])
    entries, legs = arrivals(path, regions)
    assert [entry[2] for entry in entries] == [3, 5]
    assert np.allclose([entry[:2] for entry in entries], [[0.4, 0.1], [0.9, 0.5]], atol=0.005)
    assert [leg[2] for leg in legs] == [3]
    assert legs[0][:2] == (0.1, 0.1)


def test_a_path_that_never_leaves_its_place_arrives_nowhere():
    square = np.array([[0.4, 0.4], [0.6, 0.4], [0.6, 0.6], [0.4, 0.6]])
    for path in ([[0.5, 0.5]], [[0.5, 0.5]] * 2):
        assert arrivals(np.array(path), [(0, square)]) == ([], [])
