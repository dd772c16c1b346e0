//! A suffix that begins earlier: what the prefix visits, every round visits, too.
//!
//! Where a unit of the prefix costs more than one of the suffix, a longer round is cheap if it makes the prefix shorter,
//! down to a round that begins at the start.

use super::chain::{Chain, length};
use super::enter::Walk;
use super::{SWEEPS, Shortener};
use crate::plan::{Cost, Path};

/// How many beginnings are given to the automaton, the cheapest first.
const TRIES: usize = 5;

impl Shortener<'_> {
    /// Makes a plan whose suffix begins at an earlier point of the prefix, goes on as the prefix does, around as before,
    /// and back to that point, if that is cheaper. Whether that does what the task wants is for the automaton to say.
    pub(crate) fn begin_earlier(&self, path: &Path, walk: Walk<'_>) -> Option<(Path, Cost)> {
        let chain = Chain::of_path(path);
        let (before, after) = self.shares();
        let cost = |chain: &Chain| {
            let (prefix, round) = (&chain.points[..=chain.split], &chain.points[chain.split..]);
            let closing = round[0] - round[round.len() - 1];
            before * length(prefix) + after * (length(round) + closing.norm())
        };
        let limit = cost(&chain) - self.min_gain;
        let last = chain.points[chain.points.len() - 1];
        let begun = |from: usize| {
            let back = walk(last, chain.points[from]);
            let (_, bends) = back.split_last()?;
            let mut new = chain.clone();
            (new.split, new.stays) = (from, false);
            new.points.extend_from_slice(bends);
            Some((cost(&new), new))
        };
        let mut found: Vec<(f64, Chain)> = (0..chain.split).filter_map(begun).collect();
        found.retain(|f| f.0 < limit);
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().take(TRIES).find_map(|(_, mut new)| {
            self.realise(&new)?;
            self.improve(&mut new, SWEEPS);
            self.realise(&new)
                .filter(|(path, _)| self.is_firm_path(path))
        })
    }
}
