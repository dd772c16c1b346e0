//! How often a growing tree asks whether a move is possible: that is what maps of many obstacles make dear.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use nalgebra::Point2;
use nngtl::alphabet::{Alphabet, Letter, LetterSet};
use nngtl::automaton::{Limits, Task};
use nngtl::planner::{PlanError, Problem, Sampler, Settings, Stop, plan};
use nngtl::random::Random;
use nngtl::system::{Continuous, Landmark, Leg, Spot, TransitionSystem};
use nngtl::workspace::{Bounds, Polygon, Region, Workspace};

/// A continuous system that counts, for each pair of places, how often it was asked about the move between them.
struct Counted {
    inner: Continuous,
    asked: Mutex<HashMap<[[u64; 2]; 2], u32>>,
}

impl TransitionSystem for Counted {
    fn step(&self, a: &Spot, b: &Spot) -> bool {
        let bits = |p: Point2<f64>| [p.x.to_bits(), p.y.to_bits()];
        let (a_bits, b_bits) = (bits(a.at), bits(b.at));
        let pair = [a_bits.min(b_bits), a_bits.max(b_bits)];
        *self.asked.lock().unwrap().entry(pair).or_default() += 1;
        self.inner.step(a, b)
    }

    fn alphabet(&self) -> &Arc<Alphabet> {
        self.inner.alphabet()
    }

    fn bounds(&self) -> Bounds {
        self.inner.bounds()
    }

    fn settle(&self, p: Point2<f64>) -> Option<Spot> {
        self.inner.settle(p)
    }

    fn distance(&self, a: Point2<f64>, b: Point2<f64>) -> f64 {
        self.inner.distance(a, b)
    }

    fn sample_free(&self, random: &mut Random) -> Point2<f64> {
        self.inner.sample_free(random)
    }

    fn sample_letter(&self, letter: Letter, random: &mut Random) -> Point2<f64> {
        self.inner.sample_letter(letter, random)
    }

    fn reachable(&self) -> &LetterSet {
        self.inner.reachable()
    }

    fn landmarks(&self, letter: Letter) -> &[Landmark] {
        self.inner.landmarks(letter)
    }

    fn first_leg(&self, from: Point2<f64>, to: Point2<f64>, keep: bool) -> Option<Leg> {
        self.inner.first_leg(from, to, keep)
    }

    fn part(&self, spot: &Spot) -> Option<u32> {
        self.inner.part(spot)
    }

    fn plane(&self) -> Option<&Workspace> {
        self.inner.plane()
    }

    fn fingerprint(&self) -> String {
        self.inner.fingerprint()
    }
}

fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Polygon {
    Polygon::rectangle(Point2::new(x0, y0), Point2::new(x1, y1)).unwrap()
}

/// A task whose last goal uniform points do not meet, with product states in several automaton states on the way.
fn problem() -> (Problem, Arc<Counted>) {
    let region = |name: &str, polygon| Region {
        name: name.to_owned(),
        polygon,
    };
    let regions = vec![
        region("a", rectangle(0.1, 0.6, 0.4, 0.9)),
        region("b", rectangle(0.6, 0.1, 0.9, 0.4)),
        region("goal", rectangle(0.95, 0.95, 0.95 + 1e-5, 0.95 + 1e-5)),
    ];
    let obstacles = vec![
        rectangle(0.3, 0.0, 0.35, 0.5),
        rectangle(0.5, 0.5, 0.55, 1.0),
        rectangle(0.7, 0.6, 0.9, 0.65),
    ];
    let map = Workspace::new(Bounds::unit(), obstacles, regions).unwrap();
    let system = Continuous::new(Arc::new(map), Point2::new(0.1, 0.1)).unwrap();
    let letters = Arc::clone(system.map().alphabet());
    let formula = "F (a & F (b & F (a & F goal)))".parse().unwrap();
    let task = Task::from_formula(&formula, letters, &Limits::default()).unwrap();
    let start = system.start();
    let counted = Arc::new(Counted {
        inner: system,
        asked: Mutex::default(),
    });
    let problem = Problem {
        start,
        system: Arc::clone(&counted) as Arc<dyn TransitionSystem>,
        task: Arc::new(task),
        weight: 0.2,
    };
    (problem, counted)
}

#[test]
fn each_pair_of_places_is_asked_about_once_and_of_each_place_log_n_are() {
    const ITERATIONS: u64 = 4_000;
    let (problem, counted) = problem();
    let settings = Settings {
        iterations: ITERATIONS,
        ..Settings::default()
    };
    let found = plan(
        &problem,
        &Sampler::Uniform,
        &settings,
        &Stop::new(),
        &mut |_| {},
    );
    let Err(PlanError::NotFound(why)) = found else {
        panic!("a goal of a ten-billionth of the map was met");
    };
    assert!(
        why.states[0] > 3,
        "several states share a place: {:?}",
        why.states
    );
    let asked = counted.asked.lock().unwrap();
    let twice = asked.values().filter(|&&n| n > 1).count();
    assert_eq!(twice, 0, "of {} pairs", asked.len());
    // What is near is no more than the k nearest: k = `neighbours` · ln(n + 1), and one more of every sample that had to look further.
    let near = |n: u64| settings.neighbours * ((n + 1) as f64).ln() + 1.0;
    let most: f64 = (1..=ITERATIONS).map(near).sum();
    let sites = why.stats.sites as usize;
    assert!(
        sites < asked.len() && (asked.len() as f64) < most,
        "{} pairs, {sites} sites, at most {most}",
        asked.len()
    );
}
