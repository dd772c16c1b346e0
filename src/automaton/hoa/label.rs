//! Labels: Boolean expressions over propositions, read as sets of letters.

use std::collections::HashMap;

use super::error::HoaErrorKind;
use super::lexer::Token;
use super::reader::{Reader, Result};
use crate::alphabet::LetterSet;

/// The deepest nesting of parentheses and negations in a label or an acceptance condition.
const MAX_NESTING: usize = 200;

impl Reader<'_> {
    pub(super) fn nested<T>(&mut self, inner: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        if self.nesting >= MAX_NESTING {
            let (what, limit) = ("levels of nesting", MAX_NESTING);
            return Err(self.error(HoaErrorKind::TooLarge { what, limit }));
        }
        self.nesting += 1;
        let result = inner(self);
        self.nesting -= 1;
        result
    }

    /// A Boolean expression over propositions: `|` of `&` of `!`.
    pub(super) fn label(&mut self, aliases: &HashMap<String, LetterSet>) -> Result<LetterSet> {
        let mut either = self.conjunction(aliases)?;
        while self.lexer.accept('|')? {
            let other = self.conjunction(aliases)?;
            either.union_with(&other);
        }
        Ok(either)
    }

    fn conjunction(&mut self, aliases: &HashMap<String, LetterSet>) -> Result<LetterSet> {
        let mut both = self.atom(aliases)?;
        while self.lexer.accept('&')? {
            let other = self.atom(aliases)?;
            both.intersect_with(&other);
        }
        Ok(both)
    }

    fn atom(&mut self, aliases: &HashMap<String, LetterSet>) -> Result<LetterSet> {
        let alphabet = self.alphabet()?;
        let set = match self.lexer.token.clone() {
            Token::Symbol('!') => {
                self.lexer.advance()?;
                return Ok(self.nested(|reader| reader.atom(aliases))?.complement());
            }
            Token::Symbol('(') => {
                self.lexer.advance()?;
                let set = self.nested(|reader| reader.label(aliases))?;
                self.lexer.require(')')?;
                return Ok(set);
            }
            Token::Word(word) if word == "t" => alphabet.all(),
            Token::Word(word) if word == "f" => alphabet.none(),
            Token::Alias(name) => match aliases.get(&name) {
                Some(set) => set.clone(),
                None => return self.inconsistent(format!("alias `@{name}` is not defined")),
            },
            Token::Number(n) => {
                let known = usize::try_from(n).ok().and_then(|n| self.meanings.get(n));
                match known {
                    Some(set) => set.clone(),
                    None => {
                        let count = self.meanings.len();
                        let what = format!("proposition {n} is not one of the {count} in `AP:`");
                        return self.inconsistent(what);
                    }
                }
            }
            _ => {
                return Err(self
                    .lexer
                    .expected("a label (`t`, `f`, `!`, `(`, a number or an alias)"));
            }
        };
        self.lexer.advance()?;
        Ok(set)
    }

    pub(super) fn bracketed(
        &mut self,
        aliases: &HashMap<String, LetterSet>,
    ) -> Result<Option<LetterSet>> {
        if !self.lexer.accept('[')? {
            return Ok(None);
        }
        let label = self.label(aliases)?;
        self.lexer.require(']')?;
        Ok(Some(label))
    }

    /// The letters of valuation number `i`; proposition 0 is the lowest bit.
    pub(super) fn valuation(&mut self, i: usize) -> Result<LetterSet> {
        let mut letters = self.alphabet()?.all();
        for (bit, with) in self.meanings.iter().enumerate() {
            if bit < usize::BITS as usize && i >> bit & 1 == 1 {
                letters.intersect_with(with);
            } else {
                letters.subtract(with);
            }
        }
        Ok(letters)
    }
}
