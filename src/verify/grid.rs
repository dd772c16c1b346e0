//! Plans on a grid: waypoints at centres of cells, legs along rows and columns, one letter for each
//! waypoint, waits included (`transfer-planning.md`, II and VI).
//!
//! What a leg may meet is judged by the map's geometry: no obstacle, and no region but those that
//! hold one of its ends.

use nalgebra::Point2;

use super::{
    Lasso, Part, Refusal, Verified, accepts, check_cost, check_structure, judge, letter_at,
};
use crate::alphabet::Letter;
use crate::automaton::Nba;
use crate::ltl::Formula;
use crate::plan::{Cost, Path, Waypoint};
use crate::scenario::GridSpec;
use crate::workspace::Workspace;

/// How far a waypoint may be from a cell's centre, relative to a cell.
const CENTRED: f64 = 1e-6;

/// As [`verify`](super::verify) for a robot on a grid; the formula may speak of the next waypoint.
///
/// # Errors
/// The first thing that is wrong, as [`verify`](super::verify).
pub fn verify_on_grid(
    workspace: &Workspace,
    grid: GridSpec,
    start: Point2<f64>,
    formula: &Formula,
    path: &Path,
    weight: f64,
    stated: Option<&Cost>,
) -> Result<Verified, Refusal> {
    let verified = check_motion(workspace, grid, start, path, weight, stated)?;
    judge(workspace, formula, verified, Lasso::show_counted)
}

/// As [`verify_automaton`](super::verify_automaton) for a robot on a grid.
///
/// # Errors
/// As [`verify_on_grid`].
pub fn verify_automaton_on_grid(
    workspace: &Workspace,
    grid: GridSpec,
    start: Point2<f64>,
    automaton: &Nba,
    path: &Path,
    weight: f64,
    stated: Option<&Cost>,
) -> Result<Verified, Refusal> {
    if *automaton.alphabet != **workspace.alphabet() {
        return Err(Refusal::ForeignAlphabet);
    }
    let verified = check_motion(workspace, grid, start, path, weight, stated)?;
    if accepts(automaton, &verified.word) {
        return Ok(verified);
    }
    Err(Refusal::NotAccepted {
        word: verified.word.show_counted(workspace.alphabet()),
    })
}

fn check_motion(
    workspace: &Workspace,
    grid: GridSpec,
    start: Point2<f64>,
    path: &Path,
    weight: f64,
    stated: Option<&Cost>,
) -> Result<Verified, Refusal> {
    check_structure(start, path, CENTRED * grid.cell)?;
    let (prefix, before) = follow(workspace, grid, &path.prefix, Part::Prefix)?;
    let (mut suffix, after) = follow(workspace, grid, &path.suffix, Part::Suffix)?;
    if suffix.is_empty() {
        suffix.push(letter_at(workspace, path.suffix[0].at, Part::Suffix, 0)?);
    }
    let cost = Cost::new(before, after, weight);
    if let Some(stated) = stated {
        check_cost(stated, &cost)?;
    }
    Ok(Verified {
        word: Lasso { prefix, suffix },
        cost,
    })
}

/// The letters of all waypoints but the last, and the length of the legs.
fn follow(
    workspace: &Workspace,
    grid: GridSpec,
    points: &[Waypoint],
    part: Part,
) -> Result<(Vec<Letter>, f64), Refusal> {
    for (index, w) in points.iter().enumerate() {
        check_centre(workspace, grid, w.at, part, index)?;
    }
    let mut seen = Vec::with_capacity(points.len());
    let mut length = 0.0;
    for (leg, pair) in points.windows(2).enumerate() {
        let (a, b) = (pair[0].at, pair[1].at);
        let from = letter_at(workspace, a, part, leg)?;
        let to = letter_at(workspace, b, part, leg + 1)?;
        seen.push(from);
        let along = b - a;
        if along.x.abs().min(along.y.abs()) > CENTRED * grid.cell {
            return Err(Refusal::Oblique { part, leg });
        }
        length += along.x.abs() + along.y.abs();
        let stretches = workspace.trace(a, b).map_err(|blocked| Refusal::Blocked {
            part,
            leg,
            obstacle: blocked.by,
            at: blocked.at,
        })?;
        let alphabet = workspace.alphabet();
        let allowed = alphabet.props(from).0 | alphabet.props(to).0;
        let foreign = |letter: Letter| alphabet.props(letter).0 & !allowed != 0;
        if let Some(met) = stretches.iter().find(|s| foreign(s.letter)) {
            return Err(Refusal::ThroughRegion {
                part,
                leg,
                letter: alphabet.show(met.letter),
            });
        }
    }
    Ok((seen, length))
}

fn check_centre(
    workspace: &Workspace,
    grid: GridSpec,
    at: Point2<f64>,
    part: Part,
    index: usize,
) -> Result<(), Refusal> {
    let offset = (at - workspace.bounds().min) / grid.cell;
    let off = |x: f64| (x - x.floor() - 0.5).abs() > CENTRED;
    if off(offset.x) || off(offset.y) {
        return Err(Refusal::OffCentre { part, index, at });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::automaton::StateId;
    use crate::workspace::{Bounds, Polygon, Region};

    const GRID: GridSpec = GridSpec {
        cells: [10, 10],
        cell: 0.1,
    };

    fn map() -> Workspace {
        let p = Point2::new;
        let rectangle = |a, b| Polygon::rectangle(a, b).unwrap();
        let region = |name: &str, polygon| Region {
            name: name.to_owned(),
            polygon,
        };
        Workspace::new(
            Bounds::unit(),
            vec![rectangle(p(0.4, 0.0), p(0.5, 0.3))],
            vec![
                region("a", rectangle(p(0.2, 0.0), p(0.3, 0.1))),
                region("b", rectangle(p(0.0, 0.5), p(0.1, 0.6))),
            ],
        )
        .unwrap()
    }

    fn points(cells: &[(u32, u32)]) -> Vec<Waypoint> {
        let at = |&(i, j): &(u32, u32)| Waypoint {
            at: Point2::new((f64::from(i) + 0.5) * 0.1, (f64::from(j) + 0.5) * 0.1),
            state: StateId(0),
        };
        cells.iter().map(at).collect()
    }

    fn check(
        formula: &str,
        prefix: &[(u32, u32)],
        suffix: &[(u32, u32)],
    ) -> Result<Verified, Refusal> {
        let path = Path {
            prefix: points(prefix),
            suffix: points(suffix),
        };
        let formula: Formula = formula.parse().unwrap();
        let start = path.prefix[0].at;
        verify_on_grid(&map(), GRID, start, &formula, &path, 0.5, None)
    }

    #[test]
    fn each_waypoint_is_a_letter_and_next_means_the_next_waypoint() {
        let patrol = |formula| {
            check(
                formula,
                &[(0, 0), (2, 0)],
                &[(2, 0), (2, 5), (0, 5), (2, 5), (2, 0)],
            )
        };
        let good = patrol("GF a & GF b & X a & G(a -> X X b)").unwrap();
        assert!((good.cost.prefix - 0.2).abs() < 1e-12 && (good.cost.suffix - 1.4).abs() < 1e-12);
        let bad = patrol("G(a -> X b)").unwrap_err();
        assert!(matches!(bad, Refusal::Formula { .. }), "{bad}");
        // A wait is a letter too.
        check("a -> X a", &[(2, 0), (2, 0), (0, 0)], &[(0, 0)]).unwrap();
        assert!(check("X a", &[(2, 0), (0, 0)], &[(0, 0)]).is_err());
    }

    #[test]
    fn legs_keep_to_rows_and_columns_and_out_of_things() {
        let refused = |prefix: &[(u32, u32)]| {
            let last = prefix[prefix.len() - 1];
            check("true", prefix, &[last]).unwrap_err()
        };
        assert!(matches!(
            refused(&[(0, 0), (1, 1)]),
            Refusal::Oblique { leg: 0, .. }
        ));
        assert!(matches!(
            refused(&[(0, 0), (3, 0)]),
            Refusal::ThroughRegion { .. }
        ));
        assert!(matches!(
            refused(&[(0, 1), (9, 1)]),
            Refusal::Blocked { .. }
        ));
        let mut path = Path {
            prefix: points(&[(0, 0)]),
            suffix: points(&[(0, 0)]),
        };
        path.prefix[0].at.x += 0.01;
        path.suffix[0].at.x += 0.01;
        let start = path.prefix[0].at;
        let formula: Formula = "true".parse().unwrap();
        let off = verify_on_grid(&map(), GRID, start, &formula, &path, 0.5, None);
        assert!(matches!(off, Err(Refusal::OffCentre { .. })));
    }
}
