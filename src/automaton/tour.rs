//! In which order the places of a patrol are waited for.
//!
//! A Büchi automaton with accepting states waits for what is due again and again in a fixed order, and a cycle of its
//! states sees all of it in that order (Gastin and Oddoux, CAV 2001, section 6: any order gives the same words). Which
//! cycles are words is not changed by the order, but which of them are *one* cycle of states is: a robot that has to
//! visit four corners of a room again and again would walk across it if the automaton names them crosswise. So on a map
//! the order is that of a shortest tour (ours).

use super::graph::{Components, Graph, Marks};
use crate::alphabet::Props;

/// How far the places of a map are from each other, where propositions hold.
pub trait Layout {
    /// From a place where proposition `from` holds, or from the start, to one where `to` holds, in units of the map; infinite if
    /// there is no way.
    fn length(&self, from: Option<usize>, to: usize) -> f64;
}

/// The fewest places among which the order makes a difference: of two it is where the round begins.
const PLACES: usize = 2;

/// Among up to so many places each is tried as the one that the first round waits for.
const FEW: usize = 3;

/// Tours of up to so many places are the shortest; longer ones cannot be made shorter by reversing a part of them.
const EXACT: usize = 9;

/// The orders of all marks that are worth trying, the better one first: the shortest tour of the component with the most marks,
/// and its reverse; none if there is one place to visit or none. The last mark, the only one that the first round has to
/// wait for, is nearest to the start; of up to three places each is tried as the last.
///
/// `seen` tells for each letter class of the graph's guards what holds.
pub(super) fn orders(graph: &Graph, seen: &[Props], layout: &dyn Layout) -> Vec<Round> {
    if (graph.marks as usize) < PLACES {
        return Vec::new();
    }
    let components = graph.components();
    let Some(places) = places(graph, &components, seen) else {
        return Vec::new();
    };
    let (placed, free): (Vec<u32>, Vec<u32>) =
        (0..graph.marks).partition(|&m| !places[m as usize].is_empty());
    if placed.len() < PLACES {
        return Vec::new();
    }
    // What no way leads to is not visited, wherever it stands.
    let finite = |length: f64| if length.is_finite() { length } else { FAR };
    let nearest = |from: Props, to: Props| {
        let pairs = from.iter().flat_map(|p| to.iter().map(move |q| (p, q)));
        let lengths = pairs.map(|(p, q)| {
            if p == q {
                0.0
            } else {
                layout.length(Some(p), q)
            }
        });
        finite(lengths.fold(f64::INFINITY, f64::min))
    };
    let at = |i: usize| places[placed[i] as usize];
    let n = placed.len();
    let lengths: Vec<Vec<f64>> = (0..n)
        .map(|i| (0..n).map(|j| nearest(at(i), at(j))).collect())
        .collect();
    let from_start = |i: usize| {
        let lengths = at(i).iter().map(|p| layout.length(None, p));
        finite(lengths.fold(f64::INFINITY, f64::min))
    };
    let mut tour = if n <= EXACT {
        shortest(&lengths)
    } else {
        improved(&lengths)
    };
    let by_start = |&i: &usize| from_start(tour[i]);
    let first = (0..n).min_by(|i, j| by_start(i).total_cmp(&by_start(j)));
    tour.rotate_left((first.unwrap_or(0) + 1) % n);
    let mut reverse = tour.clone();
    reverse[..n - 1].reverse();
    let length = |tour: &[usize]| -> f64 {
        let next = |i: usize| tour[(i + 1) % n];
        (0..n).map(|i| lengths[tour[i]][next(i)]).sum()
    };
    // Of ways that are longer in one direction the tour is what it is.
    let both = length(&reverse) <= length(&tour) * (1.0 + 1e-6);
    let mut tours = vec![tour, reverse];
    tours.truncate(1 + usize::from(both && n > 2));
    // Whoever enters the round on its way to the last place comes from the side of the one before.
    tours.sort_by(|a, b| from_start(a[n - 2]).total_cmp(&from_start(b[n - 2])));
    if n <= FEW {
        let turned = |tour: &Vec<usize>, by| [&tour[by..], &tour[..by]].concat();
        let starts = |tour| (0..n).map(move |by| turned(tour, by));
        tours = tours.iter().flat_map(starts).collect();
    }
    let round = |tour: Vec<usize>| Round {
        stops: tour.iter().filter_map(|&i| stop(at(i), seen)).collect(),
        marks: free
            .iter()
            .copied()
            .chain(tour.iter().map(|&i| placed[i]))
            .collect(),
    };
    tours.into_iter().map(round).collect()
}

/// A way around: an order of all marks, and the letter classes of the places that are visited for them.
pub(super) struct Round {
    pub(super) marks: Vec<u32>,
    pub(super) stops: Vec<usize>,
}

/// The letter class with the fewest other propositions beside the first one of a place.
fn stop(place: Props, seen: &[Props]) -> Option<usize> {
    let wanted = place.iter().next()?;
    let there = (0..seen.len()).filter(|&c| seen[c].contains(wanted));
    there.min_by_key(|&c| seen[c].len())
}

/// Longer than any way, and still no overflow in sums.
const FAR: f64 = 1e100;

/// For each mark the propositions of the letters that a run of the component with the most marks waits for; none where it need
/// not move to see the mark. `None` if no component accepts.
fn places(graph: &Graph, components: &Components, seen: &[Props]) -> Option<Vec<Props>> {
    let inside = |q: usize, to: u32| components.of[q] == components.of[to as usize];
    let mut always: Vec<Marks> = vec![graph.full(); components.accepting.len()];
    for (q, row) in graph.edges.iter().enumerate() {
        for e in row.iter().filter(|e| inside(q, e.target)) {
            always[components.of[q] as usize] &= e.marks;
        }
    }
    let accepting = (0..always.len()).filter(|&c| components.accepting[c]);
    let chosen = accepting.min_by_key(|&c| always[c].count_ones())?;
    let mut places = vec![Props::EMPTY; graph.marks as usize];
    for q in (0..graph.len()).filter(|&q| components.of[q] as usize == chosen) {
        for (mark, place) in places.iter_mut().enumerate() {
            if always[chosen] >> mark & 1 == 1 {
                continue;
            }
            let marked = graph.edges[q]
                .iter()
                .filter(|e| inside(q, e.target) && e.marks >> mark & 1 == 1);
            let mut here = Props::EMPTY;
            let mut free = false;
            for class in marked.flat_map(|e| e.guard.iter()) {
                here.0 |= seen[class].0;
                free |= seen[class].is_empty();
            }
            if !free {
                place.0 |= here.0;
            }
        }
    }
    Some(places)
}

/// The shortest closed tour from place 0 (Held and Karp, "A dynamic programming approach to sequencing problems", 1962).
fn shortest(lengths: &[Vec<f64>]) -> Vec<usize> {
    let n = lengths.len();
    // By set of other places that were visited, and by the last of them: the length, and the one before.
    let mut best = vec![(f64::INFINITY, 0); (1 << (n - 1)) * n];
    for last in 1..n {
        best[(1 << (last - 1)) * n + last] = (lengths[0][last], 0);
    }
    for set in 1..1usize << (n - 1) {
        for last in (1..n).filter(|l| set >> (l - 1) & 1 == 1) {
            let (length, _) = best[set * n + last];
            for next in (1..n).filter(|l| set >> (l - 1) & 1 == 0) {
                let entry = &mut best[(set | 1 << (next - 1)) * n + next];
                if length + lengths[last][next] < entry.0 {
                    *entry = (length + lengths[last][next], last);
                }
            }
        }
    }
    let mut set = (1 << (n - 1)) - 1;
    let closed = |&l: &usize| best[set * n + l].0 + lengths[l][0];
    let mut last = (1..n)
        .min_by(|i, j| closed(i).total_cmp(&closed(j)))
        .unwrap_or(0);
    let mut tour = Vec::with_capacity(n);
    while last != 0 {
        tour.push(last);
        let before = best[set * n + last].1;
        set &= !(1 << (last - 1));
        last = before;
    }
    tour.push(0);
    tour.reverse();
    tour
}

/// A closed tour that no reversal of a part makes shorter: each place after the nearest one before, then the moves of Lin, "Computer
/// solutions of the traveling salesman problem", 1965.
fn improved(lengths: &[Vec<f64>]) -> Vec<usize> {
    let n = lengths.len();
    let mut tour = vec![0];
    while tour.len() < n {
        let from = tour[tour.len() - 1];
        let left = (0..n).filter(|i| !tour.contains(i));
        let next = left.min_by(|&i, &j| lengths[from][i].total_cmp(&lengths[from][j]));
        tour.extend(next);
    }
    let leg = |tour: &[usize], i: usize| lengths[tour[i]][tour[(i + 1) % n]];
    let mut changed = true;
    while changed {
        changed = false;
        for i in 0..n - 1 {
            for j in i + 1..n {
                let after = lengths[tour[i]][tour[j]] + lengths[tour[i + 1]][tour[(j + 1) % n]];
                if after < leg(&tour, i) + leg(&tour, j) - 1e-9 * leg(&tour, i).max(1.0) {
                    tour[i + 1..=j].reverse();
                    changed = true;
                }
            }
        }
    }
    tour
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::RngExt;

    use super::*;
    use crate::alphabet::{Alphabet, Letter};
    use crate::automaton::translate::{translate, translate_on};
    use crate::automaton::{Limits, Nba, StateId};
    use crate::random::{Random, generator};

    /// Points of the plane, the start last.
    struct Points(Vec<[f64; 2]>);

    impl Points {
        fn random(places: usize, random: &mut Random) -> Self {
            Self((0..=places).map(|_| random.random()).collect())
        }

        fn between(&self, from: usize, to: usize) -> f64 {
            let [[x, y], [u, v]] = [self.0[from], self.0[to]];
            (u - x).hypot(v - y)
        }
    }

    impl Layout for Points {
        fn length(&self, from: Option<usize>, to: usize) -> f64 {
            self.between(from.unwrap_or(self.0.len() - 1), to)
        }
    }

    fn round(lengths: &[Vec<f64>], tour: &[usize]) -> f64 {
        let next = |i: usize| tour[(i + 1) % tour.len()];
        (0..tour.len()).map(|i| lengths[tour[i]][next(i)]).sum()
    }

    /// The shortest of all tours that begin with `tour`.
    fn tried(lengths: &[Vec<f64>], tour: &mut Vec<usize>) -> f64 {
        if tour.len() == lengths.len() {
            return round(lengths, tour);
        }
        let mut best = f64::INFINITY;
        for next in 0..lengths.len() {
            if !tour.contains(&next) {
                tour.push(next);
                best = best.min(tried(lengths, tour));
                tour.pop();
            }
        }
        best
    }

    #[test]
    fn tours_are_shortest_and_long_ones_no_worse_than_going_on_to_the_nearest() {
        let mut random = generator(1, 0);
        for places in 4..=7 {
            for _ in 0..20 {
                let lengths: Vec<Vec<f64>> = (0..places)
                    .map(|_| (0..places).map(|_| random.random()).collect())
                    .collect();
                let tour = shortest(&lengths);
                let mut sorted = tour.clone();
                sorted.sort_unstable();
                assert_eq!(sorted, (0..places).collect::<Vec<_>>());
                let least = tried(&lengths, &mut vec![0]);
                assert!((round(&lengths, &tour) - least).abs() < 1e-12);
            }
        }
        for places in [10, 25, 60] {
            let points = Points::random(places, &mut random);
            let row = |i| (0..places).map(|j| points.between(i, j)).collect();
            let lengths: Vec<Vec<f64>> = (0..places).map(row).collect();
            let tour = improved(&lengths);
            let mut sorted = tour.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, (0..places).collect::<Vec<_>>());
            for i in 0..places {
                for j in i + 1..places {
                    let mut other = tour.clone();
                    other[i..=j].reverse();
                    assert!(round(&lengths, &other) > round(&lengths, &tour) - 1e-6);
                }
            }
        }
    }

    /// Whether some accepting state is on a cycle of states that reads the letters once, each of them any number of times.
    fn closes(nba: &Nba, letters: &[Letter]) -> bool {
        let steps = |from: Vec<StateId>, letter| {
            let mut reached = Vec::new();
            let mut open = from;
            while let Some(q) = open.pop() {
                for next in nba.successors(q, letter) {
                    if !reached.contains(&next) {
                        reached.push(next);
                        open.push(next);
                    }
                }
            }
            reached
        };
        nba.states().filter(|&q| nba.is_accepting(q)).any(|q| {
            (0..letters.len()).any(|first| {
                let from_here = letters[first..].iter().chain(&letters[..first]);
                from_here.fold(vec![q], |at, &l| steps(at, l)).contains(&q)
            })
        })
    }

    #[test]
    fn a_patrol_is_one_cycle_of_states_in_the_order_of_the_tour() {
        let mut random = generator(2, 0);
        let mut crossing = 0;
        for case in 0..60 {
            let places = 4 + case % 5;
            let names: Vec<String> = (0..places).map(|i| format!("l{i}")).collect();
            let alphabet = Arc::new(Alphabet::disjoint(names).unwrap());
            let patrol = (0..places).map(|i| format!("G F l{i}"));
            let mut text = patrol.collect::<Vec<_>>().join(" & ");
            // What happens once, and what is asked for in return, leaves the order to the map.
            text += ["", " & (!l1 U l2)", " & G(l0 -> F l3)"][case % 3];
            let formula = text.parse().unwrap();
            let points = Points::random(places, &mut random);
            let limits = Limits::default();
            let named = translate(&formula, Arc::clone(&alphabet), &limits).unwrap();
            let nba = translate_on(&formula, Arc::clone(&alphabet), &limits, &points).unwrap();
            assert!(
                nba.len() <= named.len() + 1,
                "{text}: {} {}",
                nba.len(),
                named.len()
            );
            let row = |i| (0..places).map(|j| points.between(i, j)).collect();
            let lengths: Vec<Vec<f64>> = (0..places).map(row).collect();
            let nothing = alphabet
                .letters()
                .find(|&l| alphabet.props(l).is_empty())
                .unwrap();
            let at = |p: usize| alphabet.letters_with(p).iter().next().unwrap();
            let tour: Vec<Letter> = shortest(&lengths)
                .into_iter()
                .flat_map(|p| [at(p), nothing])
                .collect();
            let reverse: Vec<Letter> = tour.iter().rev().copied().collect();
            let around = |nba: &Nba| closes(nba, &tour) || closes(nba, &reverse);
            assert!(around(&nba), "{text}:\n{nba}");
            crossing += usize::from(!around(&named));
            for _ in 0..20 {
                let [prefix, cycle] = [0, 1].map(|least| -> Vec<Letter> {
                    let len = random.random_range(least..=least + 12);
                    let any = |_| Letter(random.random_range(0..alphabet.len() as u32));
                    (0..len).map(any).collect()
                });
                assert_eq!(nba.accepts(&prefix, &cycle), named.accepts(&prefix, &cycle));
                let mut all = tour.clone();
                all.extend(&cycle);
                assert_eq!(nba.accepts(&prefix, &all), named.accepts(&prefix, &all));
            }
        }
        assert!(crossing > 30, "{crossing}");
    }

    #[test]
    fn few_places_and_those_without_a_way_do_no_harm() {
        struct Nowhere;
        impl Layout for Nowhere {
            fn length(&self, _: Option<usize>, _: usize) -> f64 {
                f64::INFINITY
            }
        }
        let names = ["a", "b", "c", "d"].map(str::to_owned).to_vec();
        let alphabet = Arc::new(Alphabet::disjoint(names).unwrap());
        let limits = Limits::default();
        for text in [
            "G F a & G F b & G F c & G F d",
            "G F a & G F b & G F c",
            "F a & F b & F c & F d",
        ] {
            let formula = text.parse().unwrap();
            let on = translate_on(&formula, Arc::clone(&alphabet), &limits, &Nowhere).unwrap();
            let named = translate(&formula, Arc::clone(&alphabet), &limits).unwrap();
            assert_eq!(on.len(), named.len(), "{text}");
        }
    }
}
