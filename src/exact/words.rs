//! Words of segments: which letters one meets in a row, each different sequence once.

use std::collections::HashMap;

use crate::alphabet::Letter;
use crate::automaton::Nba;

/// The number of a word in its [`Words`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct WordId(u32);

impl WordId {
    pub(super) fn index(self) -> usize {
        self.0 as usize
    }
}

/// The different words of a roadmap's segments.
#[derive(Clone, Debug, Default)]
pub(super) struct Words {
    words: Vec<Vec<Letter>>,
    numbers: HashMap<Vec<Letter>, WordId>,
}

impl Words {
    pub(super) fn intern(&mut self, word: &[Letter]) -> WordId {
        if let Some(&id) = self.numbers.get(word) {
            return id;
        }
        let id = WordId(self.words.len() as u32);
        self.words.push(word.to_vec());
        self.numbers.insert(word.to_vec(), id);
        id
    }

    pub(super) fn get(&self, id: WordId) -> &[Letter] {
        &self.words[id.index()]
    }

    pub(super) fn len(&self) -> usize {
        self.words.len()
    }
}

/// What an automaton does on letters and words, as lists of successor states.
#[derive(Clone, Debug)]
pub(super) struct Relations {
    /// `once[letter][q]`: the states after reading the letter once.
    once: Vec<Vec<Vec<u32>>>,
    /// `often[letter][q]`: the states after reading it once or more.
    often: Vec<Vec<Vec<u32>>>,
    /// For each word that was prepared, its steps.
    words: Vec<Option<Steps>>,
}

/// The automaton's steps along one segment, forwards and backwards.
#[derive(Clone, Debug)]
pub(super) struct Steps {
    pub(super) forward: Vec<Vec<u32>>,
    pub(super) backward: Vec<Vec<u32>>,
}

impl Relations {
    pub(super) fn new(nba: &Nba) -> Self {
        let letters: Vec<Letter> = nba.alphabet.letters().collect();
        let once: Vec<Vec<Vec<u32>>> = letters
            .iter()
            .map(|&l| {
                let row = |q| nba.successors(q, l).map(|t| t.0).collect();
                nba.states().map(row).collect()
            })
            .collect();
        let often = once.iter().map(|rows| closure(rows)).collect();
        Self {
            once,
            often,
            words: Vec::new(),
        }
    }

    pub(super) fn once(&self, letter: Letter, state: u32) -> &[u32] {
        &self.once[letter.index()][state as usize]
    }

    pub(super) fn often(&self, letter: Letter, state: u32) -> &[u32] {
        &self.often[letter.index()][state as usize]
    }

    /// The states before one reading of `letter` that leads to `state`.
    pub(super) fn backward_once(&self, letter: Letter) -> Vec<Vec<u32>> {
        transpose(&self.once[letter.index()])
    }

    /// Finds the steps along a word: its first letter is read once (more often at no length:
    /// the robot waits), those between once or more, and its last at the far end.
    pub(super) fn prepare(&mut self, id: WordId, words: &Words) {
        if self.words.len() < words.len() {
            self.words.resize(words.len(), None);
        }
        if self.words[id.index()].is_some() {
            return;
        }
        let word = words.get(id);
        let mut forward = self.once[word[0].index()].clone();
        let between = word.get(1..word.len() - 1).unwrap_or_default();
        for &letter in between {
            let step = &self.often[letter.index()];
            for row in &mut forward {
                let mut next: Vec<u32> = row
                    .iter()
                    .flat_map(|&q| step[q as usize].iter().copied())
                    .collect();
                next.sort_unstable();
                next.dedup();
                *row = next;
            }
        }
        let backward = transpose(&forward);
        self.words[id.index()] = Some(Steps { forward, backward });
    }

    /// The steps along a prepared word.
    pub(super) fn steps(&self, id: WordId) -> Option<&Steps> {
        self.words.get(id.index()).and_then(Option::as_ref)
    }
}

fn closure(rows: &[Vec<u32>]) -> Vec<Vec<u32>> {
    let reach = |from: usize| {
        let mut seen = vec![false; rows.len()];
        let mut stack: Vec<u32> = rows[from].clone();
        while let Some(q) = stack.pop() {
            if !std::mem::replace(&mut seen[q as usize], true) {
                stack.extend(&rows[q as usize]);
            }
        }
        (0..rows.len() as u32)
            .filter(|&q| seen[q as usize])
            .collect()
    };
    (0..rows.len()).map(reach).collect()
}

fn transpose(rows: &[Vec<u32>]) -> Vec<Vec<u32>> {
    let mut columns = vec![Vec::new(); rows.len()];
    for (from, row) in rows.iter().enumerate() {
        for &to in row {
            columns[to as usize].push(from as u32);
        }
    }
    columns
}
