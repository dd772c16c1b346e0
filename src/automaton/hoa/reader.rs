//! The grammar of the Hanoi omega-automata format.

use std::collections::HashMap;
use std::sync::Arc;

use super::error::{HoaError, HoaErrorKind};
use super::lexer::{Lexer, Token};
use crate::alphabet::{Alphabet, LetterSet, MAX_POWERSET};
use crate::automaton::graph::{MAX_MARKS, Marks};
use crate::automaton::limits::Limits;

/// An automaton as it stands in the text.
pub(super) struct Automaton {
    pub(super) alphabet: Arc<Alphabet>,
    pub(super) starts: Vec<u32>,
    /// How many sets the condition speaks of; a run must see all of them infinitely often.
    pub(super) marks: u32,
    /// By state: target, marks, letters.
    pub(super) edges: Vec<Vec<(u32, Marks, LetterSet)>>,
}

/// The header while it is read.
#[derive(Default)]
struct Header {
    states: Option<usize>,
    starts: Vec<u32>,
    propositions: Option<Vec<String>>,
    /// For each acceptance set its mark, if the condition speaks of it.
    sets: Option<Vec<Option<u32>>>,
    aliases: HashMap<String, LetterSet>,
}

pub(super) struct Reader<'t> {
    pub(super) lexer: Lexer<'t>,
    given: Option<Arc<Alphabet>>,
    limits: &'t Limits,
    /// The letters of the automaton being read, once they are known.
    alphabet: Option<Arc<Alphabet>>,
    /// For each proposition of the file its letters.
    pub(super) meanings: Vec<LetterSet>,
    pub(super) nesting: usize,
    edges: usize,
}

pub(super) type Result<T> = std::result::Result<T, HoaError>;

impl<'t> Reader<'t> {
    pub(super) fn new(
        text: &'t str,
        given: Option<Arc<Alphabet>>,
        limits: &'t Limits,
    ) -> Result<Self> {
        Ok(Self {
            lexer: Lexer::new(text)?,
            given,
            limits,
            alphabet: None,
            meanings: Vec::new(),
            nesting: 0,
            edges: 0,
        })
    }

    pub(super) fn at_end(&self) -> bool {
        self.lexer.token == Token::Eof
    }

    pub(super) fn error(&self, kind: HoaErrorKind) -> HoaError {
        self.lexer.error(kind)
    }

    /// Checks that nothing follows.
    pub(super) fn finish(&self) -> Result<()> {
        match self.at_end() {
            true => Ok(()),
            false => Err(self
                .lexer
                .expected("the end of the text after one automaton")),
        }
    }

    pub(super) fn inconsistent<T>(&self, what: impl Into<String>) -> Result<T> {
        Err(self.error(HoaErrorKind::Inconsistent(what.into())))
    }

    fn unsupported<T>(&self, what: impl Into<String>) -> Result<T> {
        Err(self.error(HoaErrorKind::Unsupported(what.into())))
    }

    pub(super) fn automaton(&mut self) -> Result<Automaton> {
        self.alphabet = None;
        self.meanings.clear();
        self.edges = 0;
        let header = self.header()?;
        let alphabet = self.alphabet()?;
        let Some(sets) = header.sets else {
            return self.inconsistent("the header has no `Acceptance:`");
        };
        let marks = sets.iter().flatten().count() as u32;
        let mut edges = self.body(header.states, &sets, &header.aliases)?;
        let largest = header
            .starts
            .iter()
            .map(|&q| q as usize + 1)
            .max()
            .unwrap_or(0);
        if header.states.is_none() && edges.len() < largest {
            edges.resize_with(largest, Vec::new);
        }
        Ok(Automaton {
            alphabet,
            starts: header.starts,
            marks,
            edges,
        })
    }

    fn header(&mut self) -> Result<Header> {
        if self.lexer.token != Token::Header("HOA".to_owned()) {
            return Err(self.lexer.expected("`HOA: v1`"));
        }
        self.lexer.advance()?;
        match &self.lexer.token {
            Token::Word(version) if version == "v1" => self.lexer.advance()?,
            Token::Word(version) => {
                let what = format!("version `{version}` of the HOA format");
                return self.unsupported(what);
            }
            _ => return Err(self.lexer.expected("the version `v1`")),
        }
        let mut header = Header::default();
        loop {
            let name = match &self.lexer.token {
                Token::Header(name) => name.clone(),
                Token::Body => {
                    self.lexer.advance()?;
                    break;
                }
                Token::Abort => return Err(self.error(HoaErrorKind::Aborted)),
                _ => return Err(self.lexer.expected("a header item or `--BODY--`")),
            };
            self.item(&name, &mut header)?;
        }
        if let Some(states) = header.states
            && let Some(q) = header.starts.iter().find(|&&q| q as usize >= states)
        {
            return self.inconsistent(format!("start {q} is not one of the {states} states"));
        }
        Ok(header)
    }

    fn item(&mut self, name: &str, header: &mut Header) -> Result<()> {
        let twice = match name {
            "HOA" => true,
            "States" => header.states.is_some(),
            "AP" => header.propositions.is_some(),
            "Acceptance" => header.sets.is_some(),
            _ => false,
        };
        if twice {
            return self.inconsistent(format!("`{name}:` stands twice in one header"));
        }
        if !matches!(name, "States" | "Start" | "AP" | "Alias" | "Acceptance")
            && name.starts_with(|c: char| c.is_ascii_uppercase())
        {
            return self.unsupported(format!("the header item `{name}:`"));
        }
        self.lexer.advance()?;
        match name {
            "States" => header.states = Some(self.state_count()?),
            "Start" => header.starts.push(self.state(header.states)?),
            "AP" => header.propositions = Some(self.propositions()?),
            "Alias" => self.alias(&mut header.aliases)?,
            "Acceptance" => header.sets = Some(self.acceptance()?),
            _ => self.skip_item()?,
        }
        Ok(())
    }

    fn skip_item(&mut self) -> Result<()> {
        while !matches!(
            self.lexer.token,
            Token::Header(_) | Token::Body | Token::End | Token::Abort | Token::Eof
        ) {
            self.lexer.advance()?;
        }
        Ok(())
    }

    fn state_count(&mut self) -> Result<usize> {
        let span = self.lexer.span.clone();
        let n = self.lexer.number("the number of states")?;
        match usize::try_from(n) {
            Ok(n) if n <= self.limits.states => Ok(n),
            _ => {
                let limit = self.limits.states;
                Err(self.lexer.error_at(HoaErrorKind::States { limit }, span))
            }
        }
    }

    /// A state's number, and a check that no `&` makes it alternating.
    fn state(&mut self, states: Option<usize>) -> Result<u32> {
        let span = self.lexer.span.clone();
        let n = self.lexer.number("the number of a state")?;
        let limit = self.limits.states;
        let bound = states.unwrap_or(limit);
        if n >= bound as u64 {
            let kind = match states {
                Some(states) => HoaErrorKind::Inconsistent(format!(
                    "state {n} is not one of the {states} states"
                )),
                None => HoaErrorKind::States { limit },
            };
            return Err(self.lexer.error_at(kind, span));
        }
        if self.lexer.token == Token::Symbol('&') {
            return self.unsupported("alternation (`&` between states)");
        }
        Ok(n as u32)
    }

    fn propositions(&mut self) -> Result<Vec<String>> {
        let span = self.lexer.span.clone();
        let n = self.lexer.number("the number of propositions")?;
        let mut names: Vec<String> = Vec::new();
        while let Token::Text(name) = &self.lexer.token {
            let name = name.clone();
            if names.contains(&name) {
                return self.inconsistent(format!("proposition \"{name}\" is named twice"));
            }
            if let Some(given) = &self.given
                && given.proposition(&name).is_none()
            {
                return Err(self.error(HoaErrorKind::UnknownProposition {
                    name,
                    known: given.propositions().to_vec(),
                }));
            }
            names.push(name);
            self.lexer.advance()?;
        }
        if names.len() as u64 != n {
            let what = format!("{n} propositions are announced, {} are named", names.len());
            return Err(self.lexer.error_at(HoaErrorKind::Inconsistent(what), span));
        }
        let alphabet = match &self.given {
            Some(given) => given.clone(),
            None => Arc::new(Alphabet::powerset(names.clone()).map_err(|_| {
                let limit = MAX_POWERSET;
                let what = "propositions";
                self.lexer
                    .error_at(HoaErrorKind::TooLarge { what, limit }, span)
            })?),
        };
        self.meanings = names
            .iter()
            .filter_map(|name| alphabet.proposition(name))
            .map(|i| alphabet.letters_with(i))
            .collect();
        self.alphabet = Some(alphabet);
        Ok(names)
    }

    /// The letters; those of no proposition at all if there was no `AP:`.
    pub(super) fn alphabet(&mut self) -> Result<Arc<Alphabet>> {
        if let Some(alphabet) = &self.alphabet {
            return Ok(alphabet.clone());
        }
        let alphabet = match &self.given {
            Some(given) => given.clone(),
            None => Arc::new(
                Alphabet::powerset(Vec::new())
                    .map_err(|e| self.error(HoaErrorKind::Inconsistent(e.to_string())))?,
            ),
        };
        self.alphabet = Some(alphabet.clone());
        Ok(alphabet)
    }

    fn alias(&mut self, aliases: &mut HashMap<String, LetterSet>) -> Result<()> {
        let Token::Alias(name) = self.lexer.token.clone() else {
            return Err(self.lexer.expected("an alias `@name`"));
        };
        if aliases.contains_key(&name) {
            return self.inconsistent(format!("alias `@{name}` is defined twice"));
        }
        self.lexer.advance()?;
        let label = self.label(aliases)?;
        aliases.insert(name, label);
        Ok(())
    }

    /// The number of sets and the condition: for each set its mark if the condition has it.
    fn acceptance(&mut self) -> Result<Vec<Option<u32>>> {
        let n = self.lexer.number("the number of acceptance sets")?;
        if n > 1 << 16 {
            let (what, limit) = ("acceptance sets", 1 << 16);
            return Err(self.error(HoaErrorKind::TooLarge { what, limit }));
        }
        let mut used = vec![false; n as usize];
        self.condition(&mut used)?;
        if used.iter().filter(|&&u| u).count() > MAX_MARKS {
            let (what, limit) = ("acceptance sets", MAX_MARKS);
            return Err(self.error(HoaErrorKind::TooLarge { what, limit }));
        }
        let mut next = 0;
        let number = |used: bool| {
            let mark = used.then_some(next);
            next += u32::from(used);
            mark
        };
        Ok(used.into_iter().map(number).collect())
    }

    fn condition(&mut self, used: &mut [bool]) -> Result<()> {
        loop {
            self.infinitely_often(used)?;
            if self.lexer.token == Token::Symbol('|') {
                return self.unsupported("an acceptance condition with `|`");
            }
            if !self.lexer.accept('&')? {
                return Ok(());
            }
        }
    }

    fn infinitely_often(&mut self, used: &mut [bool]) -> Result<()> {
        match self.lexer.token.clone() {
            Token::Word(word) if word == "t" => self.lexer.advance(),
            Token::Word(word) if word == "f" => {
                self.unsupported("the acceptance condition `f` (no run accepts)")
            }
            Token::Word(word) if word == "Fin" => {
                self.unsupported("an acceptance condition with `Fin`")
            }
            Token::Word(word) if word == "Inf" => {
                self.lexer.advance()?;
                self.lexer.require('(')?;
                if self.lexer.token == Token::Symbol('!') {
                    return self.unsupported("a complemented acceptance set (`!`)");
                }
                let span = self.lexer.span.clone();
                let i = self.lexer.number("the number of an acceptance set")?;
                match usize::try_from(i).ok().and_then(|i| used.get_mut(i)) {
                    Some(used) => *used = true,
                    None => {
                        let what =
                            format!("set {i} is not one of the {} acceptance sets", used.len());
                        return Err(self.lexer.error_at(HoaErrorKind::Inconsistent(what), span));
                    }
                }
                self.lexer.require(')')
            }
            Token::Symbol('(') => {
                self.lexer.advance()?;
                self.nested(|reader| reader.condition(used))?;
                self.lexer.require(')')
            }
            _ => Err(self.lexer.expected("`Inf(…)`, `t` or `(`")),
        }
    }

    /// `{0 1}`: the marks of the sets that the condition has.
    fn sets(&mut self, sets: &[Option<u32>]) -> Result<Marks> {
        let mut marks = 0;
        if !self.lexer.accept('{')? {
            return Ok(marks);
        }
        while let Token::Number(n) = self.lexer.token {
            match usize::try_from(n).ok().and_then(|n| sets.get(n)) {
                Some(Some(mark)) => marks |= 1 << mark,
                Some(None) => {}
                None => {
                    let count = sets.len();
                    let what = format!("set {n} is not one of the {count} acceptance sets");
                    return self.inconsistent(what);
                }
            }
            self.lexer.advance()?;
        }
        self.lexer.require('}')?;
        Ok(marks)
    }

    #[allow(clippy::type_complexity)] // the type of Automaton's field
    fn body(
        &mut self,
        states: Option<usize>,
        sets: &[Option<u32>],
        aliases: &HashMap<String, LetterSet>,
    ) -> Result<Vec<Vec<(u32, Marks, LetterSet)>>> {
        let mut rows: Vec<Option<Vec<_>>> = Vec::new();
        rows.resize_with(states.unwrap_or(0), || None);
        loop {
            match &self.lexer.token {
                Token::End => {
                    self.lexer.advance()?;
                    return Ok(rows.into_iter().map(Option::unwrap_or_default).collect());
                }
                Token::Abort => return Err(self.error(HoaErrorKind::Aborted)),
                Token::Header(name) if name == "State" => self.lexer.advance()?,
                _ => return Err(self.lexer.expected("`State:` or `--END--`")),
            }
            let label = self.bracketed(aliases)?;
            let span = self.lexer.span.clone();
            let q = self.state(states)? as usize;
            if let Token::Text(_) = self.lexer.token {
                self.lexer.advance()?;
            }
            let marks = self.sets(sets)?;
            let row = self.edges(label, marks, states, sets, aliases)?;
            let largest = row
                .iter()
                .map(|e| e.0 as usize)
                .chain([q])
                .max()
                .unwrap_or(q);
            if rows.len() <= largest {
                rows.resize_with(largest + 1, || None);
            }
            if rows[q].replace(row).is_some() {
                let what = format!("state {q} is listed twice");
                return Err(self.lexer.error_at(HoaErrorKind::Inconsistent(what), span));
            }
        }
    }

    fn edges(
        &mut self,
        state_label: Option<LetterSet>,
        state_marks: Marks,
        states: Option<usize>,
        sets: &[Option<u32>],
        aliases: &HashMap<String, LetterSet>,
    ) -> Result<Vec<(u32, Marks, LetterSet)>> {
        let start = self.lexer.span.clone();
        let mut row: Vec<(u32, Marks, LetterSet)> = Vec::new();
        let mut implicit = 0usize;
        while matches!(self.lexer.token, Token::Symbol('[') | Token::Number(_)) {
            let span = self.lexer.span.clone();
            let label = self.bracketed(aliases)?;
            let guard = match (label, &state_label) {
                (Some(_), Some(_)) => {
                    let what = "an edge has a label although its state has one";
                    let kind = HoaErrorKind::Inconsistent(what.to_owned());
                    return Err(self.lexer.error_at(kind, span));
                }
                (Some(label), None) => label,
                (None, Some(label)) => label.clone(),
                (None, None) => {
                    implicit += 1;
                    self.valuation(implicit - 1)?
                }
            };
            let target = self.state(states)?;
            let marks = state_marks | self.sets(sets)?;
            self.edges += 1;
            if self.edges > self.limits.transitions {
                let limit = self.limits.transitions;
                let kind = HoaErrorKind::Transitions { limit };
                return Err(self.lexer.error_at(kind, span));
            }
            row.push((target, marks, guard));
        }
        if implicit > 0 && implicit != row.len() {
            let what = "labelled and unlabelled edges are mixed in one state";
            return Err(self
                .lexer
                .error_at(HoaErrorKind::Inconsistent(what.to_owned()), start));
        }
        let count = 1usize.checked_shl(self.meanings.len() as u32);
        if implicit > 0 && Some(implicit) != count {
            let what = format!(
                "a state with implicit labels needs one edge for each of the 2^{} valuations, found {implicit}",
                self.meanings.len()
            );
            return Err(self.lexer.error_at(HoaErrorKind::Inconsistent(what), start));
        }
        Ok(row)
    }
}
