//! The independent checker: does a path obey the map, the segment rule, and the mission?
//!
//! It shares nothing with the planner but geometry and the formula's syntax tree. It follows each leg
//! of the path, collects the letters that the robot really sees, and evaluates the formula on the
//! resulting infinite word `prefix (suffix)^ω` by LTL's own semantics, never through the automaton
//! that the planner used. Every plan that this crate returns has passed it.
//!
//! What counts as seen: the letter where the robot starts; every letter that holds over a positive
//! length; the letter where it stays for ever, if it stays. Shared borders and touched corners do
//! not count.

mod grid;
mod lasso;
mod refusal;

use nalgebra::Point2;

use crate::alphabet::{Alphabet, Letter};
use crate::automaton::Nba;
use crate::ltl::Formula;
use crate::plan::{Cost, Path, Waypoint, length};
use crate::workspace::Workspace;

pub use grid::{verify_automaton_on_grid, verify_on_grid};
pub use lasso::{Lasso, accepts};
pub use refusal::{Part, Refusal};

/// How far a stated cost may be from the recomputed one, relative to the larger of it and 1: both
/// are sums of the same lengths, only the order of additions may differ.
pub const COST_TOLERANCE: f64 = 1e-9;

/// What a plan that passed was found to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Verified {
    /// The letters that the robot sees, once and then for ever.
    pub word: Lasso,
    /// The cost, recomputed.
    pub cost: Cost,
}

/// Checks `path` against the map, the start, the formula, and the cost if one is stated.
///
/// # Errors
/// The first thing that is wrong, with the leg, the place and the letters. Structure is checked
/// first, then the legs in order, then the cost, then the formula.
///
/// ```
/// use nalgebra::Point2;
/// use nngtl::{ltl, plan::{Path, Waypoint}, automaton::StateId, scenario::Scenario, verify};
/// let scenario = Scenario::load("scenarios/case-study.toml")?;
/// let stay = Waypoint { at: scenario.start, state: StateId(0) };
/// let path = Path { prefix: vec![stay], suffix: vec![stay] };
/// let refusal = verify::verify(
///     &scenario.workspace, scenario.start, &scenario.formula, &path, scenario.weight, None);
/// assert!(refusal.unwrap_err().to_string().contains("({})^ω"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn verify(
    workspace: &Workspace,
    start: Point2<f64>,
    formula: &Formula,
    path: &Path,
    weight: f64,
    stated: Option<&Cost>,
) -> Result<Verified, Refusal> {
    if formula.has_next() {
        return Err(Refusal::Next);
    }
    let verified = check_motion(workspace, start, path, weight, stated)?;
    judge(workspace, formula, verified, Lasso::show)
}

/// Whether the word satisfies the formula; if not, which of its conjuncts fail, on the word as it is shown.
fn judge(
    workspace: &Workspace,
    formula: &Formula,
    verified: Verified,
    show: impl Fn(&Lasso, &Alphabet) -> String,
) -> Result<Verified, Refusal> {
    let alphabet = workspace.alphabet();
    if lasso::satisfies(&verified.word, formula, alphabet)? {
        return Ok(verified);
    }
    let failing = lasso::conjuncts(formula)
        .into_iter()
        .filter(|part| matches!(lasso::satisfies(&verified.word, part, alphabet), Ok(false)))
        .map(ToString::to_string)
        .collect::<Vec<_>>();
    Err(Refusal::Formula {
        word: show(&verified.word, alphabet),
        failing: failing.join(" and "),
    })
}

/// As [`verify`] for a mission that is given as an automaton only: the path's word must be accepted
/// by `automaton`, whose letters are those of the workspace.
///
/// # Errors
/// As [`verify`].
pub fn verify_automaton(
    workspace: &Workspace,
    start: Point2<f64>,
    automaton: &Nba,
    path: &Path,
    weight: f64,
    stated: Option<&Cost>,
) -> Result<Verified, Refusal> {
    if *automaton.alphabet != **workspace.alphabet() {
        return Err(Refusal::ForeignAlphabet);
    }
    let verified = check_motion(workspace, start, path, weight, stated)?;
    if accepts(automaton, &verified.word) {
        return Ok(verified);
    }
    Err(Refusal::NotAccepted {
        word: verified.word.show(workspace.alphabet()),
    })
}

/// Everything but the mission: structure, legs and cost.
fn check_motion(
    workspace: &Workspace,
    start: Point2<f64>,
    path: &Path,
    weight: f64,
    stated: Option<&Cost>,
) -> Result<Verified, Refusal> {
    check_structure(start, path, 0.0)?;
    let first = letter_at(workspace, path.prefix[0].at, Part::Prefix, 0)?;
    let mut prefix = vec![first];
    follow(workspace, &path.prefix, Part::Prefix, &mut prefix)?;
    let mut suffix = Vec::new();
    follow(workspace, &path.suffix, Part::Suffix, &mut suffix)?;
    if suffix.is_empty() {
        suffix.push(letter_at(workspace, path.suffix[0].at, Part::Suffix, 0)?);
    }
    let cost = Cost::new(length(&path.prefix), length(&path.suffix), weight);
    if let Some(stated) = stated {
        check_cost(stated, &cost)?;
    }
    Ok(Verified {
        word: Lasso { prefix, suffix },
        cost,
    })
}

/// The shape of a prefix-suffix path: `plan.json`'s promises.
/// Points that are at most `slack` apart along each axis count as the same.
fn check_structure(start: Point2<f64>, path: &Path, slack: f64) -> Result<(), Refusal> {
    for (part, points) in [(Part::Prefix, &path.prefix), (Part::Suffix, &path.suffix)] {
        if points.is_empty() {
            return Err(Refusal::Empty { part });
        }
        for (index, Waypoint { at, .. }) in points.iter().enumerate() {
            if !(at.x.is_finite() && at.y.is_finite()) {
                let (x, y) = (at.x, at.y);
                return Err(Refusal::NotFinite { part, index, x, y });
            }
        }
    }
    // Never for what is not a number.
    let together = |a: f64, b: f64| (a - b).abs() <= slack;
    let apart = |a: Point2<f64>, b: Point2<f64>| !(together(a.x, b.x) && together(a.y, b.y));
    let at = path.prefix[0].at;
    if apart(at, start) {
        return Err(Refusal::WrongStart { at, start });
    }
    let end = path.prefix[path.prefix.len() - 1].at;
    let (opens, closes) = (path.suffix[0].at, path.suffix[path.suffix.len() - 1].at);
    if apart(opens, end) {
        return Err(Refusal::Disconnected { at: opens, end });
    }
    if apart(closes, end) {
        return Err(Refusal::NotClosed { at: closes, end });
    }
    Ok(())
}

/// Follows the legs of one part and appends the letters seen over positive length.
fn follow(
    workspace: &Workspace,
    points: &[Waypoint],
    part: Part,
    seen: &mut Vec<Letter>,
) -> Result<(), Refusal> {
    for (leg, pair) in points.windows(2).enumerate() {
        let (a, b) = (pair[0].at, pair[1].at);
        let from = letter_at(workspace, a, part, leg)?;
        let to = letter_at(workspace, b, part, leg + 1)?;
        if a == b {
            continue; // only the automaton moves; nothing new is seen
        }
        let stretches = workspace.trace(a, b).map_err(|blocked| Refusal::Blocked {
            part,
            leg,
            obstacle: blocked.by,
            at: blocked.at,
        })?;
        let along: Vec<Letter> = stretches.iter().map(|s| s.letter).collect();
        check_segment_rule(workspace, part, leg, from, &along, to)?;
        for letter in along {
            if seen.last() != Some(&letter) {
                seen.push(letter);
            }
        }
    }
    Ok(())
}

/// The letter changes at most once along a leg, its ends included (`nngtl.md`, II-A).
fn check_segment_rule(
    workspace: &Workspace,
    part: Part,
    leg: usize,
    from: Letter,
    along: &[Letter],
    to: Letter,
) -> Result<(), Refusal> {
    let mut letters = vec![from];
    for &letter in along.iter().chain([&to]) {
        if letters.last() != Some(&letter) {
            letters.push(letter);
        }
    }
    if letters.len() <= 2 {
        return Ok(());
    }
    let alphabet = workspace.alphabet();
    let shown: Vec<String> = letters.iter().map(|&l| alphabet.show(l)).collect();
    Err(Refusal::SegmentRule {
        part,
        leg,
        letters: shown.join(" "),
    })
}

fn letter_at(
    workspace: &Workspace,
    at: Point2<f64>,
    part: Part,
    index: usize,
) -> Result<Letter, Refusal> {
    workspace
        .letter_at(at)
        .ok_or(Refusal::NotFree { part, index, at })
}

fn check_cost(stated: &Cost, found: &Cost) -> Result<(), Refusal> {
    let pairs = [
        ("prefix", stated.prefix, found.prefix),
        ("suffix", stated.suffix, found.suffix),
        ("total", stated.total, found.total),
    ];
    for (what, stated, found) in pairs {
        let slack = COST_TOLERANCE * found.abs().max(1.0);
        let agree = (stated - found).abs() <= slack; // never for a stated NaN
        if !agree {
            return Err(Refusal::Cost {
                what,
                stated,
                found,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
