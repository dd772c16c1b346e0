#![allow(missing_docs)]
use nalgebra::Point2;
use nngtl::alphabet::Alphabet;
use nngtl::automaton::{Nba, StateId, Task, Transition};
use nngtl::guidance::{Guidance, Heatmap};
use nngtl::planner::*;
use nngtl::system::Continuous;
use nngtl::workspace::*;
use std::sync::Arc;
fn p(x: f64, y: f64) -> Point2<f64> {
    Point2::new(x, y)
}
fn tri(x: f64, y: f64) -> Polygon {
    Polygon::new(vec![p(x, y), p(x + 0.2, y), p(x, y + 0.2)]).unwrap()
}
fn main() {
    let regs = [
        ("l1", 0.1, 0.7),
        ("l2", 0.7, 0.7),
        ("l3", 0.7, 0.3),
        ("l4", 0.3, 0.3),
        ("l5", 0.0, 0.1),
        ("l6", 0.0, 0.4),
    ];
    let regions = regs
        .iter()
        .map(|&(n, x, y)| Region {
            name: n.into(),
            polygon: tri(x, y),
        })
        .collect();
    let obs = vec![
        Polygon::rectangle(p(0.3, 0.0), p(0.7, 0.2)).unwrap(),
        Polygon::rectangle(p(0.4, 0.7), p(0.6, 1.0)).unwrap(),
    ];
    let map = Arc::new(Workspace::new(Bounds::unit(), obs, regions).unwrap());
    let sys = Continuous::new(map, p(0.8, 0.1)).unwrap();
    let al: &Arc<Alphabet> = sys.map().alphabet();
    let set = |f: &dyn Fn(&str) -> bool| {
        let mut s = al.none();
        for l in al.letters() {
            let n = al.show(l);
            if f(n.trim_matches(|c| c == '{' || c == '}')) {
                s.insert(l);
            }
        }
        s
    };
    // states: (l1 seen, l4 seen) x phase{0: need l2, 1: need l3} ; state = l1 + 2*l4 + 4*phase ; accepting copies: handled by state 8 = just completed round with l1 & l4 seen
    let n = 9;
    let mut tr: Vec<Vec<Transition>> = vec![vec![]; n];
    let step = |s: usize, l: &str| -> Option<usize> {
        let (mut a, mut b, mut ph) = if s == 8 {
            (1, 1, 0)
        } else {
            (s & 1, (s >> 1) & 1, (s >> 2) & 1)
        };
        if l == "l5" {
            return None;
        }
        if l == "l3" && b == 0 {
            return None;
        }
        if l == "l1" {
            a = 1;
        }
        if l == "l4" {
            b = 1;
        }
        let mut done = false;
        if ph == 0 && l == "l2" {
            ph = 1;
        } else if ph == 1 && l == "l3" {
            ph = 0;
            done = a == 1 && b == 1;
        }
        Some(if done { 8 } else { a + 2 * b + 4 * ph })
    };
    for s in 0..n {
        for t in 0..n {
            let g = set(&|l| step(s, l) == Some(t));
            if !g.is_empty() {
                tr[s].push(Transition {
                    target: StateId(t as u32),
                    guard: g,
                });
            }
        }
    }
    let mut acc = vec![false; n];
    acc[8] = true;
    let nba = Nba {
        alphabet: al.clone(),
        initial: vec![StateId(0)],
        accepting: acc,
        transitions: tr,
    };
    let task = Arc::new(Task::from_trimmed(nba, None));
    let problem = Problem {
        start: sys.start(),
        system: Arc::new(sys),
        task: task.clone(),
        weight: 0.2,
    };
    let flat = Guidance {
        heatmap: Heatmap {
            side: 200,
            values: vec![1.0; 40000],
        },
        states: vec![1.0; n],
    };
    let flat = Sampler::Guided(Arc::new(Guide::new(&flat, n).unwrap()));
    let iters: u64 = std::env::args()
        .nth(1)
        .and_then(|s| s.parse().ok())
        .unwrap_or(10000);
    for s in [Sampler::Uniform, Sampler::Biased, flat] {
        for seed in 0..5 {
            let st = Settings {
                seed,
                iterations: iters,
                ..Default::default()
            };
            match plan(&problem, &s, &st, &Stop::new(), &mut |_| {}) {
                Ok(sol) => {
                    let f = sol.stats.first_plan.unwrap();
                    let fp = sol.stats.first_prefix.unwrap();
                    println!(
                        "{} seed {seed}: first prefix it {} plan it {} cost {:.3} t {:.4}s | final {:.4} (pre {:.3} suf {:.3}) {:.2}s nodes {} sites {} goals {} trees {} failed {}",
                        s.name(),
                        fp.iterations,
                        f.iterations,
                        f.cost,
                        f.seconds,
                        sol.cost.total,
                        sol.cost.prefix,
                        sol.cost.suffix,
                        sol.stats.seconds,
                        sol.stats.nodes,
                        sol.stats.sites,
                        sol.stats.goals,
                        sol.stats.suffix_trees,
                        sol.stats.failed_samples
                    );
                }
                Err(PlanError::NotFound(e)) => {
                    println!("{} seed {seed}: not found {:?}", s.name(), e.stats)
                }
                Err(e) => println!("{e}"),
            }
        }
    }
}
