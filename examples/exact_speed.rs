//! Temporary: times the exact planner on drawn maps with hand-written automata.
use nngtl::alphabet::Props;
use nngtl::automaton::*;
use nngtl::dataset::maps::*;
use nngtl::exact::*;
use nngtl::random::generator;
use nngtl::workspace::Workspace;
use std::time::Instant;

fn task(w: &Workspace, n: u32, acc: &[u32], step: impl Fn(u32, Props) -> Vec<u32>) -> Task {
    let a = w.alphabet();
    let row = |q: u32| {
        (0..n)
            .map(|to| Transition { target: StateId(to), guard: a.filter(|p| step(q, p).contains(&to)) })
            .filter(|t| !t.guard.is_empty())
            .collect()
    };
    Task::from_trimmed(
        Nba {
            alphabet: a.clone(),
            initial: vec![StateId(0)],
            accepting: (0..n).map(|q| acc.contains(&q)).collect(),
            transitions: (0..n).map(row).collect(),
        },
        None,
    )
}
fn all(w: &Workspace, k: u32) -> Task {
    let full = (1 << k) - 1;
    task(w, full + 1, &[full], |q, p| vec![q | (p.0 as u32 & full)])
}
fn patrol(w: &Workspace, k: u32) -> Task {
    task(w, k + 1, &[k], |q, p| {
        let i = if q == k { 0 } else { q };
        vec![if p.contains(i as usize) { i + 1 } else { i }]
    })
}
fn main() {
    for family in Family::ALL {
        let (mut tm, mut tr, mut n, mut e, mut reach) = (0.0, 0.0, 0, 0, 0);
        let mut t = [0.0; 4];
        let mut worst = [0.0f64; 4];
        let mut fails = [0; 4];
        let (mut gap, mut gapn) = (0.0, 0);
        let count = 30;
        for i in 0..count {
            let mut r = generator(5, i);
            let t0 = Instant::now();
            let m = draw_map(family, &mut r);
            let w = m.workspace().unwrap();
            let s = draw_start(&w, &mut r);
            tm += t0.elapsed().as_secs_f64();
            let t0 = Instant::now();
            let road = Roadmap::new(&w, ExactConfig::default());
            tr += t0.elapsed().as_secs_f64();
            n += road.size().0;
            e += road.size().1;
            reach += usize::from(road.reachable(s).len() == m.regions.len());
            for (k, task) in [all(&w, 2), all(&w, 4), patrol(&w, 2), patrol(&w, 4)].iter().enumerate() {
                let t0 = Instant::now();
                let p = road.plan(s, task, 0.2);
                let dt = t0.elapsed().as_secs_f64();
                t[k] += dt;
                worst[k] = worst[k].max(dt);
                match p {
                    Err(_) => fails[k] += 1,
                    Ok(p) if i < 8 => {
                        let fine = Roadmap::new(&w, ExactConfig { spacing: 0.015, ..ExactConfig::default() });
                        if let Ok(f) = fine.plan(s, task, 0.2) {
                            gap += p.cost.total / f.cost.total - 1.0;
                            gapn += 1;
                        }
                    }
                    Ok(_) => {}
                }
            }
        }
        let c = count as f64;
        eprintln!(
            "{family}: map {:.2} ms roadmap {:.2} ms, {} nodes {} edges, reachable {reach}/{count}; plan ms {:?} worst {:?} fails {fails:?} gap {:.5}",
            tm / c * 1e3, tr / c * 1e3, n / count as usize, e / count as usize,
            t.map(|x| (x / c * 1e5).round() / 100.0), worst.map(|x| (x * 1e5).round() / 100.0), gap / gapn as f64
        );
    }
}
