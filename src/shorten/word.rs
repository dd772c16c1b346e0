//! The letters that a segment meets.

use nalgebra::Point2;
use smallvec::{SmallVec, smallvec};

use crate::alphabet::Letter;
use crate::workspace::Workspace;

/// Segments whose letters are remembered: those of a few neighbouring points of a path.
const KEPT: usize = 16;

/// The classes of letters along a segment; `None` as for [`word_of`].
type Letters = Option<SmallVec<[u16; 4]>>;

/// Letters along a segment, each with a point of it; few of them, so that looking at a segment allocates nothing.
pub(crate) type Pieces = SmallVec<[(Letter, Point2<f64>); 6]>;

/// What is known of the segments that were asked for last: each leg of a path is asked for by both of its points.
#[derive(Clone, Debug, Default)]
pub(super) struct KnownWords {
    known: Vec<([Point2<f64>; 2], Letters)>,
    /// The next one to be forgotten.
    oldest: usize,
}

impl KnownWords {
    /// The letters of a segment, which `find` says if they are not known.
    pub(super) fn of(
        &mut self,
        ends: [Point2<f64>; 2],
        find: impl FnOnce() -> Letters,
    ) -> Option<&[u16]> {
        let at = self.known.iter().position(|k| k.0 == ends);
        let at = at.unwrap_or_else(|| {
            let new = (ends, find());
            if self.known.len() < KEPT {
                self.known.push(new);
                return self.known.len() - 1;
            }
            let at = self.oldest;
            self.known[at] = new;
            self.oldest = (at + 1) % KEPT;
            at
        });
        self.known[at].1.as_deref()
    }
}

/// The letters along `ab`, ends included, neighbours different; `None` where the segment is
/// blocked or a piece of it is too short to stand on.
pub(crate) fn word_of(
    workspace: &Workspace,
    a: Point2<f64>,
    b: Point2<f64>,
) -> Option<SmallVec<[Letter; 6]>> {
    let pieces = pieces(workspace, a, b)?;
    Some(pieces.into_iter().map(|(letter, _)| letter).collect())
}

/// As [`word_of`], with a point of the segment for each letter: the ends for the first and the last,
/// the middle of the piece for those between.
pub(crate) fn pieces(workspace: &Workspace, a: Point2<f64>, b: Point2<f64>) -> Option<Pieces> {
    let ends = [a, b].map(|at| (at, workspace.locate(at)));
    let [from, to] = ends.map(|(_, place)| place.letter());
    let (from, to) = (from?, to?);
    let stretches = workspace.trace_located(ends).ok()?;
    let mut found: Pieces = smallvec![(from, a)];
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
