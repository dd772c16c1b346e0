//! What can be wrong with an automaton file.

use std::fmt;
use std::ops::Range;

use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};

/// The kinds of [`HoaError`].
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum HoaErrorKind {
    /// Something else was expected.
    Expected {
        /// What.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// A comment or string has no end.
    Unterminated(&'static str),
    /// A part of the format that is not supported, by name.
    Unsupported(String),
    /// Two parts of the file contradict each other.
    Inconsistent(String),
    /// Something is larger than it may be.
    TooLarge {
        /// What.
        what: &'static str,
        /// The limit.
        limit: usize,
    },
    /// [`Limits::states`](crate::automaton::Limits::states) was hit.
    States {
        /// The limit.
        limit: usize,
    },
    /// [`Limits::transitions`](crate::automaton::Limits::transitions) was hit.
    Transitions {
        /// The limit.
        limit: usize,
    },
    /// A proposition that is not one of the alphabet's.
    UnknownProposition {
        /// Its name.
        name: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// `--ABORT--`: the tool that wrote the file gave up.
    Aborted,
}

impl fmt::Display for HoaErrorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Expected { expected, found } => write!(f, "expected {expected}, found {found}"),
            Self::Unterminated(what) => write!(f, "{what} has no end"),
            Self::Unsupported(what) => write!(
                f,
                "{what} is not supported: give a Büchi or generalised Büchi automaton"
            ),
            Self::Inconsistent(what) => f.write_str(what),
            Self::TooLarge { what, limit } => write!(f, "{what}: at most {limit} are supported"),
            Self::States { limit } => write!(
                f,
                "the automaton, as it stands or with accepting states, has more than {limit} states: raise the limit on states"
            ),
            Self::Transitions { limit } => write!(
                f,
                "the automaton, as it stands or with accepting states, has more than {limit} transitions: raise the limit on transitions"
            ),
            Self::UnknownProposition { name, known } => write!(
                f,
                "proposition `{name}` is not one of the regions ({})",
                known.join(", ")
            ),
            Self::Aborted => f.write_str("the automaton was aborted by the tool that wrote it"),
        }
    }
}

/// An error in a HOA text, with its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HoaError {
    /// What is wrong.
    pub kind: HoaErrorKind,
    /// The bytes of the text that are to blame.
    pub span: Range<usize>,
    /// Line of the place, from 1.
    pub line: usize,
    /// Column of the place in characters, from 1.
    pub column: usize,
    /// The text of that line.
    pub source: String,
}

impl HoaError {
    pub(super) fn new(kind: HoaErrorKind, text: &str, span: Range<usize>) -> Self {
        let start = text[..span.start].rfind('\n').map_or(0, |i| i + 1);
        let end = text[span.start..]
            .find('\n')
            .map_or(text.len(), |i| span.start + i);
        Self {
            kind,
            line: text[..span.start].matches('\n').count() + 1,
            column: text[start..span.start].chars().count() + 1,
            source: text[start..end].to_owned(),
            span,
        }
    }

    /// The bytes of [`source`](Self::source) that are to blame.
    pub(crate) fn place(&self) -> Range<usize> {
        let chars = self.source.chars().take(self.column - 1);
        let before: usize = chars.map(char::len_utf8).sum();
        let after = (before + self.span.len()).min(self.source.len());
        before..after.max(before)
    }

    /// Shows the line with carets under the place; `path` is the file it came from, if any.
    #[must_use]
    pub fn render(&self, path: Option<&str>, color: bool) -> String {
        let source = if self.source.is_empty() {
            " "
        } else {
            &self.source
        };
        let title = self.kind.to_string();
        let snippet = Snippet::source(source)
            .line_start(self.line)
            .path(path)
            .annotation(AnnotationKind::Primary.span(self.place()));
        let renderer = if color {
            Renderer::styled()
        } else {
            Renderer::plain()
        };
        renderer
            .decor_style(DecorStyle::Ascii)
            .render(&[Level::ERROR.primary_title(&title).element(snippet)])
    }
}

impl fmt::Display for HoaError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} at line {}, column {}",
            self.kind, self.line, self.column
        )
    }
}

impl std::error::Error for HoaError {}
