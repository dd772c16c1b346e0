"""Drawing: by hand, and against the reference on shapes that are hard to draw."""

import numpy as np
import pytest
import reference
import torch

from nngtl_training import drawing

DEVICES = ["cpu", pytest.param("cuda", marks=pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device"))]
UPRIGHT = np.zeros(1, dtype=np.int64)


class Drawn:
    """The package's drawing with the reference's interface: coordinates in cells, one polygon or path at a time."""

    grow = staticmethod(lambda marks: drawing.grow(torch.from_numpy(marks)).numpy())

    @staticmethod
    def polygon(vertices, side):
        return polygons([vertices], side, UPRIGHT)[0, 0]

    @staticmethod
    def path(points, side):
        return path(points, side, UPRIGHT)[0]

    @staticmethod
    def map_codes(obstacles, regions, extent, side):
        layer = [0] * len(obstacles) + [k + 1 for k in range(len(regions))]
        shapes = [np.array(shape) * side for shape in [*obstacles, *regions]]
        scene = polygons(shapes, side, UPRIGHT, layer=layer)[0].astype(int)
        scene[0] |= drawing.outside(torch.tensor([extent], dtype=torch.float64), torch.from_numpy(UPRIGHT), side)[0].numpy()
        return sum(marks << bit for bit, marks in enumerate(scene))

    @staticmethod
    def cell(point, side):
        i, j = drawing.cell(torch.tensor([point], dtype=torch.float64), torch.from_numpy(UPRIGHT), side)
        return i.item(), j.item()


@pytest.fixture(params=[reference, Drawn], ids=["reference", "drawing"])
def raster(request):
    return request.param


def polygons(shapes, side, turn, device="cpu", layer=None):
    """Polygons in cells, on one layer unless told otherwise, in as many pictures as there are turns."""
    shapes = [np.array(shape, dtype=np.float64) / side for shape in shapes]
    at = np.concatenate([[0], np.cumsum([len(shape) for shape in shapes])])
    layers = 1 if layer is None else max(layer) + 1
    layer = None if layer is None else np.repeat(layer, np.diff(at))
    lines = drawing.Lines(drawing.outlines(np.concatenate(shapes), at), device, layer)
    first, count = np.zeros_like(turn), np.full_like(turn, at[-1])
    return drawing.polygons(lines, side, first, count, turn, layers).cpu().numpy()


def path(points, side, turn, device="cpu"):
    points = np.array(points, dtype=np.float64).reshape(-1, 2) / side
    ends = np.hstack([points, points]) if len(points) == 1 else np.hstack([points[:-1], points[1:]])
    lines = drawing.Lines(ends, device)
    return drawing.paths(lines, side, np.zeros_like(turn), np.full_like(turn, len(ends)), turn).cpu().numpy()


def cells(marks):
    return sorted(map(tuple, np.argwhere(marks).tolist()))


def box(x0, y0, x1, y1):
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]


def test_a_rectangle_on_grid_lines_marks_its_own_cells_alone(raster):
    assert cells(raster.polygon(box(1, 2, 3, 4), 6)) == [(1, 2), (1, 3), (2, 2), (2, 3)]


def test_less_than_the_tolerance_over_a_line_marks_nothing_more(raster):
    assert cells(raster.polygon(box(1, 1, 2 + 1e-10, 2), 4)) == [(1, 1)]
    assert cells(raster.polygon(box(1, 1, 2 + 1e-6, 2), 4)) == [(1, 1), (2, 1)]


def test_a_polygon_inside_one_cell_marks_it(raster):
    assert cells(raster.polygon([[2.1, 2.1], [2.3, 2.1], [2.2, 2.2]], 5)) == [(2, 2)]


def test_the_first_axis_is_x(raster):
    assert cells(raster.polygon(box(0, 0, 3, 1), 4)) == [(0, 0), (1, 0), (2, 0)]


def test_a_triangle_marks_the_cells_on_its_hypotenuse_but_not_corners_beyond(raster):
    # x + y ≤ 3: the cells on the diagonal are met, those that it touches in a corner are not.
    assert cells(raster.polygon([[0, 0], [3, 0], [0, 3]], 4)) == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (2, 0)]


def test_a_notch_of_a_non_convex_polygon_stays_free(raster):
    u = [[0, 0], [5, 0], [5, 5], [4, 5], [4, 1], [1, 1], [1, 5], [0, 5]]
    free = {(i, j) for i in (1, 2, 3) for j in (1, 2, 3, 4)}
    assert set(cells(raster.polygon(u, 5))) == {(i, j) for i in range(5) for j in range(5)} - free


def test_orientation_does_not_matter(raster):
    shape = [[0.3, 0.2], [7.7, 1.9], [5.1, 6.6], [3.2, 2.5]]
    assert np.array_equal(raster.polygon(shape, 8), raster.polygon(shape[::-1], 8))


def test_parts_outside_of_the_frame_are_cut_off(raster):
    assert cells(raster.polygon(box(-3, -3, 1, 1), 4)) == [(0, 0)]
    assert not raster.polygon(box(5, 5, 6, 6), 4).any()


def test_random_polygons_agree_with_a_dense_sample_of_points(raster):
    rng = np.random.default_rng(5)
    for _ in range(20):
        angles = np.sort(rng.uniform(0, 2 * np.pi, 7))
        radii = rng.uniform(1, 5, 7)
        shape = 6 + np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
        marks = raster.polygon(shape, 12)
        fine = (np.arange(12 * 40) + 0.5) / 40
        inside = reference._inside(shape, np.roll(shape, -1, axis=0), fine, fine)
        seen = inside.reshape(12, 40, 12, 40).any(axis=(1, 3))
        assert not (seen & ~marks).any()
        # What no sample saw can only be a sliver that an edge cuts from a cell.
        assert (marks & ~seen).sum() <= 6


def test_a_path_along_a_grid_line_marks_both_sides(raster):
    assert cells(raster.path([[1, 2], [2.5, 2]], 4)) == [(i, j) for i in (0, 1, 2) for j in (1, 2)]


def test_a_diagonal_path_and_its_neighbours(raster):
    marks = raster.path([[0.5, 0.5], [1.5, 0.5]], 4)
    assert cells(marks) == [(0, 0), (1, 0)]
    assert cells(raster.grow(marks)) == [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0)]


def test_a_single_point_is_a_path(raster):
    assert cells(raster.path([[1.5, 2.5]], 4)) == [(1, 2)]


def test_codes_hold_obstacle_regions_and_the_outside(raster):
    codes = raster.map_codes([box(0, 0, 0.25, 0.25)], [box(0.5, 0, 1, 0.25), box(0.75, 0, 1, 0.25)], (1.0, 0.5), 4)
    assert codes[0, 0] == 1 and codes[1, 0] == 0
    assert codes[2, 0] == 2 and codes[3, 0] == 2 + 4
    assert (codes[:, 2:] == 1).all() and (codes[:2, 1] == 0).all()


def test_the_start_cell_is_clamped(raster):
    assert raster.cell((1.0, 0.0), 10) == (9, 0)


def jagged(rng, corners, middle, low, high):
    """A polygon with as many corners, around a point."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, corners))
    radii = rng.uniform(low, high, corners)
    return np.array(middle) + radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def hard(rng, side):
    """Shapes by name, in cells."""
    at = lambda *size: rng.integers(0, side, size) * 1.0
    x, y = rng.integers(0, side - 8, 2)
    sliver = np.array([[x, y + 0.3], [x + 7.7, y + 5.1], [x + 7.7, y + 5.1 + 1e-7]])
    yield "box on cell borders", [box(x, y, x + 5, y + 3)]
    yield "box on a border but for rounding", [box(x + 1 / 3, y + 0.1 + 0.2 - 0.3, x + 5, y + 3)]
    yield "boxes that touch", [box(x, y, x + 2, y + 3), box(x + 2, y, x + 4, y + 3), box(x + 4, y + 3, x + 7, y + 6)]
    yield "boxes that overlap, one clockwise", [box(x, y, x + 3.5, y + 3.5), box(x + 1.5, y + 1.5, x + 7.5, y + 6.5)[::-1]]
    yield "a box in a box", [box(x, y, x + 7, y + 7), box(x + 2.5, y + 2.5, x + 4.5, y + 4.5)]
    yield "sliver", [sliver]
    yield "upright sliver", [sliver[:, ::-1]]
    yield "no area", [[[x, y], [x + 3, y + 3], [x + 5, y + 5]]]
    yield "corners on cell corners", [jagged(rng, 7, (x + 4, y + 4), 1, 6).round()]
    yield "corners in cell centres", [jagged(rng, 9, (x + 4, y + 4), 1, 6).round() + 0.5]
    yield "edges through cell centres", [[[x + 0.5, y], [x + 4.5, y + 4], [x + 0.5, y + 8], [x + 0.5, y + 4]]]
    yield "out of the frame", [jagged(rng, 12, at(2), 1, side), box(-5, -5, side + 5, 1.5), box(side + 1, 2, side + 4, 9)]
    yield "around all of it", [box(-1, -2, side + 1, side + 3)]
    around, hole = box(x, y, x + 8, y + 8), box(x + 2, y + 2, x + 6, y + 6)
    yield "a hole behind a slit", [[*around, around[0], hole[0], *hole[:0:-1], hole[0]]]
    yield "thousands of corners", [jagged(rng, 5000, (side / 2, side / 2), side / 5, side / 2)]
    yield "a few of everything", [jagged(rng, int(rng.integers(3, 12)), at(2), 0.1, 9) for _ in range(9)]


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("side", [17, 50, 200])
def test_hard_polygons_are_drawn_as_the_reference_does_in_every_turn(side, device):
    turn = np.arange(8)
    for name, shapes in hard(np.random.default_rng(side), side):
        wanted = np.any([reference.polygon(shape, side) for shape in shapes], axis=0)
        for t, found in zip(turn, polygons(shapes, side, turn, device)[:, 0]):
            assert np.array_equal(found, reference.turned(wanted, t)), (name, t)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("side", [17, 50, 200])
def test_hard_paths_are_drawn_as_the_reference_does_in_every_turn(side, device):
    rng, turn = np.random.default_rng(side), np.arange(8)
    walks = [[[3, 4]], [[2.5, 3.5]] * 2, [[3, 2], [3, 9]], [[2, 3.5], [9, 3.5]], [[1, 1], [9, 9]], [[1, 9.5], [9.5, 1]]]
    walks += [[[2, 2], [2 + 1e-12, 9]], [[0, 0], [side, 0], [side, side]], [[-3, 2], [side + 3, 5]]]
    walks += [rng.uniform(0, side, (9, 2)), rng.integers(0, side + 1, (9, 2)), rng.integers(0, 2 * side, (9, 2)) / 2]
    for points in walks:
        wanted = reference.path(points, side)
        for t, found in zip(turn, path(points, side, turn, device)):
            assert np.array_equal(found, reference.turned(wanted, t)), (points, t)


def test_drawing_in_small_pieces_changes_nothing(monkeypatch):
    rng, turn = np.random.default_rng(4), np.arange(8)
    shapes = [jagged(rng, int(n), rng.integers(0, 50, 2), 0.1, 9) for n in (3, 40, 300, 5)]
    layer, points = [0, 2, 0, 1], rng.uniform(0, 50, (30, 2))
    whole = polygons(shapes, 50, turn, layer=layer), path(points, 50, turn)
    for name, value in {"EDGES": 7, "PAIRS": 40, "CELLS": 3 * 3 * 50 * 50}.items():
        monkeypatch.setattr(drawing, name, value)
    assert np.array_equal(polygons(shapes, 50, turn, layer=layer), whole[0])
    assert np.array_equal(path(points, 50, turn), whole[1])


def test_the_eight_symmetries_differ_and_agree_with_those_of_grids():
    grid, i = torch.arange(25).view(5, 5), torch.arange(5)
    i, j = torch.meshgrid(i, i, indexing="ij")
    seen = set()
    for turn in range(8):
        found = torch.empty_like(grid)
        found[drawing.turned(i, j, torch.tensor(turn), 4)] = grid
        assert np.array_equal(found, reference.turned(grid.numpy(), turn))
        seen.add(found.numpy().tobytes())
    assert len(seen) == 8
