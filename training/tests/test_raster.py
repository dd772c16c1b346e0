"""The rasteriser, on cases whose answers are worked out by hand."""

import numpy as np

from nngtl_training import raster


def cells(marks):
    return sorted(map(tuple, np.argwhere(marks).tolist()))


def box(x0, y0, x1, y1):
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]


def test_a_rectangle_on_grid_lines_marks_its_own_cells_alone():
    assert cells(raster.polygon(box(1, 2, 3, 4), 6)) == [(1, 2), (1, 3), (2, 2), (2, 3)]


def test_less_than_the_tolerance_over_a_line_marks_nothing_more():
    assert cells(raster.polygon(box(1, 1, 2 + 1e-10, 2), 4)) == [(1, 1)]
    assert cells(raster.polygon(box(1, 1, 2 + 1e-6, 2), 4)) == [(1, 1), (2, 1)]


def test_a_polygon_inside_one_cell_marks_it():
    assert cells(raster.polygon([[2.1, 2.1], [2.3, 2.1], [2.2, 2.2]], 5)) == [(2, 2)]


def test_the_first_axis_is_x():
    assert cells(raster.polygon(box(0, 0, 3, 1), 4)) == [(0, 0), (1, 0), (2, 0)]


def test_a_triangle_marks_the_cells_on_its_hypotenuse_but_not_corners_beyond():
    # x + y ≤ 3: the cells on the diagonal are met, those that it touches in a corner are not.
    assert cells(raster.polygon([[0, 0], [3, 0], [0, 3]], 4)) == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (2, 0)]


def test_a_notch_of_a_non_convex_polygon_stays_free():
    u = [[0, 0], [5, 0], [5, 5], [4, 5], [4, 1], [1, 1], [1, 5], [0, 5]]
    free = {(i, j) for i in (1, 2, 3) for j in (1, 2, 3, 4)}
    assert set(cells(raster.polygon(u, 5))) == {(i, j) for i in range(5) for j in range(5)} - free


def test_orientation_does_not_matter():
    shape = [[0.3, 0.2], [7.7, 1.9], [5.1, 6.6], [3.2, 2.5]]
    assert np.array_equal(raster.polygon(shape, 8), raster.polygon(shape[::-1], 8))


def test_parts_outside_of_the_frame_are_cut_off():
    assert cells(raster.polygon(box(-3, -3, 1, 1), 4)) == [(0, 0)]
    assert not raster.polygon(box(5, 5, 6, 6), 4).any()


def test_random_polygons_agree_with_a_dense_sample_of_points():
    rng = np.random.default_rng(5)
    for _ in range(20):
        angles = np.sort(rng.uniform(0, 2 * np.pi, 7))
        radii = rng.uniform(1, 5, 7)
        shape = 6 + np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
        marks = raster.polygon(shape, 12)
        fine = (np.arange(12 * 40) + 0.5) / 40
        inside = raster._inside(shape, np.roll(shape, -1, axis=0), fine, fine)
        seen = inside.reshape(12, 40, 12, 40).any(axis=(1, 3))
        assert not (seen & ~marks).any()
        # What no sample saw can only be a sliver that an edge cuts from a cell.
        assert (marks & ~seen).sum() <= 6


def test_a_path_along_a_grid_line_marks_both_sides():
    assert cells(raster.path([[1, 2], [2.5, 2]], 4)) == [(i, j) for i in (0, 1, 2) for j in (1, 2)]


def test_a_diagonal_path_and_its_neighbours():
    marks = raster.path([[0.5, 0.5], [1.5, 0.5]], 4)
    assert cells(marks) == [(0, 0), (1, 0)]
    assert cells(raster.grow(marks)) == [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0)]


def test_a_single_point_is_a_path():
    assert cells(raster.path([[1.5, 2.5]], 4)) == [(1, 2)]


def test_codes_hold_obstacle_regions_and_the_outside():
    codes = raster.map_codes([box(0, 0, 0.25, 0.25)], [box(0.5, 0, 1, 0.25), box(0.75, 0, 1, 0.25)], (1.0, 0.5), 4)
    assert codes[0, 0] == 1 and codes[1, 0] == 0
    assert codes[2, 0] == 2 and codes[3, 0] == 2 + 4
    assert (codes[:, 2:] == 1).all() and (codes[:2, 1] == 0).all()


def test_the_start_cell_is_clamped():
    assert raster.cell((1.0, 0.0), 10) == (9, 0)
