//! The letters that a segment meets.

use nalgebra::Point2;

use crate::alphabet::Letter;
use crate::workspace::Workspace;

/// The letters along `ab`, ends included, neighbours different; `None` where the segment is
/// blocked or a piece of it is too short to stand on.
pub(crate) fn word_of(
    workspace: &Workspace,
    a: Point2<f64>,
    b: Point2<f64>,
) -> Option<Vec<Letter>> {
    let pieces = pieces(workspace, a, b)?;
    Some(pieces.into_iter().map(|(letter, _)| letter).collect())
}

/// As [`word_of`], with a point of the segment for each letter: the ends for the first and the last,
/// the middle of the piece for those between.
pub(crate) fn pieces(
    workspace: &Workspace,
    a: Point2<f64>,
    b: Point2<f64>,
) -> Option<Vec<(Letter, Point2<f64>)>> {
    let ends = [a, b].map(|at| (at, workspace.locate(at)));
    let [from, to] = ends.map(|(_, place)| place.letter());
    let (from, to) = (from?, to?);
    let stretches = workspace.trace_located(ends).ok()?;
    let mut found = vec![(from, a)];
    for (i, stretch) in stretches.iter().enumerate() {
        if found.last().is_some_and(|last| last.0 == stretch.letter) {
            continue;
        }
        let end = stretches.get(i + 1).map_or(1.0, |next| next.start);
        found.push((stretch.letter, a + (b - a) * ((stretch.start + end) / 2.0)));
    }
    let many = found.len() > 1;
    match found.last_mut() {
        Some(last) if last.0 == to => {
            if many {
                last.1 = b;
            }
        }
        _ => found.push((to, b)),
    }
    let inner = found.len().saturating_sub(1);
    let firm = |&(letter, p): &(Letter, Point2<f64>)| workspace.letter_at(p) == Some(letter);
    found[1.min(inner)..inner].iter().all(firm).then_some(found)
}
