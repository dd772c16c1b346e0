//! Moves and parts on small grids, by hand.

use super::*;
use crate::random::generator;
use crate::workspace::{Polygon, Region};

fn p(x: f64, y: f64) -> Point2<f64> {
    Point2::new(x, y)
}

fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Polygon {
    Polygon::rectangle(p(x0, y0), p(x1, y1)).unwrap()
}

/// Ten cells a side; a wall with a gap at the top, regions `a` (two cells) and `b` (one).
fn grid() -> Grid {
    let region = |name: &str, polygon| Region {
        name: name.to_owned(),
        polygon,
    };
    let map = Workspace::new(
        Bounds::unit(),
        vec![rectangle(0.4, 0.0, 0.5, 0.8)],
        vec![
            region("a", rectangle(0.2, 0.0, 0.3, 0.2)),
            region("b", rectangle(0.7, 0.0, 0.8, 0.1)),
        ],
    );
    Grid::new(Arc::new(map.unwrap()), [10, 10], 0.1, p(0.05, 0.05)).unwrap()
}

fn spot(grid: &Grid, i: usize, j: usize) -> Spot {
    grid.spots[i * 10 + j].unwrap()
}

#[test]
fn moves_pass_no_region_and_no_obstacle() {
    let g = grid();
    let step = |a: (usize, usize), b: (usize, usize)| {
        let (a, b) = (spot(&g, a.0, a.1), spot(&g, b.0, b.1));
        assert_eq!(g.step(&a, &b), g.step(&b, &a), "moves are reversible");
        g.step(&a, &b)
    };
    assert!(step((0, 0), (2, 0)), "into a region");
    assert!(!step((0, 0), (3, 0)), "through a region");
    assert!(
        step((2, 0), (2, 1)) && step((2, 0), (2, 9)),
        "inside and out"
    );
    assert!(!step((3, 0), (5, 0)), "through the wall");
    assert!(
        step((0, 8), (9, 8)) && step((0, 9), (9, 9)),
        "above the wall"
    );
    assert!(!step((0, 0), (1, 1)), "diagonally");
    assert!(step((3, 3), (3, 3)), "staying");
    let mut all = Vec::new();
    for a in g.free_spots() {
        assert!(g.neighbours(&a, &mut all));
        for b in g.free_spots() {
            assert_eq!(g.step(&a, &b), a == b || all.contains(&b), "{a:?} {b:?}");
        }
    }
}

#[test]
fn two_regions_with_nothing_between_are_one_move_apart() {
    let map = Workspace::new(
        Bounds::unit(),
        vec![],
        vec![
            Region {
                name: "a".to_owned(),
                polygon: rectangle(0.0, 0.0, 0.1, 0.1),
            },
            Region {
                name: "b".to_owned(),
                polygon: rectangle(0.5, 0.0, 0.6, 0.1),
            },
        ],
    );
    let g = Grid::new(Arc::new(map.unwrap()), [10, 10], 0.1, p(0.05, 0.05)).unwrap();
    assert!(g.step(&spot(&g, 0, 0), &spot(&g, 5, 0)));
    assert!(!g.step(&spot(&g, 0, 0), &spot(&g, 6, 0)));
}

#[test]
fn parts_have_one_landmark_each() {
    let g = grid();
    let alphabet = g.alphabet();
    let a = alphabet.letter(Props::single(0)).unwrap();
    let b = alphabet.letter(Props::single(1)).unwrap();
    assert_eq!((g.landmarks(a).len(), g.landmarks(b).len()), (1, 1));
    assert!((g.landmarks(a)[0].area - 0.02).abs() < 1e-12);
    assert_eq!(g.part(&spot(&g, 2, 1)), Some(0));
    assert!(g.reachable().is_all());
}

#[test]
fn paths_lead_around_regions_and_walls() {
    let g = grid();
    let goal = spot(&g, 7, 0).at;
    let mut at = g.start().at;
    let mut length = 0.0;
    for _ in 0..20 {
        if at == goal {
            break;
        }
        let Leg {
            to: next,
            length: left,
        } = g.first_leg(at, goal, true).unwrap();
        // Up eight, right seven, down eight.
        assert!((left + length - 2.3).abs() < 1e-9, "{left} {length}");
        let (from, to) = (g.settle(at).unwrap(), g.settle(next).unwrap());
        assert!(g.step(&from, &to), "{from:?} {to:?}");
        length += g.distance(at, next);
        at = next;
    }
    assert_eq!(at, goal);
    assert!((length - 2.3).abs() < 1e-9, "{length}");
}

#[test]
fn samples_are_free_centres() {
    let g = grid();
    let mut random = generator(3, 0);
    for _ in 0..200 {
        let at = g.sample_free(&mut random);
        assert_eq!(g.settle(at).unwrap().at, at);
    }
    let b = g.alphabet().letter(Props::single(1)).unwrap();
    assert_eq!(g.sample_letter(b, &mut random), spot(&g, 7, 0).at);
}

#[test]
fn bad_grids_are_refused_with_the_reason() {
    let map = Arc::clone(grid().map());
    let new = |cells, cell, start| Grid::new(Arc::clone(&map), cells, cell, start).unwrap_err();
    let corner = p(0.05, 0.05);
    assert!(matches!(new([0, 3], 0.1, corner), GridError::Cells { .. }));
    assert!(matches!(
        new([9, 10], 0.1, corner),
        GridError::Extent { .. }
    ));
    assert!(matches!(
        new([10, 10], f64::NAN, corner),
        GridError::Side { .. }
    ));
    let off = new([10, 10], 0.1, p(0.1, 0.05));
    assert!(off.to_string().contains("nearest"), "{off}");
    let wall = new([10, 10], 0.1, p(0.45, 0.05));
    assert!(matches!(wall, GridError::Blocked { .. }));
}

#[test]
fn fingerprints_tell_maps_and_grids_apart() {
    let g = grid();
    let fine = Grid::new(Arc::clone(g.map()), [20, 20], 0.05, p(0.025, 0.025)).unwrap();
    assert_eq!(g.fingerprint(), grid().fingerprint());
    assert_ne!(g.fingerprint(), fine.fingerprint());
}
