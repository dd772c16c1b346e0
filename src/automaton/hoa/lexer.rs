//! Tokens of the Hanoi omega-automata format.

use std::ops::Range;

use super::error::{HoaError, HoaErrorKind};

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Token {
    /// A word directly followed by a colon.
    Header(String),
    Word(String),
    Alias(String),
    Number(u64),
    Text(String),
    /// One of `! & | ( ) [ ] { }`.
    Symbol(char),
    Body,
    End,
    Abort,
    /// The end of the text.
    Eof,
}

impl Token {
    /// How to name it in a message.
    pub(super) fn show(&self) -> String {
        match self {
            Self::Header(name) => format!("`{name}:`"),
            Self::Word(name) => format!("`{name}`"),
            Self::Alias(name) => format!("`@{name}`"),
            Self::Number(n) => format!("`{n}`"),
            Self::Text(_) => "a string".to_owned(),
            Self::Symbol(c) => format!("`{c}`"),
            Self::Body => "`--BODY--`".to_owned(),
            Self::End => "`--END--`".to_owned(),
            Self::Abort => "`--ABORT--`".to_owned(),
            Self::Eof => "the end of the text".to_owned(),
        }
    }
}

pub(super) struct Lexer<'t> {
    text: &'t str,
    at: usize,
    pub(super) token: Token,
    pub(super) span: Range<usize>,
}

fn is_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_' || c == '-'
}

impl<'t> Lexer<'t> {
    /// A lexer with the first token read.
    pub(super) fn new(text: &'t str) -> Result<Self, HoaError> {
        let mut lexer = Self {
            text,
            // Some editors begin a file with a byte order mark.
            at: if text.starts_with('\u{feff}') { 3 } else { 0 },
            token: Token::Eof,
            span: 0..0,
        };
        lexer.advance()?;
        Ok(lexer)
    }

    pub(super) fn error_at(&self, kind: HoaErrorKind, span: Range<usize>) -> HoaError {
        HoaError::new(kind, self.text, span)
    }

    pub(super) fn error(&self, kind: HoaErrorKind) -> HoaError {
        self.error_at(kind, self.span.clone())
    }

    pub(super) fn expected(&self, expected: impl Into<String>) -> HoaError {
        self.error(HoaErrorKind::Expected {
            expected: expected.into(),
            found: self.token.show(),
        })
    }

    /// Steps over a symbol if it comes next.
    pub(super) fn accept(&mut self, symbol: char) -> Result<bool, HoaError> {
        let here = self.token == Token::Symbol(symbol);
        if here {
            self.advance()?;
        }
        Ok(here)
    }

    pub(super) fn require(&mut self, symbol: char) -> Result<(), HoaError> {
        if self.accept(symbol)? {
            return Ok(());
        }
        Err(self.expected(format!("`{symbol}`")))
    }

    pub(super) fn number(&mut self, what: &str) -> Result<u64, HoaError> {
        match self.token {
            Token::Number(n) => {
                self.advance()?;
                Ok(n)
            }
            _ => Err(self.expected(what)),
        }
    }

    fn skip_blanks(&mut self) -> Result<(), HoaError> {
        loop {
            let rest = &self.text[self.at..];
            self.at = self.text.len() - rest.trim_start().len();
            if !self.text[self.at..].starts_with("/*") {
                return Ok(());
            }
            self.skip_comment()?;
        }
    }

    /// Comments nest.
    fn skip_comment(&mut self) -> Result<(), HoaError> {
        let start = self.at;
        let mut depth = 0usize;
        loop {
            let rest = &self.text[self.at..];
            if rest.starts_with("/*") {
                depth += 1;
                self.at += 2;
            } else if rest.starts_with("*/") {
                depth -= 1;
                self.at += 2;
                if depth == 0 {
                    return Ok(());
                }
            } else if let Some(c) = rest.chars().next() {
                self.at += c.len_utf8();
            } else {
                let kind = HoaErrorKind::Unterminated("a comment");
                return Err(self.error_at(kind, start..start + 2));
            }
        }
    }

    /// Reads the next token.
    pub(super) fn advance(&mut self) -> Result<(), HoaError> {
        self.skip_blanks()?;
        let start = self.at;
        let rest = &self.text[start..];
        let word_length = |text: &str| text.find(|c| !is_word(c)).unwrap_or(text.len());
        let Some(first) = rest.chars().next() else {
            self.token = Token::Eof;
            self.span = start..start;
            return Ok(());
        };
        let (token, length) = if rest.starts_with("--BODY--") {
            (Token::Body, 8)
        } else if rest.starts_with("--END--") {
            (Token::End, 7)
        } else if rest.starts_with("--ABORT--") {
            (Token::Abort, 9)
        } else if first.is_ascii_digit() {
            let length = rest
                .find(|c: char| !c.is_ascii_digit())
                .unwrap_or(rest.len());
            match rest[..length].parse() {
                Ok(n) => (Token::Number(n), length),
                Err(_) => {
                    let what = "a number is too large";
                    let limit = u32::MAX as usize;
                    let kind = HoaErrorKind::TooLarge { what, limit };
                    return Err(self.error_at(kind, start..start + length));
                }
            }
        } else if first.is_ascii_alphabetic() || first == '_' {
            let length = word_length(rest);
            let word = rest[..length].to_owned();
            if rest[length..].starts_with(':') {
                (Token::Header(word), length + 1)
            } else {
                (Token::Word(word), length)
            }
        } else if first == '@' {
            let length = word_length(&rest[1..]);
            (Token::Alias(rest[1..=length].to_owned()), length + 1)
        } else if first == '"' {
            self.string(rest)?
        } else if "!&|()[]{}".contains(first) {
            (Token::Symbol(first), 1)
        } else {
            let kind = HoaErrorKind::Expected {
                expected: "a part of the HOA format".to_owned(),
                found: format!("`{first}`"),
            };
            return Err(self.error_at(kind, start..start + first.len_utf8()));
        };
        self.at = start + length;
        self.token = token;
        self.span = start..self.at;
        Ok(())
    }

    fn string(&self, rest: &str) -> Result<(Token, usize), HoaError> {
        let mut content = String::new();
        let mut chars = rest.char_indices().skip(1);
        while let Some((i, c)) = chars.next() {
            match c {
                '"' => return Ok((Token::Text(content), i + 1)),
                '\\' => content.extend(chars.next().map(|(_, c)| c)),
                c => content.push(c),
            }
        }
        let kind = HoaErrorKind::Unterminated("a string");
        Err(self.error_at(kind, self.at..self.at + 1))
    }
}
