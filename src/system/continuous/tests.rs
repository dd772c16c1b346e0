//! Ways around what may not be passed.

use super::*;
use crate::random::{generator, unit};
use crate::workspace::{Polygon, Region};

/// A rectangle somewhere on the unit square.
fn rectangle(random: &mut Random) -> Polygon {
    let [x, y, w, h] = std::array::from_fn(|_| unit(random));
    let low = Point2::new(0.9 * x, 0.9 * y);
    let high = Point2::new(low.x + 0.02 + 0.2 * w, low.y + 0.02 + 0.2 * h);
    Polygon::rectangle(low, high).unwrap()
}

/// A rectangle of a size at which several overlap.
fn large_rectangle(random: &mut Random) -> Polygon {
    let [x, y, w, h] = std::array::from_fn(|_| unit(random));
    let low = Point2::new(0.6 * x, 0.6 * y);
    let high = Point2::new(low.x + 0.1 + 0.3 * w, low.y + 0.1 + 0.3 * h);
    Polygon::rectangle(low, high).unwrap()
}

/// A system on a random map, if one with these obstacles and regions has room.
fn random_system(
    random: &mut Random,
    obstacles: usize,
    regions: usize,
    region: impl Fn(&mut Random) -> Polygon,
) -> Option<Continuous> {
    let obstacles = (0..obstacles).map(|_| rectangle(random)).collect();
    let regions = (0..regions).map(|i| Region {
        name: format!("r{i}"),
        polygon: region(random),
    });
    let map = Workspace::new(Bounds::unit(), obstacles, regions.collect()).ok()?;
    let start = map.sample_free(random);
    Continuous::new(Arc::new(map), start).ok()
}

#[test]
fn ways_that_are_allowed_anyway_are_those_of_the_map_without_the_rest() {
    let mut random = generator(3, 0);
    let (mut taken, mut asked) = (0, 0);
    for _ in 0..40 {
        let Some(system) = random_system(&mut random, 8, 3, rectangle) else {
            continue;
        };
        let map = system.map();
        let mut through = map.alphabet().all();
        through.subtract(&map.alphabet().letters_with(0));
        for _ in 0..50 {
            let [from, to] = std::array::from_fn(|_| map.sample_free(&mut random));
            let allowed = [from, to].map(|p| map.letter_at(p).is_some_and(|l| through.contains(l)));
            let Some(leg) = system
                .allowed_leg(from, to, &through)
                .filter(|_| allowed == [true; 2])
            else {
                continue;
            };
            asked += 1;
            let Some(ways) = system.around(&through) else {
                continue; // the region is covered
            };
            let (length, _) = ways.paths_to(to).first_leg(&ways.graph, from).unwrap();
            assert!((leg.length - length).abs() < 1e-9, "{from} {to}");
            assert!(map.is_free_between(from, leg.to));
            taken += 1;
        }
    }
    assert!(taken > 100, "{taken} of {asked}");
}

#[test]
fn ways_keep_out_of_every_letter_that_is_not_allowed() {
    let mut random = generator(5, 0);
    let (mut found, mut around) = (0, 0);
    for _ in 0..60 {
        let Some(system) = random_system(&mut random, 3, 4, large_rectangle) else {
            continue;
        };
        let map = system.map();
        let mut through = map.alphabet().none();
        for letter in map.alphabet().letters() {
            if unit(&mut random) < 0.7 {
                through.insert(letter);
            }
        }
        let Some(ways) = system.around(&through) else {
            assert!(through.is_all());
            continue;
        };
        let allowed = |p: Point2<f64>| map.letter_at(p).is_some_and(|l| through.contains(l));
        // On a border that of one side counts.
        let beside = |p: Point2<f64>| {
            let near = [(-1e-6, 0.0), (1e-6, 0.0), (0.0, -1e-6), (0.0, 1e-6)];
            let mut near = near.iter().map(|(x, y)| Point2::new(p.x + x, p.y + y));
            allowed(p) || near.any(allowed)
        };
        for _ in 0..40 {
            let [from, to] = std::array::from_fn(|_| map.sample_free(&mut random));
            if ![from, to].into_iter().all(allowed) {
                continue;
            }
            let Some(path) = ways.paths_to(to).path(&ways.graph, from) else {
                continue;
            };
            found += 1;
            around += usize::from(path.len() > 2);
            for leg in path.windows(2) {
                for k in 0..=50 {
                    let p = leg[0] + (leg[1] - leg[0]) * (f64::from(k) / 50.0);
                    assert!(beside(p), "{p} on the way from {from} to {to}");
                }
            }
        }
    }
    assert!(found > 300 && around > 100, "{found}, {around}");
}
