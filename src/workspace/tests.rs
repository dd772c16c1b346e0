use super::visibility::VisibilityGraph;
use super::*;
use crate::random::{generator, unit};

fn p(x: f64, y: f64) -> Point2<f64> {
    Point2::new(x, y)
}

fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Polygon {
    Polygon::rectangle(p(x0, y0), p(x1, y1)).unwrap()
}

fn region(name: &str, polygon: Polygon) -> Region {
    Region {
        name: name.to_owned(),
        polygon,
    }
}

fn map(obstacles: Vec<Polygon>, regions: Vec<Region>) -> Workspace {
    Workspace::new(Bounds::unit(), obstacles, regions).unwrap()
}

fn letters(map: &Workspace, a: Point2<f64>, b: Point2<f64>) -> Vec<String> {
    let stretches = map.trace(a, b).unwrap();
    stretches
        .iter()
        .map(|s| map.alphabet().show(s.letter))
        .collect()
}

#[test]
fn only_letters_that_occur_are_letters() {
    let overlapping = map(
        vec![rectangle(0.45, 0.0, 0.55, 1.0)],
        vec![
            region("a", rectangle(0.1, 0.1, 0.4, 0.4)),
            region("b", rectangle(0.3, 0.3, 0.6, 0.6)),
            region("hidden", rectangle(0.46, 0.7, 0.54, 0.8)),
            region("outside", rectangle(1.5, 0.7, 1.6, 0.8)),
        ],
    );
    let shown: Vec<String> = overlapping
        .alphabet()
        .letters()
        .map(|l| overlapping.alphabet().show(l))
        .collect();
    assert_eq!(shown, ["{}", "{a}", "{b}", "{a,b}"]);
    assert_eq!(overlapping.hidden_regions(), ["hidden", "outside"]);
    assert_eq!(overlapping.overlapping_regions(), [(0, 1)]);
    // b lies on both sides of the wall: two cells.
    let b = overlapping.letter_at(p(0.42, 0.5)).unwrap();
    assert_eq!(overlapping.cells(b).len(), 2);
}

/// A landmark of ten centimetres in a city of ten kilometres, and a street as narrow.
#[test]
fn small_regions_of_large_maps_can_be_visited_and_crossed() {
    for side in [1e-3, 1.0, 1e4, 1e6] {
        let at = |x: f64, y: f64| p(x * side, y * side);
        let square = |x: f64, y: f64, w: f64, h: f64| {
            Polygon::rectangle(at(x, y), at(x + w, y + h)).unwrap()
        };
        let bounds = Bounds {
            min: at(0.0, 0.0),
            max: at(1.0, 1.0),
        };
        let regions = vec![
            region("a", square(0.9, 0.5, 1e-5, 1e-5)),
            region("street", square(0.1, 0.7, 0.5, 1e-6)),
        ];
        let map = Workspace::new(bounds, vec![], regions).unwrap();
        assert!(map.hidden_regions().is_empty(), "{side}");
        let inside = at(0.9 + 5e-6, 0.5 + 5e-6);
        let letter = map.letter_at(inside).unwrap();
        assert_eq!(map.alphabet().show(letter), "{a}");
        assert!(map.step(at(0.1, 0.3), inside));
        let through = map.trace(at(0.3, 0.6), at(0.3, 0.8)).unwrap();
        assert_eq!(through.len(), 3, "{side}");
    }
}

#[test]
fn traces_name_letters_of_positive_length_only() {
    let m = map(
        vec![],
        vec![
            region("a", rectangle(0.2, 0.2, 0.4, 0.4)),
            region("b", rectangle(0.4, 0.2, 0.6, 0.4)),
        ],
    );
    assert_eq!(
        letters(&m, p(0.1, 0.3), p(0.7, 0.3)),
        ["{}", "{a}", "{b}", "{}"]
    );
    // Along a border, and over a corner.
    assert_eq!(letters(&m, p(0.1, 0.2), p(0.7, 0.2)), ["{}"]);
    assert_eq!(letters(&m, p(0.1, 0.3), p(0.3, 0.1)), ["{}"]);
    assert_eq!(letters(&m, p(0.3, 0.3), p(0.35, 0.35)), ["{a}"]);
    assert!(m.step(p(0.3, 0.3), p(0.5, 0.3)), "a to b at once");
    assert!(!m.step(p(0.1, 0.3), p(0.5, 0.3)), "over a to b");
    assert!(m.step(p(0.1, 0.2), p(0.7, 0.2)));
    // The letters of both ends count, also on a border, which no stretch begins with.
    let along = |a, b| {
        let [from, to] = [a, b].map(|p| m.letter_at(p).unwrap());
        let letters = m.letters_along(a, from, b, to).unwrap();
        let names = letters.iter().map(|&l| m.alphabet().show(l));
        names.collect::<Vec<_>>()
    };
    assert_eq!(along(p(0.1, 0.3), p(0.5, 0.3)), ["{}", "{a}", "{b}"]);
    assert_eq!(along(p(0.2, 0.3), p(0.7, 0.3)), ["{}", "{a}", "{b}", "{}"]);
}

#[test]
fn a_concave_region_can_be_left_and_entered_again() {
    let u = Polygon::new(vec![
        p(0.2, 0.2),
        p(0.8, 0.2),
        p(0.8, 0.8),
        p(0.6, 0.8),
        p(0.6, 0.4),
        p(0.4, 0.4),
        p(0.4, 0.8),
        p(0.2, 0.8),
    ])
    .unwrap();
    let m = map(vec![], vec![region("u", u)]);
    assert_eq!(letters(&m, p(0.3, 0.6), p(0.7, 0.6)), ["{u}", "{}", "{u}"]);
    assert!(!m.step(p(0.3, 0.6), p(0.7, 0.6)));
    assert!(m.step(p(0.3, 0.3), p(0.7, 0.3)));
}

#[test]
fn obstacles_are_open_but_leave_no_gap_where_they_touch() {
    let m = map(
        vec![rectangle(0.2, 0.2, 0.4, 0.8), rectangle(0.4, 0.2, 0.6, 0.8)],
        vec![],
    );
    assert!(
        m.is_free_segment(p(0.2, 0.0), p(0.2, 1.0)),
        "along the left wall"
    );
    assert!(
        m.is_free_segment(p(0.0, 0.0), p(0.2, 0.2)),
        "touching a corner"
    );
    assert!(
        !m.is_free_segment(p(0.4, 0.0), p(0.4, 1.0)),
        "between the two"
    );
    assert!(!m.is_free_segment(p(0.0, 0.5), p(1.0, 0.5)));
    assert!(
        !m.is_free_segment(p(0.0, 0.5), p(0.0, 1.5)),
        "out of bounds"
    );
    assert!(!m.is_free_segment(p(0.3, 0.3), p(0.3, 0.3)), "inside");
    assert!(matches!(
        m.trace(p(0.0, 0.5), p(1.0, 0.5)),
        Err(Blocked { by: Some(_), .. })
    ));
}

#[test]
fn samples_lie_where_they_should() {
    let m = map(
        vec![rectangle(0.0, 0.45, 0.9, 0.55)],
        vec![
            region("a", rectangle(0.1, 0.1, 0.3, 0.3)),
            region("b", rectangle(0.2, 0.2, 0.5, 0.6)),
        ],
    );
    let mut random = generator(3, 0);
    let mut above = 0;
    for _ in 0..4_000 {
        let q = m.sample_free(&mut random);
        assert!(matches!(
            m.locate(q),
            Place::Free {
                on_boundary: false,
                ..
            }
        ));
        above += usize::from(q.y > 0.5);
    }
    assert!((1_800..2_200).contains(&above), "uniform by area: {above}");
    for letter in m.alphabet().letters() {
        for _ in 0..200 {
            assert_eq!(
                m.letter_at(m.sample_letter(letter, &mut random)),
                Some(letter)
            );
        }
        for cell in m.cells(letter) {
            assert_eq!(m.letter_at(cell.inner_point()), Some(letter));
        }
    }
}

#[test]
fn nowhere_to_be_is_an_error() {
    let full = Workspace::new(
        Bounds::unit(),
        vec![rectangle(-1.0, -1.0, 2.0, 2.0)],
        vec![],
    );
    assert!(matches!(full, Err(WorkspaceError::NoFreeSpace)));
    let inverted = Bounds {
        min: p(1.0, 0.0),
        max: p(0.0, 1.0),
    };
    assert!(matches!(
        Workspace::new(inverted, vec![], vec![]),
        Err(WorkspaceError::BadBounds { .. })
    ));
}

#[test]
fn large_offsets_keep_their_precision() {
    let bounds = Bounds {
        min: p(1e6, -1e6),
        max: p(1e6 + 1.0, -1e6 + 1.0),
    };
    let o = rectangle(1e6 + 0.3, -1e6 + 0.3, 1e6 + 0.6, -1e6 + 0.6);
    let m = Workspace::new(bounds, vec![o], vec![]).unwrap();
    assert!(!m.is_free_segment(p(1e6 + 0.1, -1e6 + 0.45), p(1e6 + 0.9, -1e6 + 0.45)));
    assert!(m.is_free_segment(p(1e6 + 0.1, -1e6 + 0.3), p(1e6 + 0.9, -1e6 + 0.3)));
}

#[test]
fn shortest_paths_bend_at_corners() {
    let m = Arc::new(map(vec![rectangle(0.4, 0.0, 0.6, 0.8)], vec![]));
    let graph = VisibilityGraph::new(m);
    let paths = graph.paths_to(p(0.9, 0.1));
    let path = paths.path(&graph, p(0.1, 0.1)).unwrap();
    assert_eq!(path, [p(0.1, 0.1), p(0.4, 0.8), p(0.6, 0.8), p(0.9, 0.1)]);
    let (length, first) = paths.first_leg(&graph, p(0.1, 0.1)).unwrap();
    assert_eq!(first, p(0.4, 0.8));
    let expected = 2.0 * (0.09_f64 + 0.49).sqrt() + 0.2;
    assert!((length - expected).abs() < 1e-12);
    assert_eq!(paths.first_leg(&graph, p(0.9, 0.9)).unwrap().1, p(0.9, 0.1));
}

#[test]
fn walled_in_targets_have_no_path() {
    let walls = vec![
        rectangle(0.2, 0.2, 0.8, 0.3),
        rectangle(0.2, 0.7, 0.8, 0.8),
        rectangle(0.2, 0.2, 0.3, 0.8),
        rectangle(0.7, 0.2, 0.8, 0.8),
    ];
    let graph = VisibilityGraph::new(Arc::new(map(walls, vec![])));
    let paths = graph.paths_to(p(0.5, 0.5));
    assert!(paths.first_leg(&graph, p(0.1, 0.1)).is_none());
    assert!(paths.first_leg(&graph, p(0.6, 0.6)).is_some());
}

/// Traces agree with dense point sampling on random maps.
#[test]
fn traces_agree_with_points_on_random_maps() {
    for seed in 0..60 {
        let mut random = generator(seed, 0);
        let mut some = |n: usize, name: &str| -> Vec<(String, Polygon)> {
            (0..n)
                .filter_map(|i| {
                    let c = p(unit(&mut random), unit(&mut random));
                    let corners = (0..3 + i % 5).map(|k| {
                        let angle = std::f64::consts::TAU * (k as f64) / (3 + i % 5) as f64;
                        let r = 0.02 + 0.2 * unit(&mut random);
                        p(c.x + r * libm::cos(angle), c.y + r * libm::sin(angle))
                    });
                    Polygon::new(corners.collect())
                        .ok()
                        .map(|q| (format!("{name}{i}"), q))
                })
                .collect()
        };
        let obstacles = some(4, "o").into_iter().map(|(_, q)| q).collect();
        let regions = some(5, "l")
            .iter()
            .map(|(n, q)| region(n, q.clone()))
            .collect();
        let Ok(m) = Workspace::new(Bounds::unit(), obstacles, regions) else {
            continue;
        };
        for _ in 0..40 {
            let (a, b) = (m.sample_free(&mut random), m.sample_free(&mut random));
            let points: Vec<Point2<f64>> = (0..=2000)
                .map(|i| a + (b - a) * (f64::from(i) / 2000.0))
                .collect();
            let blocked = points
                .iter()
                .any(|&q| matches!(m.locate(q), Place::Obstacle(_)));
            match m.trace(a, b) {
                Err(hit) => assert!(
                    hit.by.is_some() && matches!(m.locate(hit.at), Place::Obstacle(_)),
                    "seed {seed}: {hit:?}"
                ),
                Ok(stretches) => {
                    assert!(!blocked, "seed {seed}: {a} to {b} runs through an obstacle");
                    for (i, q) in points.iter().enumerate() {
                        let t = i as f64 / 2000.0;
                        let Place::Free {
                            letter,
                            on_boundary: false,
                        } = m.locate(*q)
                        else {
                            continue;
                        };
                        let k = stretches.iter().rposition(|s| s.start <= t).unwrap();
                        assert_eq!(stretches[k].letter, letter, "seed {seed}: at {q}");
                    }
                }
            }
        }
    }
}

/// A square with a border of many teeth, so that it is searched in bands.
fn comb(teeth: usize) -> Polygon {
    let mut points = vec![p(0.1, 0.9), p(0.1, 0.1)];
    for i in 0..teeth {
        let x = |k: f64| 0.1 + 0.8 * (i as f64 + k) / teeth as f64;
        points.extend([
            p(x(0.3), 0.1),
            p(x(0.3), 0.8),
            p(x(0.7), 0.8),
            p(x(0.7), 0.1),
        ]);
    }
    points.extend([p(0.9, 0.1), p(0.9, 0.9)]);
    Polygon::new(points).unwrap()
}

#[test]
fn bands_change_no_answer() {
    let polygon = comb(40);
    let m = map(vec![polygon.clone()], vec![]);
    let mut random = generator(5, 0);
    for i in 0..20_000 {
        let mut q = p(unit(&mut random), unit(&mut random));
        if i % 3 == 0 {
            q.y = [0.1, 0.8, 0.9, 0.8 + 5e-10][i / 3 % 4];
        }
        let slow = polygon.side_of(q, m.tolerance());
        assert_eq!(m.obstacle_side(0, q), slow, "{q}");
    }
}

/// The length of the shortest path by brute force: every pair of corners is tested.
fn brute_force(m: &Workspace, a: Point2<f64>, b: Point2<f64>) -> Option<f64> {
    let mut nodes: Vec<Point2<f64>> = m
        .obstacles()
        .iter()
        .flat_map(|o| o.vertices().iter().copied())
        .filter(|&c| m.letter_at(c).is_some())
        .collect();
    nodes.extend([a, b]);
    let n = nodes.len();
    let mut length = vec![f64::INFINITY; n];
    let mut done = vec![false; n];
    length[n - 2] = 0.0;
    loop {
        let open = (0..n).filter(|&i| !done[i] && length[i].is_finite());
        let i = open.min_by(|&i, &j| length[i].total_cmp(&length[j]))?;
        if i == n - 1 {
            return Some(length[i]);
        }
        done[i] = true;
        for j in 0..n {
            let through = length[i] + (nodes[j] - nodes[i]).norm();
            if !done[j] && through < length[j] && m.is_free_segment(nodes[i], nodes[j]) {
                length[j] = through;
            }
        }
    }
}

/// Shortest paths and connectedness agree with brute force, on random obstacles that overlap and on
/// rectangles on a coarse grid, which touch along borders and at corners.
#[test]
fn shortest_paths_agree_with_brute_force() {
    let (mut joined, mut apart) = (0, 0);
    for seed in 0..150 {
        let mut random = generator(seed, 9);
        let mut obstacles = Vec::new();
        for i in 0..14 {
            let mut draw = || unit(&mut random);
            let polygon = if seed % 2 == 0 {
                let (x, y) = ((draw() * 8.0).floor() / 8.0, (draw() * 8.0).floor() / 8.0);
                let (w, h) = if draw() < 0.5 {
                    (0.375, 0.125)
                } else {
                    (0.125, 0.375)
                };
                Ok(rectangle(x, y, x + w, y + h))
            } else {
                let c = p(draw(), draw());
                let corners = (0..3 + i % 4).map(|k| {
                    let angle = std::f64::consts::TAU * k as f64 / (3 + i % 4) as f64;
                    let r = 0.05 + 0.25 * draw();
                    p(c.x + r * libm::cos(angle), c.y + r * libm::sin(angle))
                });
                Polygon::new(corners.collect())
            };
            obstacles.extend(polygon);
        }
        let Ok(m) = Workspace::new(Bounds::unit(), obstacles, vec![]) else {
            continue;
        };
        let m = Arc::new(m);
        let graph = VisibilityGraph::new(Arc::clone(&m));
        for _ in 0..6 {
            let (a, b) = (m.sample_free(&mut random), m.sample_free(&mut random));
            let paths = graph.paths_to(b);
            let found = paths.first_leg(&graph, a);
            let expected = brute_force(&m, a, b);
            let same = graph.component_at(a) == graph.component_at(b);
            assert_eq!(
                expected.is_some(),
                same,
                "seed {seed}: {a} to {b}: {:?}",
                paths.path(&graph, a)
            );
            assert_eq!(graph.between(a, b).is_none(), same);
            match (found, expected) {
                (Some((length, bend)), Some(expected)) => {
                    assert!(
                        (length - expected).abs() < 1e-7,
                        "seed {seed}: {a} to {b}: {length} {expected}"
                    );
                    let (same, leg) = graph.first_leg(a, b).unwrap();
                    assert!((same - length).abs() < 1e-7, "seed {seed}: {same} {length}");
                    let path = graph.path(a, b).unwrap();
                    let legs = path.windows(2);
                    assert!(legs.clone().all(|w| m.is_free_between(w[0], w[1])));
                    let walked: f64 = legs.map(|w| (w[1] - w[0]).norm()).sum();
                    assert!((walked - length).abs() < 1e-7, "seed {seed}: {path:?}");
                    assert_eq!((path[0], path[path.len() - 1]), (a, b));
                    let rest = |via: Point2<f64>| {
                        (via - a).norm() + paths.first_leg(&graph, via).map_or(0.0, |l| l.0)
                    };
                    assert!(
                        (rest(leg) - rest(bend)).abs() < 1e-7,
                        "seed {seed}: {leg} or {bend}"
                    );
                    joined += 1;
                }
                (None, None) => {
                    assert!(graph.first_leg(a, b).is_none());
                    apart += 1;
                }
                other => panic!("seed {seed}: {a} to {b}: {other:?}"),
            }
        }
    }
    assert!(joined > 300 && apart > 50, "{joined} joined, {apart} apart");
}

#[test]
fn walls_are_named() {
    let walls = vec![
        rectangle(0.05, 0.05, 0.1, 0.1), // far away
        rectangle(0.2, 0.2, 0.8, 0.3),
        rectangle(0.2, 0.7, 0.8, 0.8),
        rectangle(0.2, 0.3, 0.3, 0.7),
        rectangle(0.7, 0.3, 0.8, 0.7),
        rectangle(0.45, 0.45, 0.5, 0.5), // inside
    ];
    let vault = region("vault", rectangle(0.55, 0.55, 0.65, 0.65));
    let m = Arc::new(map(walls, vec![vault]));
    let graph = VisibilityGraph::new(m);
    let (outside, inside) = (p(0.9, 0.9), p(0.6, 0.6));
    let e = graph.between(outside, inside).unwrap();
    assert_eq!((e.first, e.bounds), (false, false));
    assert_eq!(e.obstacles, [1, 2, 3, 4]);
    assert_eq!(e.regions, [0]);
    assert!((e.area - (0.16 - 0.0025)).abs() < 1e-9);
    let turned = graph.between(inside, outside).unwrap();
    assert_eq!((turned.first, turned.obstacles), (true, e.obstacles));
    assert!(graph.between(outside, p(0.01, 0.5)).is_none());

    // A corner of the map is cut off by one obstacle and the bounds.
    let m = Arc::new(map(vec![rectangle(0.4, -1.0, 0.5, 2.0)], vec![]));
    let graph = VisibilityGraph::new(m);
    let e = graph.between(p(0.1, 0.5), p(0.9, 0.5)).unwrap();
    assert_eq!((e.first, e.bounds, e.obstacles), (true, true, vec![0]));
}

#[test]
fn shortest_paths_do_not_depend_on_what_was_asked_before() {
    // A lattice of a thousand squares: a wavefront that has not got far, and one that has got everywhere.
    let squares = (0..1_024).map(|k| {
        let (x, y) = (f64::from(k % 32) / 32.0, f64::from(k / 32) / 32.0);
        rectangle(x + 0.01, y + 0.01, x + 0.022, y + 0.02)
    });
    let m = Arc::new(map(squares.collect(), vec![]));
    let graph = VisibilityGraph::new(Arc::clone(&m));
    let mut random = generator(3, 0);
    let target = m.sample_free(&mut random);
    let (early, late) = (graph.paths_to(target), graph.paths_to(target));
    for corner in [p(0.001, 0.001), p(0.999, 0.001), p(0.001, 0.999)] {
        assert!(late.first_leg(&graph, corner).is_some());
    }
    let mut bends = 0;
    for _ in 0..300 {
        let from = m.sample_free(&mut random);
        let leg = early.first_leg(&graph, from);
        assert_eq!(leg, late.first_leg(&graph, from));
        let (length, first) = leg.unwrap();
        let path = early.path(&graph, from).unwrap();
        assert_eq!(path[1], first);
        assert!(path.windows(2).all(|leg| m.is_free_segment(leg[0], leg[1])));
        let sum: f64 = path.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
        assert!((sum - length).abs() < 1e-12 && length >= (target - from).norm());
        // Asked once, from the other end, the length is the same.
        let back = graph.paths_to(from).first_leg(&graph, target).unwrap().0;
        assert!((back - length).abs() < 1e-12);
        let (all, once) = graph.first_leg(from, target).unwrap();
        assert!((all - length).abs() < 1e-12);
        let rest = early.first_leg(&graph, once).map_or(0.0, |l| l.0);
        assert!(((once - from).norm() + rest - length).abs() < 1e-12);
        bends += path.len() - 2;
    }
    assert!(bends > 300, "{bends}");
}

#[test]
fn places_at_corners_lie_in_the_cell_and_are_few() {
    let round = |n: usize| -> Vec<Point2<f64>> {
        let corner = |k: usize| {
            let (sin, cos) = (k as f64 / n as f64 * std::f64::consts::TAU).sin_cos();
            p(0.5 + 0.2 * cos, 0.5 + 0.2 * sin)
        };
        (0..n).map(corner).collect()
    };
    let hook = [
        (0.1, 0.1),
        (0.9, 0.1),
        (0.9, 0.2),
        (0.2, 0.2),
        (0.2, 0.9),
        (0.1, 0.9),
    ];
    let outlines = [
        round(3),
        round(16),
        round(17),
        round(100),
        hook.map(|(x, y)| p(x, y)).to_vec(),
    ];
    for (outline, count) in outlines.into_iter().zip([3, 16, 9, 15, 6]) {
        let polygon = Polygon::new(outline.clone()).unwrap();
        let m = map(vec![], vec![region("a", polygon)]);
        let letter = m
            .alphabet()
            .letters()
            .find(|&l| !m.alphabet().props(l).is_empty());
        let [cell] = m.cells(letter.unwrap()) else {
            panic!("one cell");
        };
        assert_eq!(cell.corner_count(), count);
        for k in 0..count {
            let at = cell.corner(k).unwrap();
            let off = |c: &Point2<f64>| (c - at).norm();
            let nearest = outline.iter().map(off).fold(f64::INFINITY, f64::min);
            assert!(cell.contains(at) && m.letter_at(at) == letter && nearest < 0.02);
        }
        assert!(cell.corner(count).is_none());
    }
}

/// Cells of many holes are cut in another way than those of few, into what covers the same.
#[test]
fn cells_of_many_holes_are_covered_by_their_triangles() {
    let square = |k: usize| {
        let (x, y) = (0.05 + 0.09 * (k % 10) as f64, 0.05 + 0.09 * (k / 10) as f64);
        // Some touch at a corner, some along a side.
        let side = [0.05, 0.09, 0.03][k % 3];
        rectangle(x, y, x + side, y + 0.05)
    };
    let m = map(
        (0..100).map(square).collect(),
        vec![region("a", rectangle(0.0, 0.0, 0.02, 0.02))],
    );
    let free: f64 = m
        .alphabet()
        .letters()
        .flat_map(|l| m.cells(l))
        .map(|c| c.area())
        .sum();
    let covered: f64 = (0..100).map(|k| 0.05 * [0.05, 0.09, 0.03][k % 3]).sum();
    assert!((free - (1.0 - covered)).abs() < 1e-6, "{free}, {covered}");
    // By that way alone, where nothing stands in for it.
    let open = m.alphabet().letters().flat_map(|l| m.cells(l));
    let largest = open.max_by(|a, b| a.area().total_cmp(&b.area())).unwrap();
    assert!(largest.outline().len() > 50, "{}", largest.outline().len());
    let area = |[a, b, c]: &[Point2<f64>; 3]| (b - a).perp(&(c - a)).abs() / 2.0;
    let cut: f64 = mesh::cut(largest.outline()).iter().map(area).sum();
    assert!((cut - largest.area()).abs() < 1e-9, "{cut}");
    let mut random = generator(8, 0);
    let mut low = 0;
    for _ in 0..4_000 {
        let q = m.sample_free(&mut random);
        assert!(m.letter_at(q).is_some(), "{q}");
        low += usize::from(q.y < 0.05);
    }
    let expected = 4_000.0 * 0.05 / (1.0 - covered);
    assert!(
        (low as f64 - expected).abs() < 0.25 * expected,
        "{low}, {expected}"
    );
}

/// Ways of equal length abound in a lattice, and corners lie on one line.
#[test]
fn ways_by_corners_are_those_by_windows() {
    let side = 30;
    let step = 1.0 / f64::from(side);
    let square = |k: u32| {
        let [x, y] = [k / side, k % side].map(|i| (f64::from(i) + 0.25) * step);
        rectangle(x, y, x + 0.5 * step, y + 0.5 * step)
    };
    let map = Arc::new(map((0..side * side).map(square).collect(), vec![]));
    let graph = VisibilityGraph::new(Arc::clone(&map));
    let mut random = generator(5, 0);
    for _ in 0..2 {
        let target = map.sample_free(&mut random);
        let (paths, by_windows) = (graph.paths_by_corners(target), graph.paths_to(target));
        assert!(!by_windows.condense(&graph));
        let size = paths.size();
        let mut asked = Vec::new();
        for _ in 0..60 {
            let from = map.sample_free(&mut random);
            let found = paths.first_leg(&graph, from).unwrap();
            let (length, _) = by_windows.first_leg(&graph, from).unwrap();
            assert!(
                (found.0 - length).abs() < 1e-9,
                "{from} {target}: {found:?}"
            );
            assert!(map.is_free_between(from, found.1), "{from} {target}");
            asked.push((from, found));
        }
        let grown = paths.size();
        assert!(grown > 2 * size);
        assert!(paths.condense(&graph) && paths.size() <= size);
        assert!(
            !paths.condense(&graph),
            "there is nothing more to leave out"
        );
        for (from, found) in asked {
            assert_eq!(paths.first_leg(&graph, from).unwrap(), found, "{from}");
        }
    }
}
