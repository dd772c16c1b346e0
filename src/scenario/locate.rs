//! Where in the text of a scenario file a value stands.
//!
//! Errors of meaning (a polygon that crosses itself, a start inside an obstacle) are found after
//! the text was parsed. They name the value by its path, and this module finds the path's place
//! again, so that every error can point into the file.

use std::ops::Range;

use toml::de::{DeTable, DeValue};

/// One step on the way from the top of a file to a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step<'a> {
    /// Into a table, by key.
    Key(&'a str),
    /// Into an array, by index.
    Index(usize),
}

/// How a text is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Syntax {
    /// TOML.
    Toml,
    /// JSON, or one line of JSONL.
    Json,
}

/// The bytes of the value at `path`; of the deepest value on the way that exists, if it does not.
/// `None` if the text is not valid or the path leads nowhere at once.
pub(crate) fn locate(text: &str, syntax: Syntax, path: &[Step<'_>]) -> Option<Range<usize>> {
    match syntax {
        Syntax::Toml => locate_toml(text, path),
        Syntax::Json => {
            let mut scan = JsonScan { text, at: 0 };
            scan.find(path)
        }
    }
}

/// Line and column, both from 1, of a byte offset; columns count characters.
pub(crate) fn line_column(text: &str, offset: usize) -> (usize, usize) {
    let offset = floor_char(text, offset);
    let before = &text[..offset];
    let line = before.matches('\n').count() + 1;
    let line_start = before.rfind('\n').map_or(0, |i| i + 1);
    (line, before[line_start..].chars().count() + 1)
}

/// The byte offset of a line and a column in *bytes*, both from 1, as serde_json counts them.
pub(crate) fn offset_of(text: &str, line: usize, byte_column: usize) -> usize {
    let start = if line <= 1 {
        0
    } else {
        text.match_indices('\n')
            .nth(line - 2)
            .map_or(text.len(), |(i, _)| i + 1)
    };
    floor_char(text, start + byte_column.saturating_sub(1))
}

fn floor_char(text: &str, offset: usize) -> usize {
    let mut offset = offset.min(text.len());
    while !text.is_char_boundary(offset) {
        offset -= 1;
    }
    offset
}

fn locate_toml(text: &str, path: &[Step<'_>]) -> Option<Range<usize>> {
    let table = DeTable::parse(text).ok()?;
    let (first, rest) = path.split_first()?;
    let Step::Key(key) = first else { return None };
    let mut here = table.get_ref().get(*key)?;
    for step in rest {
        let next = match (step, here.get_ref()) {
            (Step::Key(key), DeValue::Table(table)) => table.get(*key),
            (Step::Index(index), DeValue::Array(array)) => array.get(*index),
            _ => None,
        };
        match next {
            Some(value) => here = value,
            None => break,
        }
    }
    Some(here.span())
}

/// Walks over JSON that serde_json has accepted already, and so may be lenient.
struct JsonScan<'a> {
    text: &'a str,
    at: usize,
}

impl JsonScan<'_> {
    fn find(&mut self, path: &[Step<'_>]) -> Option<Range<usize>> {
        self.skip_space();
        let start = self.at;
        let Some((first, rest)) = path.split_first() else {
            self.skip_value()?;
            return Some(start..self.at);
        };
        let found = match (self.peek()?, first) {
            (b'{', Step::Key(key)) => self.find_in_object(key, rest),
            (b'[', Step::Index(index)) => self.find_in_array(*index, rest),
            _ => None,
        };
        found.or_else(|| {
            self.at = start;
            self.skip_value()?;
            Some(start..self.at)
        })
    }

    fn find_in_object(&mut self, key: &str, rest: &[Step<'_>]) -> Option<Range<usize>> {
        self.at += 1;
        loop {
            self.skip_separators();
            if self.peek()? != b'"' {
                return None;
            }
            let start = self.at;
            self.skip_value()?;
            let name: String = serde_json::from_str(&self.text[start..self.at]).ok()?;
            self.skip_separators();
            if name == key {
                return self.find(rest);
            }
            self.skip_value()?;
        }
    }

    fn find_in_array(&mut self, index: usize, rest: &[Step<'_>]) -> Option<Range<usize>> {
        self.at += 1;
        for _ in 0..index {
            self.skip_separators();
            if self.peek()? == b']' {
                return None;
            }
            self.skip_value()?;
        }
        self.skip_separators();
        (self.peek()? != b']').then(|| self.find(rest))?
    }

    fn peek(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    fn skip_space(&mut self) {
        while self.peek().is_some_and(|b| b.is_ascii_whitespace()) {
            self.at += 1;
        }
    }

    fn skip_separators(&mut self) {
        while self
            .peek()
            .is_some_and(|b| b.is_ascii_whitespace() || b == b',' || b == b':')
        {
            self.at += 1;
        }
    }

    /// Moves past one value: a string, a bracketed value, or a bare word.
    fn skip_value(&mut self) -> Option<()> {
        let mut depth = 0_usize;
        loop {
            match self.peek()? {
                b'"' => self.skip_string()?,
                b'{' | b'[' => {
                    depth += 1;
                    self.at += 1;
                }
                b'}' | b']' => {
                    depth = depth.checked_sub(1)?;
                    self.at += 1;
                }
                b if b.is_ascii_whitespace() || b == b',' || b == b':' => self.at += 1,
                _ => self.skip_word(),
            }
            if depth == 0 {
                return Some(());
            }
        }
    }

    fn skip_string(&mut self) -> Option<()> {
        self.at += 1;
        loop {
            match self.peek()? {
                b'"' => {
                    self.at += 1;
                    return Some(());
                }
                b'\\' => self.at += 2,
                _ => self.at += 1,
            }
        }
    }

    fn skip_word(&mut self) {
        while self
            .peek()
            .is_some_and(|b| !b.is_ascii_whitespace() && !b",:[]{}\"".contains(&b))
        {
            self.at += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found<'a>(text: &'a str, syntax: Syntax, path: &[Step<'_>]) -> Option<&'a str> {
        locate(text, syntax, path).map(|range| &text[range])
    }

    #[test]
    fn values_are_found_by_path_in_json() {
        let text = r#"{ "a\"b": [1, {"c": [[0,1], [2, 3]]}, true], "d": "x ] y", "e": -1e3 }"#;
        let at = |path: &[Step<'_>]| found(text, Syntax::Json, path);
        assert_eq!(at(&[Step::Key("e")]), Some("-1e3"));
        assert_eq!(at(&[Step::Key("d")]), Some(r#""x ] y""#));
        let deep = [
            Step::Key("a\"b"),
            Step::Index(1),
            Step::Key("c"),
            Step::Index(1),
        ];
        assert_eq!(at(&deep), Some("[2, 3]"));
        assert_eq!(at(&[Step::Key("a\"b"), Step::Index(2)]), Some("true"));
    }

    #[test]
    fn a_missing_value_points_to_its_parent() {
        let text = r#"{ "a": [1, 2] }"#;
        let path = [Step::Key("a"), Step::Index(7)];
        assert_eq!(found(text, Syntax::Json, &path), Some("[1, 2]"));
        assert_eq!(found("a = [1, 2]", Syntax::Toml, &path), Some("[1, 2]"));
        assert_eq!(found(text, Syntax::Json, &[Step::Key("b")]), Some(text));
    }

    #[test]
    fn values_are_found_by_path_in_toml() {
        let text = "x = 1\n[workspace]\nobstacles = [[[0, 0], [1, 0]], [[2, 2]]]\n[workspace.regions]\nl1 = [[3, 3]]\n";
        let at = |path: &[Step<'_>]| found(text, Syntax::Toml, path);
        let second = [
            Step::Key("workspace"),
            Step::Key("obstacles"),
            Step::Index(1),
        ];
        assert_eq!(at(&second), Some("[[2, 2]]"));
        let region = [
            Step::Key("workspace"),
            Step::Key("regions"),
            Step::Key("l1"),
        ];
        assert_eq!(at(&region), Some("[[3, 3]]"));
    }

    #[test]
    fn broken_json_never_loops() {
        for text in ["", "{", "[", "{\"a\"", "{\"a\":", "[1,", "\"\\", "}", "[}"] {
            let _ = locate(text, Syntax::Json, &[Step::Key("a"), Step::Index(3)]);
            let _ = locate(text, Syntax::Json, &[Step::Index(3)]);
        }
    }

    #[test]
    fn lines_and_columns_count_characters_from_one() {
        let text = "ab\nλc\n";
        assert_eq!(line_column(text, 0), (1, 1));
        assert_eq!(line_column(text, 5), (2, 2));
        assert_eq!(offset_of(text, 2, 3), 5);
        assert_eq!(line_column(text, 999), (3, 1));
    }
}
