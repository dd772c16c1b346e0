//! What the conversion of cells to polygons guarantees, on random maps.

use std::path::Path;
use std::sync::Arc;

use nalgebra::Point2;
use nngtl::maps::outline::Cells;
use nngtl::maps::split::split;
use nngtl::maps::{self, Format, MapOptions};
use nngtl::random::{generator, unit};
use nngtl::workspace::visibility::VisibilityGraph;
use nngtl::workspace::{Place, Workspace};

/// Random cells: noise, smoothed noise, or walls of a maze.
fn cells(seed: u64) -> Cells {
    let mut random = generator(seed, 3);
    let (width, height) = (
        1 + (unit(&mut random) * 24.0) as usize,
        1 + (unit(&mut random) * 24.0) as usize,
    );
    let share = 0.15 + 0.5 * unit(&mut random);
    let mut occupied: Vec<bool> = (0..width * height)
        .map(|_| unit(&mut random) < share)
        .collect();
    for _ in 0..seed % 3 {
        let at = |x: i64, y: i64| {
            let inside = x >= 0 && y >= 0 && x < width as i64 && y < height as i64;
            !inside || occupied[y as usize * width + x as usize]
        };
        occupied = (0..width * height)
            .map(|i| {
                let (x, y) = ((i % width) as i64, (i / width) as i64);
                let around = (-1..=1).flat_map(|i| (-1..=1).map(move |j| (x + i, y + j)));
                around.filter(|&(x, y)| at(x, y)).count() >= 5
            })
            .collect();
    }
    Cells {
        width,
        height,
        occupied,
    }
}

/// The same as a MovingAI map.
fn text(cells: &Cells) -> String {
    let mut text = format!(
        "type octile\nheight {}\nwidth {}\nmap\n",
        cells.height, cells.width
    );
    for y in (0..cells.height).rev() {
        for x in 0..cells.width {
            text.push(if cells.occupied[y * cells.width + x] {
                '@'
            } else {
                '.'
            });
        }
        text.push('\n');
    }
    text
}

/// For each cell the number of the part of free cells, connected across sides, that it is in.
fn parts(cells: &Cells) -> Vec<Option<usize>> {
    let mut part = vec![None; cells.occupied.len()];
    for start in 0..part.len() {
        if cells.occupied[start] || part[start].is_some() {
            continue;
        }
        part[start] = Some(start);
        let mut open = vec![start];
        while let Some(cell) = open.pop() {
            let (x, y) = ((cell % cells.width) as i64, (cell / cells.width) as i64);
            for (i, j) in [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)] {
                let inside = i >= 0 && j >= 0 && i < cells.width as i64 && j < cells.height as i64;
                let other = j.max(0) as usize * cells.width + i.max(0) as usize;
                if inside && !cells.occupied[other] && part[other].is_none() {
                    part[other] = Some(start);
                    open.push(other);
                }
            }
        }
    }
    part
}

fn workspace(cells: &Cells, tolerance: f64) -> Option<Workspace> {
    let options = MapOptions {
        tolerance: Some(tolerance),
        ..MapOptions::default()
    };
    let text = text(cells);
    let map = maps::read(
        Path::new("random.map"),
        Format::MovingAi,
        text.as_bytes(),
        &options,
        &mut |_| unreachable!("a grid names no picture"),
    );
    let map = map.unwrap_or_else(|e| panic!("{e}\n{text}"));
    Workspace::new(map.bounds, map.obstacles, Vec::new()).ok()
}

/// Every occupied centre stays occupied, every free centre free; moves between free neighbours stay
/// possible, also diagonal ones past free corners; and what is connected stays as it was.
#[test]
fn outlines_keep_what_they_promise() {
    let scale = std::env::var("NNGTL_TEST_SCALE").ok();
    let scale: f64 = scale.and_then(|s| s.parse().ok()).unwrap_or(1.0);
    let mut compared = 0;
    for seed in 0..(300.0 * scale) as u64 {
        let cells = cells(seed);
        let tolerance = [0.0, 0.2, 0.45, 0.49][seed as usize % 4];
        let Some(map) = workspace(&cells, tolerance) else {
            assert!(cells.occupied.iter().all(|&o| o), "seed {seed}");
            continue;
        };
        let context = || format!("seed {seed}, tolerance {tolerance}\n{}", text(&cells));
        let graph = VisibilityGraph::new(Arc::new(map));
        let map = graph.map();
        let centre = |i: usize| {
            let (x, y) = (i % cells.width, i / cells.width);
            Point2::new(x as f64 + 0.5, y as f64 + 0.5)
        };
        let part = parts(&cells);
        let mut known: Vec<(usize, u32)> = Vec::new();
        for i in 0..cells.occupied.len() {
            let place = map.locate(centre(i));
            let free = matches!(place, Place::Free { .. });
            assert_eq!(free, !cells.occupied[i], "cell {i}, {}", context());
            let Some(part) = part[i] else { continue };
            let component = graph.component_at(centre(i)).unwrap();
            known.push((part, component));
            for (dx, dy) in [(1, 0), (0, 1), (1, 1), (-1, 1)] {
                let (x, y) = ((i % cells.width) as i64, (i / cells.width) as i64);
                let free = |x: i64, y: i64| {
                    x >= 0
                        && x < cells.width as i64
                        && y < cells.height as i64
                        && !cells.is_occupied(x, y)
                };
                if free(x + dx, y + dy) && free(x + dx, y) && free(x, y + dy) {
                    let to = Point2::new((x + dx) as f64 + 0.5, (y + dy) as f64 + 0.5);
                    assert!(
                        map.is_free_segment(centre(i), to),
                        "{i} to {to}, {}",
                        context()
                    );
                    compared += 1;
                }
            }
        }
        known.sort_unstable();
        known.dedup();
        for pair in known.windows(2) {
            assert_ne!(pair[0].0, pair[1].0, "one part became two, {}", context());
        }
        known.sort_unstable_by_key(|k| k.1);
        for pair in known.windows(2) {
            assert_ne!(pair[0].1, pair[1].1, "two parts became one, {}", context());
        }
    }
    assert!(compared > 5_000, "{compared}");
}

/// Outlines stay within the tolerance of the cells' borders, and simplification does something.
#[test]
fn outlines_stay_within_their_tolerance() {
    let (mut exact, mut simple) = (0, 0);
    for seed in 0..200 {
        let cells = cells(seed);
        let on_border = |p: Point2<f64>, slack: f64| {
            // Some side of a cell between an occupied and a free one is that near.
            (0..=cells.height as i64).any(|y| {
                (0..=cells.width as i64).any(|x| {
                    let at = cells.is_occupied(x, y);
                    let near = |a: Point2<f64>, b: Point2<f64>| {
                        let t = ((p - a).dot(&(b - a))).clamp(0.0, 1.0);
                        (a + (b - a) * t - p).norm() <= slack
                    };
                    let corner = Point2::new(x as f64, y as f64);
                    (at != cells.is_occupied(x - 1, y)
                        && near(corner, corner + nalgebra::Vector2::y()))
                        || (at != cells.is_occupied(x, y - 1)
                            && near(corner, corner + nalgebra::Vector2::x()))
                })
            })
        };
        let tolerance = 0.45;
        for rings in cells.outlines(tolerance).unwrap() {
            for ring in &rings {
                simple += ring.len();
                for (i, &a) in ring.iter().enumerate() {
                    let b = ring[(i + 1) % ring.len()];
                    for k in 0..8 {
                        let p = a + (b - a) * (f64::from(k) / 8.0);
                        assert!(on_border(p, tolerance + 1e-9), "seed {seed}: {p}");
                    }
                }
            }
        }
        let rings = cells.outlines(0.0).unwrap();
        exact += rings.iter().flatten().map(Vec::len).sum::<usize>();
    }
    assert!(simple * 10 < exact * 9, "{simple} of {exact} corners");
}

/// Cutting keeps the area and gives simple polygons.
#[test]
fn cut_polygons_cover_what_was_cut() {
    let area = |ring: &[Point2<f64>]| {
        let n = ring.len();
        let cross = |i: usize| ring[i].coords.perp(&ring[(i + 1) % n].coords);
        (0..n).map(cross).sum::<f64>() / 2.0
    };
    let mut holes = 0;
    for seed in 0..400 {
        for rings in cells(seed).outlines(0.3).unwrap() {
            holes += rings.len() - 1;
            let before: f64 = rings.iter().map(|r| area(r)).sum();
            let parts = split(rings);
            let after: f64 = parts.iter().map(|r| area(r)).sum();
            assert!((before - after).abs() < 1e-9, "seed {seed}");
            for part in parts {
                nngtl::workspace::Polygon::new(part).unwrap();
            }
        }
    }
    assert!(holes > 300, "{holes}");
}
