//! What can be wrong with the text of a formula.

use std::fmt;
use std::ops::Range;

use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};

/// Syntax of other tools that this one knows but does not support.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unsupported {
    /// `{a;b}`, `[*]`, … of PSL and SVA.
    RegularExpression,
    /// `X[!]`, the next of finite words.
    StrongNext,
    /// `F[2:5]`, `X[3]`, … : operators with step or time bounds.
    Bounds,
    /// `Y`, `O`, `H`, `Z`, `S`, `T`, `B`: operators that look back.
    Past,
    /// `A`, `E`, `AG`, … of CTL.
    PathQuantifier,
    /// `p=1`, `x=3`: propositions with values.
    Values,
}

impl Unsupported {
    fn advice(self) -> &'static str {
        match self {
            Self::RegularExpression => {
                "regular expressions of PSL and SVA (`{…}`, `[*]`) are not supported: use X, F, G, U, R, W and M"
            }
            Self::StrongNext => {
                "the strong next `X[!]` belongs to finite words: words are infinite here, write `X`"
            }
            Self::Bounds => {
                "bounds in brackets are not supported: unroll them with X, or write `[]` for G"
            }
            Self::Past => {
                "past operators (Y, O, H, Z, S, T, B) are not supported: say it with future operators, or quote the name if it is a proposition"
            }
            Self::PathQuantifier => {
                "path quantifiers of CTL are not supported: a plan is one path, leave A and E out"
            }
            Self::Values => {
                "propositions have no values here: write `p` for `p=1` and `!p` for `p=0`"
            }
        }
    }
}

/// The kinds of [`ParseError`].
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ParseErrorKind {
    /// The text ends where something must follow.
    UnexpectedEnd {
        /// What could follow.
        expected: &'static str,
    },
    /// Something stands where it cannot.
    Unexpected {
        /// What stands there.
        found: String,
        /// What could stand there.
        expected: &'static str,
    },
    /// A `(` is never closed.
    Unclosed,
    /// A `)` closes nothing.
    Unopened,
    /// A quoted name has no closing quote.
    UnterminatedName,
    /// A quoted name is empty.
    EmptyName,
    /// The formula is nested deeper than [`super::ParseOptions::max_depth`].
    TooDeep {
        /// The limit that was hit.
        limit: usize,
    },
    /// Syntax of other tools.
    Unsupported(Unsupported),
    /// A proposition that is not one of the names it may have.
    UnknownProposition {
        /// The name in the formula.
        name: String,
        /// The most similar name there is, if one is similar.
        similar: Option<String>,
        /// The names there are.
        known: Vec<String>,
    },
}

/// An error in a formula's text, with its place.
///
/// [`fmt::Display`] gives one sentence, [`ParseError::render`] the text with carets under the place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParseError {
    /// What is wrong.
    pub kind: ParseErrorKind,
    /// The whole text.
    pub text: String,
    /// The bytes of the text that are to blame.
    pub span: Range<usize>,
}

impl ParseError {
    pub(super) fn new(kind: ParseErrorKind, text: &str, span: Range<usize>) -> Self {
        Self {
            kind,
            text: text.to_owned(),
            span,
        }
    }

    /// The line and column of the place, both from 1, the column in characters.
    #[must_use]
    pub fn line_column(&self) -> (usize, usize) {
        let before = &self.text[..self.span.start];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
        (line, column)
    }

    /// Shows the text with carets under the place; `path` is the file it came from, if any.
    #[must_use]
    pub fn render(&self, path: Option<&str>, color: bool) -> String {
        // An empty text has no place to point at.
        let source = if self.text.is_empty() {
            " "
        } else {
            &self.text
        };
        let snippet = Snippet::source(source).path(path).annotation(
            AnnotationKind::Primary
                .span(self.span.clone())
                .label(self.label()),
        );
        let title = self.title();
        let mut group = Level::ERROR.primary_title(&title).element(snippet);
        if let Some(help) = self.help() {
            group = group.element(Level::HELP.message(help));
        }
        let renderer = if color {
            Renderer::styled()
        } else {
            Renderer::plain()
        };
        renderer.decor_style(DecorStyle::Ascii).render(&[group])
    }

    fn title(&self) -> String {
        match &self.kind {
            ParseErrorKind::UnexpectedEnd { .. } => "the formula ends too early".to_owned(),
            ParseErrorKind::Unexpected { found, .. } => format!("unexpected `{found}`"),
            ParseErrorKind::Unclosed => "a parenthesis is never closed".to_owned(),
            ParseErrorKind::Unopened => "a parenthesis closes nothing".to_owned(),
            ParseErrorKind::UnterminatedName => "a quoted name has no end".to_owned(),
            ParseErrorKind::EmptyName => "a quoted name is empty".to_owned(),
            ParseErrorKind::TooDeep { limit } => {
                format!(
                    "the formula's tree is deeper than {limit} levels (each `&` and `|` of a chain is one)"
                )
            }
            ParseErrorKind::Unsupported(_) => "unsupported syntax".to_owned(),
            ParseErrorKind::UnknownProposition { name, .. } => {
                format!("unknown proposition `{name}`")
            }
        }
    }

    fn label(&self) -> String {
        match &self.kind {
            ParseErrorKind::UnexpectedEnd { expected }
            | ParseErrorKind::Unexpected { expected, .. } => format!("expected {expected}"),
            ParseErrorKind::Unclosed => "opened here".to_owned(),
            ParseErrorKind::Unopened => "no `(` before it".to_owned(),
            ParseErrorKind::UnterminatedName => "expected a closing `\"`".to_owned(),
            ParseErrorKind::EmptyName => "expected a name between the quotes".to_owned(),
            ParseErrorKind::TooDeep { .. } => "the limit is hit here".to_owned(),
            ParseErrorKind::Unsupported(_) => "not supported".to_owned(),
            ParseErrorKind::UnknownProposition { .. } => "no such name".to_owned(),
        }
    }

    fn help(&self) -> Option<String> {
        match &self.kind {
            ParseErrorKind::TooDeep { .. } => {
                Some("split the formula, or raise the limit on the nesting depth".to_owned())
            }
            ParseErrorKind::Unsupported(what) => Some(what.advice().to_owned()),
            ParseErrorKind::UnknownProposition { similar, known, .. } => Some(match similar {
                Some(similar) => format!("did you mean `{similar}`?"),
                None if known.is_empty() => "there are no names at all".to_owned(),
                None => format!("the names are {}", known.join(", ")),
            }),
            _ => None,
        }
    }
}

impl fmt::Display for ParseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (line, column) = self.line_column();
        write!(f, "{} at line {line}, column {column}", self.title())?;
        match &self.kind {
            ParseErrorKind::UnexpectedEnd { .. } | ParseErrorKind::Unexpected { .. } => {
                write!(f, ": {}", self.label())?;
            }
            _ => {}
        }
        match self.help() {
            Some(help) => write!(f, ": {help}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for ParseError {}
