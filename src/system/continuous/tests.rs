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

#[test]
fn ways_that_are_allowed_anyway_are_those_of_the_map_without_the_rest() {
    let mut random = generator(3, 0);
    let (mut taken, mut asked) = (0, 0);
    for _ in 0..40 {
        let obstacles = (0..8).map(|_| rectangle(&mut random)).collect();
        let region = |i: usize, random: &mut Random| Region {
            name: format!("r{i}"),
            polygon: rectangle(random),
        };
        let regions = (0..3).map(|i| region(i, &mut random)).collect();
        let Ok(map) = Workspace::new(Bounds::unit(), obstacles, regions) else {
            continue;
        };
        let start = map.sample_free(&mut random);
        let system = Continuous::new(Arc::new(map), start).unwrap();
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
