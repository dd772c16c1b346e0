//! What every drawn map promises, for each family.

use nalgebra::Point2;
use nngtl::dataset::maps::{Family, GRID, MAX_REGIONS, MapShapes, draw_map, draw_start};
use nngtl::exact::{ExactConfig, Roadmap};
use nngtl::random::generator;
use nngtl::workspace::Polygon;

const MAPS: u64 = 25;

fn each_map(mut check: impl FnMut(u64, &MapShapes)) {
    for family in Family::ALL {
        for seed in 0..MAPS {
            check(seed, &draw_map(family, &mut generator(seed, 7)));
        }
    }
}

fn vertices(map: &MapShapes) -> impl Iterator<Item = &Point2<f64>> {
    map.obstacles
        .iter()
        .chain(&map.regions)
        .flat_map(Polygon::vertices)
}

#[test]
fn coordinates_lie_on_the_grid_in_the_unit_square() {
    each_map(|seed, map| {
        for v in vertices(map) {
            for c in [v.x, v.y] {
                assert!((0.0..=1.0).contains(&c), "{} {seed}: {v}", map.family);
                assert_eq!(c, (c * GRID).round() / GRID);
            }
        }
    });
}

#[test]
fn regions_overlap_nothing() {
    each_map(|seed, map| {
        let workspace = map.workspace().unwrap();
        assert_eq!(
            workspace.alphabet().len(),
            map.regions.len() + 1,
            "{} {seed}",
            map.family
        );
        assert!(workspace.hidden_regions().is_empty());
        for (i, region) in map.regions.iter().enumerate() {
            let letter = workspace.alphabet().letters_with(i).iter().next().unwrap();
            let free: f64 = workspace.cells(letter).iter().map(|c| c.area()).sum();
            assert!(
                (free - region.area()).abs() < 1e-6,
                "{} {seed}: region {i}",
                map.family
            );
        }
    });
}

#[test]
fn the_papers_maps_have_two_obstacles_and_seven_regions_on_a_grid_of_200() {
    for seed in 0..MAPS {
        let map = draw_map(Family::Paper, &mut generator(seed, 0));
        assert_eq!((map.obstacles.len(), map.regions.len()), (2, MAX_REGIONS));
        assert!(vertices(&map).all(|v| ((v.x * 200.0).fract() == 0.0)
            || (v.x * 200.0 - (v.x * 200.0).round()).abs() < 1e-9));
    }
}

#[test]
fn published_maps_have_squares_of_three_cells_and_a_lying_and_a_standing_obstacle() {
    let cells = |p: &Polygon| {
        let (low, high) = (p.min(), p.max());
        [high.x - low.x, high.y - low.y].map(|side| (side * 200.0).round() as u32)
    };
    for seed in 0..MAPS {
        let map = draw_map(Family::Published, &mut generator(seed, 0));
        assert!(map.regions.iter().all(|r| cells(r) == [3, 3]));
        assert_eq!((map.obstacles.len(), map.regions.len()), (2, MAX_REGIONS));
        let sides = [cells(&map.obstacles[0]), cells(&map.obstacles[1])];
        for (long, short) in [(sides[0][0], sides[0][1]), (sides[1][1], sides[1][0])] {
            assert!((60..=80).contains(&long) && (20..=40).contains(&short));
        }
    }
}

#[test]
fn nearly_every_map_can_be_reached_as_a_whole() {
    let mut whole = 0;
    each_map(|seed, map| {
        let workspace = map.workspace().unwrap();
        let start = draw_start(&workspace, &mut generator(seed, 8));
        assert!(workspace.letter_at(start).is_some());
        let roadmap = Roadmap::new(&workspace, ExactConfig::default());
        whole += usize::from(roadmap.reachable(start).len() == map.regions.len());
    });
    assert!(
        whole * 10 >= 9 * MAPS as usize * Family::ALL.len(),
        "{whole}"
    );
}

#[test]
fn families_differ_and_some_shapes_are_not_convex() {
    let turns_right = |p: &Polygon| {
        let v = p.vertices();
        let n = v.len();
        (0..n).any(|i| (v[(i + 1) % n] - v[i]).perp(&(v[(i + 2) % n] - v[(i + 1) % n])) < 0.0)
    };
    let (mut crowded, mut concave, mut large) = (0, 0, 0);
    each_map(|_, map| {
        crowded += usize::from(map.obstacles.len() >= 8);
        concave += map.regions.iter().filter(|r| turns_right(r)).count();
        large += map.regions.iter().filter(|r| r.area() > 0.02).count();
    });
    assert!(
        crowded > 20 && concave > 20 && large > 10,
        "{crowded} {concave} {large}"
    );
}

/// Data sets are continued and compared across versions: what a seed draws in a family must stay.
#[test]
fn the_first_families_draw_what_they_always_drew() {
    use sha2::{Digest, Sha256};
    let mut hash = Sha256::new();
    for family in [Family::Paper, Family::Clutter, Family::Rooms] {
        for seed in 0..10 {
            let map = draw_map(family, &mut generator(seed, 7));
            for v in vertices(&map) {
                hash.update(format!("{:.4} {:.4};", v.x, v.y));
            }
        }
    }
    let digest: String = hash.finalize().iter().map(|b| format!("{b:02x}")).collect();
    assert_eq!(
        digest, "edc8cc2e06cd757f30952bb622de78dae4684f55f4d33f8c3e75e5c28334e97a",
        "maps of old seeds have changed"
    );
}

#[test]
fn families_have_regions_of_their_size() {
    let area = |family: Family| -> f64 {
        let maps = (0..MAPS).map(|seed| draw_map(family, &mut generator(seed, 7)));
        let areas: Vec<f64> = maps.flat_map(|m| m.regions).map(|r| r.area()).collect();
        areas.iter().sum::<f64>() / areas.len() as f64
    };
    let (small, usual, large) = (
        area(Family::Small),
        area(Family::Clutter),
        area(Family::Large),
    );
    assert!(
        10.0 * small < usual && 2.0 * usual < large,
        "{small} {usual} {large}"
    );
}

/// In a maze nearly every straight way runs into a wall; in clutter fewer do.
#[test]
fn mazes_hide_regions_and_blobs_have_many_corners() {
    let blocked = |family: Family| -> f64 {
        let (mut hidden, mut all) = (0, 0);
        for seed in 0..MAPS {
            let map = draw_map(family, &mut generator(seed, 7));
            let workspace = map.workspace().unwrap();
            for (i, a) in map.regions.iter().enumerate() {
                for b in &map.regions[..i] {
                    all += 1;
                    let (a, b) = (a.vertices()[0], b.vertices()[0]);
                    hidden += usize::from(workspace.trace(a, b).is_err());
                }
            }
        }
        f64::from(hidden as u32) / f64::from(all)
    };
    let (clutter, mazes) = (blocked(Family::Clutter), blocked(Family::Mazes));
    assert!(clutter < 0.8 && mazes > 0.85, "{clutter} {mazes}");
    let corners = |family: Family| -> usize {
        let map = draw_map(family, &mut generator(3, 7));
        let corners = map.obstacles.iter().map(|o| o.vertices().len());
        corners.max().unwrap_or(0)
    };
    assert!(corners(Family::Blobs) > 12, "{}", corners(Family::Blobs));
}
