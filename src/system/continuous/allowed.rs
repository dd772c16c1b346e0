//! Which shortest ways around obstacles keep to allowed letters by themselves.

use nalgebra::Point2;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use crate::alphabet::LetterSet;
use crate::workspace::Workspace;

/// Answers are kept for so many ends of ways at most.
const MAX_KEPT: usize = 1 << 16;

/// The number of a set of letters; a bend and the target of the way from there on, by the bits of their coordinates.
type Rest = (usize, [[u64; 2]; 2]);

/// What is known of ways by the points that they bend at: all ways to one target that bend at the same point are the same from
/// there on, and long ways among many walls share most of their bends.
#[derive(Debug, Default)]
pub(super) struct Allowed {
    sets: Vec<LetterSet>,
    rests: FxHashMap<Rest, bool>,
}

impl Allowed {
    /// Whether a shortest way from `from` by `bends`, of which the last is the target, keeps to the letters of `through`.
    pub(super) fn keeps(
        &mut self,
        map: &Workspace,
        from: Point2<f64>,
        bends: &[Point2<f64>],
        through: &LetterSet,
    ) -> bool {
        let [first, .., target] = bends else {
            return bends.iter().all(|&to| map.keeps_to(from, to, through));
        };
        map.keeps_to(from, *first, through) && self.rest(map, bends, *target, through)
    }

    /// Whether the rest of a way from the first of `bends` on keeps to the letters.
    fn rest(
        &mut self,
        map: &Workspace,
        bends: &[Point2<f64>],
        target: Point2<f64>,
        through: &LetterSet,
    ) -> bool {
        // What is forgotten is found again, with the same answers.
        if self.rests.len() >= MAX_KEPT {
            *self = Self::default();
        }
        let known = self.sets.iter().position(|set| set == through);
        let set = known.unwrap_or_else(|| {
            self.sets.push(through.clone());
            self.sets.len() - 1
        });
        let mut new: SmallVec<[Rest; 16]> = SmallVec::new();
        let mut allowed = true;
        for leg in bends.windows(2) {
            let rest = (set, [bits(leg[0]), bits(target)]);
            if let Some(&known) = self.rests.get(&rest) {
                allowed = known;
                break;
            }
            new.push(rest);
            if !map.keeps_to(leg[0], leg[1], through) {
                allowed = false;
                break;
            }
        }
        self.rests
            .extend(new.into_iter().map(|rest| (rest, allowed)));
        allowed
    }
}

fn bits(p: Point2<f64>) -> [u64; 2] {
    [p.x.to_bits(), p.y.to_bits()]
}
