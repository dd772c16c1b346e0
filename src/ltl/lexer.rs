//! Splitting formula text into tokens.
//!
//! What a letter means depends on where it stands, as in Spot's own scanner: where an *operand* is
//! expected `F`, `G` and `X` at the start of a word are operators (`GFa` is `G F a`) and all other
//! words are propositions (`Ub` is one); where an *operator* is expected `U`, `R`, `V`, `W` and `M`
//! at the start of a word are operators (`a Ub` is `a U b`).

use std::ops::Range;

use super::error::{ParseError, ParseErrorKind, Unsupported};

/// What can stand where an operand is expected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Operand {
    True,
    False,
    Prop(String),
    Not,
    Next,
    Finally,
    Globally,
    Open,
}

/// What can stand after an operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operator {
    And,
    Or,
    Xor,
    Implies,
    Iff,
    Until,
    Release,
    WeakUntil,
    StrongRelease,
    Close,
    End,
}

const OPERANDS: &str = "a proposition, `!`, `X`, `F`, `G`, `true`, `false` or `(`";
const OPERATORS: &str =
    "an operator (`&`, `|`, `->`, `<->`, `xor`, `U`, `R`, `W`, `M`), `)` or the end";

/// Symbols of operands, longest first among those with a common start.
const OPERAND_SYMBOLS: [(&str, Operand); 13] = [
    ("[]", Operand::Globally),
    ("<>", Operand::Finally),
    ("□", Operand::Globally),
    ("◻", Operand::Globally),
    ("◇", Operand::Finally),
    ("◊", Operand::Finally),
    ("⋄", Operand::Finally),
    ("○", Operand::Next),
    ("◯", Operand::Next),
    ("!", Operand::Not),
    ("~", Operand::Not),
    ("¬", Operand::Not),
    ("(", Operand::Open),
];

/// Symbols of operators, longest first among those with a common start.
const OPERATOR_SYMBOLS: [(&str, Operator); 20] = [
    ("<->", Operator::Iff),
    ("<=>", Operator::Iff),
    ("<-->", Operator::Iff),
    ("-->", Operator::Implies),
    ("->", Operator::Implies),
    ("=>", Operator::Implies),
    ("&&", Operator::And),
    ("&", Operator::And),
    ("/\\", Operator::And),
    ("||", Operator::Or),
    ("|", Operator::Or),
    ("\\/", Operator::Or),
    ("^", Operator::Xor),
    ("∧", Operator::And),
    ("∨", Operator::Or),
    ("→", Operator::Implies),
    ("⇒", Operator::Implies),
    ("↔", Operator::Iff),
    ("⇔", Operator::Iff),
    (")", Operator::Close),
];

fn starts_name(c: char) -> bool {
    c.is_alphabetic() || c == '_'
}

fn continues_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_' || c == '.'
}

/// Words that are no propositions unless they are quoted or declared.
fn keyword(word: &str) -> Option<Operand> {
    match word.to_ascii_lowercase().as_str() {
        "true" => Some(Operand::True),
        "false" => Some(Operand::False),
        "not" => Some(Operand::Not),
        "always" => Some(Operand::Globally),
        "eventually" => Some(Operand::Finally),
        "next" => Some(Operand::Next),
        _ => None,
    }
}

/// Whether a word that starts like this starts with a prefix operator.
fn starts_with_prefix_operator(word: &str) -> bool {
    let mut chars = word.chars();
    matches!(chars.next(), Some('F' | 'G' | 'X'))
        && !chars.next().is_some_and(|c| c.is_ascii_digit())
}

/// Whether `name`, printed without quotes, is read back as one proposition.
pub(super) fn is_bare_name(name: &str) -> bool {
    name.chars().next().is_some_and(starts_name)
        && name.chars().all(continues_name)
        && keyword(name).is_none()
        && !starts_with_prefix_operator(name)
}

/// A scanner over one formula's text.
pub(super) struct Lexer<'t> {
    text: &'t str,
    known: &'t [String],
    at: usize,
}

impl<'t> Lexer<'t> {
    pub(super) fn new(text: &'t str, known: &'t [String]) -> Self {
        Self { text, known, at: 0 }
    }

    pub(super) fn error(&self, kind: ParseErrorKind, span: Range<usize>) -> ParseError {
        ParseError::new(kind, self.text, span)
    }

    fn rest(&self) -> &'t str {
        &self.text[self.at..]
    }

    fn skip_blanks(&mut self) {
        self.at = self.text.len() - self.rest().trim_start().len();
    }

    fn take(&mut self, bytes: usize) -> Range<usize> {
        let start = self.at;
        self.at += bytes;
        start..self.at
    }

    fn word(&self) -> &'t str {
        let rest = self.rest();
        if !rest.starts_with(starts_name) {
            return "";
        }
        let end = rest.find(|c| !continues_name(c)).unwrap_or(rest.len());
        &rest[..end]
    }

    /// Reads a token where an operand is expected.
    pub(super) fn operand(&mut self) -> Result<(Operand, Range<usize>), ParseError> {
        self.skip_blanks();
        let word = self.word();
        if !word.is_empty() {
            return Ok(self.operand_word(word));
        }
        let rest = self.rest();
        if rest.starts_with('"') {
            return self.quoted();
        }
        for (symbol, token) in &OPERAND_SYMBOLS {
            if rest.starts_with(symbol) {
                let span = self.take(symbol.len());
                return Ok((token.clone(), span));
            }
        }
        let digits = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        match &rest[..digits] {
            "1" => Ok((Operand::True, self.take(1))),
            "0" => Ok((Operand::False, self.take(1))),
            _ => Err(self.bad_operand()),
        }
    }

    fn operand_word(&mut self, word: &str) -> (Operand, Range<usize>) {
        if !self.known.iter().any(|k| k == word) {
            if let Some(token) = keyword(word) {
                return (token, self.take(word.len()));
            }
            if starts_with_prefix_operator(word) {
                let token = match word.as_bytes()[0] {
                    b'F' => Operand::Finally,
                    b'G' => Operand::Globally,
                    _ => Operand::Next,
                };
                return (token, self.take(1));
            }
        }
        (Operand::Prop(word.to_owned()), self.take(word.len()))
    }

    fn quoted(&mut self) -> Result<(Operand, Range<usize>), ParseError> {
        let mut name = String::new();
        let mut chars = self.rest().char_indices().skip(1);
        while let Some((i, c)) = chars.next() {
            match c {
                '"' => {
                    let span = self.take(i + 1);
                    if name.is_empty() {
                        return Err(self.error(ParseErrorKind::EmptyName, span));
                    }
                    return Ok((Operand::Prop(name), span));
                }
                '\\' => name.extend(chars.next().map(|(_, c)| c)),
                c => name.push(c),
            }
        }
        let span = self.at..self.text.len();
        Err(self.error(ParseErrorKind::UnterminatedName, span))
    }

    fn bad_operand(&self) -> ParseError {
        let rest = self.rest();
        if rest.is_empty() {
            let kind = ParseErrorKind::UnexpectedEnd { expected: OPERANDS };
            return self.error(kind, self.at..self.at);
        }
        if rest.starts_with('{') {
            return self.unsupported(Unsupported::RegularExpression, 1);
        }
        if rest.starts_with("[!]") {
            return self.unsupported(Unsupported::StrongNext, 3);
        }
        if rest.starts_with("[*") || rest.starts_with("[+]") || rest.starts_with("[=") {
            return self.unsupported(Unsupported::RegularExpression, 2);
        }
        if rest.starts_with('[') {
            return self.unsupported(Unsupported::Bounds, 1);
        }
        self.unexpected(OPERANDS)
    }

    fn unsupported(&self, what: Unsupported, bytes: usize) -> ParseError {
        self.error(ParseErrorKind::Unsupported(what), self.at..self.at + bytes)
    }

    fn unexpected(&self, expected: &'static str) -> ParseError {
        let rest = self.rest();
        let word = self.word();
        let digits = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        let quoted = rest
            .starts_with('"')
            .then(|| rest.find(' ').unwrap_or(rest.len()));
        let len = [word.len(), digits, quoted.unwrap_or(0)]
            .into_iter()
            .find(|&n| n > 0)
            .or_else(|| rest.chars().next().map(char::len_utf8))
            .unwrap_or(0);
        let found = rest[..len].to_owned();
        let kind = ParseErrorKind::Unexpected { found, expected };
        self.error(kind, self.at..self.at + len)
    }

    /// Reads a token where an operator is expected. `last` is the proposition just read, if one
    /// was: it may turn out to have been meant as an operator of another logic.
    pub(super) fn operator(
        &mut self,
        last: Option<(&str, Range<usize>)>,
    ) -> Result<(Operator, Range<usize>), ParseError> {
        self.skip_blanks();
        let rest = self.rest();
        if rest.is_empty() {
            return Ok((Operator::End, self.at..self.at));
        }
        for (symbol, token) in OPERATOR_SYMBOLS {
            if rest.starts_with(symbol) {
                return Ok((token, self.take(symbol.len())));
            }
        }
        let word = self.word();
        let by_word = match word.to_ascii_lowercase().as_str() {
            "and" => Some((Operator::And, 3)),
            "or" => Some((Operator::Or, 2)),
            "xor" => Some((Operator::Xor, 3)),
            "implies" => Some((Operator::Implies, 7)),
            "equivalent" => Some((Operator::Iff, 10)),
            "until" => Some((Operator::Until, 5)),
            "stronguntil" => Some((Operator::Until, 11)),
            "weakuntil" => Some((Operator::WeakUntil, 9)),
            "release" => Some((Operator::Release, 7)),
            _ => match word.chars().next() {
                Some('U') => Some((Operator::Until, 1)),
                Some('R' | 'V') => Some((Operator::Release, 1)),
                Some('W') => Some((Operator::WeakUntil, 1)),
                Some('M') => Some((Operator::StrongRelease, 1)),
                _ => None,
            },
        };
        match by_word {
            Some((token, bytes)) => Ok((token, self.take(bytes))),
            None => Err(self.bad_operator(word, last)),
        }
    }

    fn bad_operator(&self, word: &str, last: Option<(&str, Range<usize>)>) -> ParseError {
        let rest = self.rest();
        let operand_follows = !word.is_empty() || rest.starts_with(['(', '!', '~', '"', '[', '<']);
        if let Some((name, span)) = last
            && operand_follows
        {
            let meant = match name {
                "Y" | "O" | "H" | "Z" | "P" => Some(Unsupported::Past),
                "A" | "E" | "AG" | "AF" | "AX" | "EG" | "EF" | "EX" => {
                    Some(Unsupported::PathQuantifier)
                }
                _ => None,
            };
            if let Some(what) = meant {
                return self.error(ParseErrorKind::Unsupported(what), span);
            }
        }
        if matches!(word, "S" | "T" | "B") {
            return self.unsupported(Unsupported::Past, 1);
        }
        if rest.starts_with('{') || rest.starts_with("[*") || rest.starts_with("[+]") {
            return self.unsupported(Unsupported::RegularExpression, 1);
        }
        if let Some(value) = rest.strip_prefix('=')
            && value.trim_start().starts_with(continues_name)
        {
            return self.unsupported(Unsupported::Values, 1);
        }
        self.unexpected(OPERATORS)
    }
}

/// Why `name` could not be written in a formula as it is, if so.
pub(crate) fn bad_name(name: &str) -> Option<&'static str> {
    let starts = |c: char| c.is_alphabetic() || c == '_';
    let continues = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
    let words = ["true", "false", "not", "and", "or", "xor"];
    if name.is_empty() {
        Some("a name needs at least one letter")
    } else if !name.starts_with(starts) || !name.chars().all(continues) {
        Some("a name begins with a letter or `_` and goes on with letters, digits, `_` and `.`")
    } else if words.contains(&name.to_ascii_lowercase().as_str()) {
        Some("this word has a meaning of its own in formulas")
    } else if name.chars().all(|c| "FGX".contains(c)) || ["U", "R", "V", "W", "M"].contains(&name) {
        Some("these letters are operators of formulas")
    } else {
        None
    }
}
