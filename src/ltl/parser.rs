//! From text to [`Formula`].

use std::ops::Range;

use super::Formula;
use super::error::{ParseError, ParseErrorKind};
use super::lexer::{Lexer, Operand, Operator};

/// The deepest nesting that [`ParseOptions::max_depth`] can allow.
///
/// Formulas are walked recursively in a few places (cloning, comparing, dropping, rewriting): this
/// depth fits the smallest stack a thread usually has, with room to spare.
pub const MAX_DEPTH: usize = 1000;

/// Settings of [`parse`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParseOptions {
    /// The deepest tree that is accepted, in nodes from root to leaf; at most [`MAX_DEPTH`].
    /// 500 by default.
    pub max_depth: usize,
    /// Names that are propositions even though they start like operators: with `Goal` in this
    /// list `Goal` is a proposition, without it `G oal`. Empty by default.
    pub known: Vec<String>,
}

impl Default for ParseOptions {
    fn default() -> Self {
        Self {
            max_depth: 500,
            known: Vec::new(),
        }
    }
}

/// A proposition where it stands in the text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PropositionUse {
    /// Its name.
    pub name: String,
    /// The bytes of the text it takes, quotes included.
    pub span: Range<usize>,
}

/// A parsed formula with its text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parsed {
    /// The formula.
    pub formula: Formula,
    /// The text it was read from.
    pub text: String,
    /// Every use of a proposition, in reading order.
    pub uses: Vec<PropositionUse>,
}

impl Parsed {
    /// Words that were read as an operator and a proposition without a blank between, and look like a name: of `Goal` it
    /// gives `Goal` and `G oal`, of `GFa` and `Fl2` nothing.
    pub fn run_together(&self) -> impl Iterator<Item = (String, String)> {
        self.uses.iter().filter_map(|u| {
            let before = self.text[..u.span.start].chars().next_back()?;
            let name = &self.text[u.span.clone()];
            let looks = "FGX".contains(before)
                && name.chars().count() > 2
                && name.chars().all(|c| c.is_lowercase() || c == '_');
            looks.then(|| (format!("{before}{name}"), format!("{before} {name}")))
        })
    }
}

/// Reads a formula in the grammar of [`crate::ltl`].
///
/// # Errors
/// [`ParseError`] with the place in the text.
///
/// ```
/// use nngtl::ltl::{ParseOptions, parse};
/// let parsed = parse("[]<> l1 && (!l1 U l2) && <> l3", &ParseOptions::default())?;
/// assert_eq!(parsed.formula.to_string(), "GFl1 & !l1 U l2 & Fl3");
/// let error = parse("a U (b & ", &ParseOptions::default()).unwrap_err();
/// assert_eq!(error.line_column(), (1, 10));
/// # Ok::<(), nngtl::ltl::ParseError>(())
/// ```
pub fn parse(text: &str, options: &ParseOptions) -> Result<Parsed, ParseError> {
    let mut parser = Parser {
        lexer: Lexer::new(text, &options.known),
        limit: options.max_depth.min(MAX_DEPTH),
        nesting: 0,
        ahead: None,
        last: None,
        uses: Vec::new(),
    };
    let (formula, _) = parser.expression(0)?;
    match parser.peek()? {
        (Operator::End, _) => Ok(Parsed {
            formula,
            text: text.to_owned(),
            uses: parser.uses,
        }),
        (_, span) => Err(parser.lexer.error(ParseErrorKind::Unopened, span)),
    }
}

impl std::str::FromStr for Formula {
    type Err = ParseError;

    fn from_str(text: &str) -> Result<Self, ParseError> {
        parse(text, &ParseOptions::default()).map(|p| p.formula)
    }
}

/// Checks that every proposition of a formula is one of `names`.
///
/// # Errors
/// The first use of an unknown name, with the most similar one there is.
pub fn check_propositions<S: AsRef<str>>(parsed: &Parsed, names: &[S]) -> Result<(), ParseError> {
    let known = |name: &str| names.iter().any(|n| n.as_ref() == name);
    let Some(unknown) = parsed.uses.iter().find(|u| !known(&u.name)) else {
        return Ok(());
    };
    let kind = ParseErrorKind::UnknownProposition {
        name: unknown.name.clone(),
        similar: most_similar(&unknown.name, names),
        known: names.iter().map(|n| n.as_ref().to_owned()).collect(),
    };
    Err(ParseError::new(kind, &parsed.text, unknown.span.clone()))
}

fn most_similar<S: AsRef<str>>(name: &str, names: &[S]) -> Option<String> {
    let lower = name.to_lowercase();
    names
        .iter()
        .map(|n| {
            (
                edit_distance(&lower, &n.as_ref().to_lowercase()),
                n.as_ref(),
            )
        })
        .filter(|&(distance, n)| distance <= 1 + n.len().max(name.len()) / 4 && distance < n.len())
        .min_by_key(|&(distance, _)| distance)
        .map(|(_, n)| n.to_owned())
}

/// Levenshtein's distance, row by row.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &cb) in b.iter().enumerate() {
            let change = diagonal + usize::from(ca != cb);
            diagonal = row[j + 1];
            row[j + 1] = change.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

/// A formula and the depth of its tree.
type Tree = (Formula, usize);

struct Parser<'t> {
    lexer: Lexer<'t>,
    limit: usize,
    nesting: usize,
    ahead: Option<(Operator, Range<usize>)>,
    /// Whether the token before was a proposition (the last of `uses`).
    last: Option<usize>,
    uses: Vec<PropositionUse>,
}

/// How tightly a binary operator binds, and whether it groups to the right. As in Spot, `->` and
/// `<->` bind alike.
fn binding(operator: Operator) -> Option<(u8, bool)> {
    match operator {
        Operator::Implies | Operator::Iff => Some((1, true)),
        Operator::Or => Some((2, false)),
        Operator::Xor => Some((3, false)),
        Operator::And => Some((4, false)),
        Operator::Until | Operator::Release | Operator::WeakUntil | Operator::StrongRelease => {
            Some((5, true))
        }
        Operator::Close | Operator::End => None,
    }
}

fn combine(operator: Operator, a: Formula, b: Formula) -> Formula {
    match operator {
        Operator::And => a.and(b),
        Operator::Or => a.or(b),
        Operator::Xor => a.iff(b).not(),
        Operator::Implies => a.implies(b),
        Operator::Iff => a.iff(b),
        Operator::Until => a.until(b),
        Operator::Release => a.release(b),
        Operator::WeakUntil => a.weak_until(b),
        Operator::StrongRelease => a.strong_release(b),
        Operator::Close | Operator::End => unreachable!("only binary operators bind"),
    }
}

impl Parser<'_> {
    fn peek(&mut self) -> Result<(Operator, Range<usize>), ParseError> {
        if self.ahead.is_none() {
            let last = self
                .last
                .map(|i| (self.uses[i].name.as_str(), self.uses[i].span.clone()));
            self.ahead = Some(self.lexer.operator(last)?);
        }
        Ok(self.ahead.clone().expect("just read"))
    }

    fn check(&self, depth: usize, span: &Range<usize>) -> Result<(), ParseError> {
        if depth <= self.limit {
            return Ok(());
        }
        let kind = ParseErrorKind::TooDeep { limit: self.limit };
        Err(self.lexer.error(kind, span.clone()))
    }

    /// Precedence climbing: operators that bind less tightly than `least` are left to the caller.
    fn expression(&mut self, least: u8) -> Result<Tree, ParseError> {
        let (mut left, mut depth) = self.prefixed()?;
        loop {
            let (operator, span) = self.peek()?;
            let Some((tightness, right)) = binding(operator) else {
                break;
            };
            if tightness < least {
                break;
            }
            self.ahead = None;
            self.nesting += 1;
            self.check(self.nesting, &span)?;
            let (other, other_depth) = self.expression(tightness + u8::from(!right))?;
            self.nesting -= 1;
            let added = if operator == Operator::Xor { 2 } else { 1 };
            depth = depth.max(other_depth) + added;
            left = combine(operator, left, other);
            self.check(depth, &span)?;
        }
        Ok((left, depth))
    }

    /// A run of prefix operators and what they apply to.
    fn prefixed(&mut self) -> Result<Tree, ParseError> {
        let mut prefixes: Vec<fn(Formula) -> Formula> = Vec::new();
        loop {
            let (token, span) = self.lexer.operand()?;
            self.check(self.nesting + prefixes.len() + 1, &span)?;
            let (inner, depth) = match token {
                Operand::Not => {
                    prefixes.push(Formula::not);
                    continue;
                }
                Operand::Next => {
                    prefixes.push(Formula::next);
                    continue;
                }
                Operand::Finally => {
                    prefixes.push(Formula::finally);
                    continue;
                }
                Operand::Globally => {
                    prefixes.push(Formula::globally);
                    continue;
                }
                Operand::Open => self.parenthesised(&span)?,
                Operand::True => (Formula::True, 1),
                Operand::False => (Formula::False, 1),
                Operand::Prop(name) => {
                    self.uses.push(PropositionUse {
                        name: name.clone(),
                        span: span.clone(),
                    });
                    (Formula::Prop(name), 1)
                }
            };
            // A quoted name was meant as a name.
            let bare = |u: &PropositionUse| u.span.len() == u.name.len();
            let is_name = matches!(inner, Formula::Prop(_)) && self.uses.last().is_some_and(bare);
            self.last = is_name.then(|| self.uses.len() - 1);
            let depth = depth + prefixes.len();
            self.check(depth, &span)?;
            let formula = prefixes.into_iter().rev().fold(inner, |f, wrap| wrap(f));
            return Ok((formula, depth));
        }
    }

    fn parenthesised(&mut self, open: &Range<usize>) -> Result<Tree, ParseError> {
        self.nesting += 1;
        self.check(self.nesting, open)?;
        let tree = self.expression(0)?;
        self.nesting -= 1;
        if self.peek()?.0 != Operator::Close {
            return Err(self.lexer.error(ParseErrorKind::Unclosed, open.clone()));
        }
        self.ahead = None;
        Ok(tree)
    }
}
