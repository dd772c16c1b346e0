//! From bytes to [`ScenarioSpec`], bounded in size, with line and column of every error.

use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::path::Path;

use super::error::{Place, ScenarioError, ScenarioErrorKind as Kind};
use super::locate::{Step, Syntax, locate, offset_of};
use super::resolve::resolve;
use super::spec::{ScenarioFile, ScenarioSpec};

/// The largest scenario file that is read, in bytes (256 MiB: a `.jsonl` file holds many).
pub const MAX_BYTES: u64 = 256 << 20;

/// The largest single scenario, in bytes (16 MiB, several hundred thousand vertices).
const MAX_SCENARIO_BYTES: usize = 16 << 20;

/// The path that means standard input.
const STDIN: &str = "-";

/// The text of one scenario, kept so that later errors can point into it.
#[derive(Clone, Debug)]
pub(super) struct Source {
    text: String,
    syntax: Syntax,
    /// Line number of the text's first line in its file, from 1.
    first_line: usize,
    /// What to call obstacles, once they are known.
    pub(super) obstacle_names: Vec<String>,
    /// By how much obstacles were grown and the bounds shrunk, map units.
    pub(super) robot_radius: f64,
}

impl Source {
    /// Where the value at `path` stands.
    pub(super) fn place(&self, path: &[Step<'_>]) -> Option<Place> {
        locate(&self.text, self.syntax, path).map(|span| self.at(span))
    }

    /// Where the bytes `span` of the string `value` at `path` stand; the whole value if it was
    /// written with escapes, so that its bytes are not those of the file.
    pub(super) fn place_within(
        &self,
        path: &[Step<'_>],
        value: &str,
        span: &Range<usize>,
    ) -> Option<Place> {
        let whole = locate(&self.text, self.syntax, path)?;
        let inner = self.text[whole.clone()].find(value).map(|offset| {
            let base = whole.start + offset;
            base + span.start..base + span.end
        });
        Some(self.at(inner.unwrap_or(whole)))
    }

    fn at(&self, span: Range<usize>) -> Place {
        Place {
            text: self.text.clone(),
            first_line: self.first_line,
            span,
        }
    }

    fn parse(&self) -> Result<ScenarioFile, ScenarioError> {
        if self.text.len() > MAX_SCENARIO_BYTES {
            let limit = MAX_SCENARIO_BYTES as u64;
            return Err(Kind::TooLarge { limit }.into());
        }
        match self.syntax {
            Syntax::Toml => toml::from_str(&self.text).map_err(|e| {
                let place = e.span().map(|span| self.at(span));
                ScenarioError::new(Kind::Syntax(one_line(e.message()))).at(place)
            }),
            Syntax::Json => serde_json::from_str(&self.text).map_err(|e| {
                let start = offset_of(&self.text, e.line(), e.column());
                let text = e.to_string();
                let message = text.split(" at line ").next().unwrap_or(&text);
                ScenarioError::new(Kind::Syntax(one_line(message)))
                    .at(Some(self.at(start..start + 1)))
            }),
        }
    }
}

fn one_line(message: &str) -> String {
    message.trim().replace('\n', "; ")
}

/// Reads what a file says without checking what it means, one entry for each scenario.
///
/// # Errors
/// If the file cannot be read or breaks the rules of its format.
pub fn read_specs(path: impl AsRef<Path>) -> Result<Vec<ScenarioSpec>, ScenarioError> {
    let all = read_many(path.as_ref())?;
    all.into_iter().map(|one| Ok(one?.0)).collect()
}

pub(super) type Read1 = Result<(ScenarioSpec, Source), ScenarioError>;

/// Reads every scenario of a file. The outer error is about the file as a whole.
pub(super) fn read_many(path: &Path) -> Result<Vec<Read1>, ScenarioError> {
    let text = read_text(path);
    read_text_of(path, text)
}

/// As [`read_many`], for the text of the file.
pub(super) fn read_text_of(
    path: &Path,
    text: Result<String, Kind>,
) -> Result<Vec<Read1>, ScenarioError> {
    let sources = split(path, text).map_err(|e| ScenarioError::new(e).in_file(path))?;
    let parse = |mut source: Source| {
        let file = source.parse().map_err(|e| e.in_file(path))?;
        source.robot_radius = file.robot_radius;
        let resolved = resolve(file, path, &source);
        let (spec, names) = resolved.map_err(|e| e.in_file(path))?;
        source.obstacle_names = names;
        Ok((named(spec, path, &source), source))
    };
    Ok(sources.into_iter().map(parse).collect())
}

/// Reads one scenario: the only one, or the one that `pick` names or numbers (by line).
pub(super) fn read_one(path: &Path, pick: Option<&str>) -> Read1 {
    let mut all = read_many(path)?;
    let Some(pick) = pick else {
        if all.len() == 1 {
            return all.remove(0);
        }
        if all.is_empty() {
            return Err(ScenarioError::new(Kind::Empty).in_file(path));
        }
        let found = all.len();
        return Err(ScenarioError::new(Kind::NotOne { found }).in_file(path));
    };
    let line: Option<usize> = pick.parse().ok();
    let mut by_line = None;
    let mut named = Vec::new();
    for one in all {
        match one {
            Ok((spec, source)) => {
                if spec.name == pick {
                    named.push((spec, source));
                    continue;
                }
                if line == Some(source.first_line) {
                    by_line = Some(Ok((spec, source)));
                }
            }
            Err(e) => {
                if line.is_some() && e.position().map(|p| p.0) == line {
                    by_line = Some(Err(e));
                }
            }
        }
    }
    if named.len() > 1 {
        let lines = named.iter().map(|(_, source)| source.first_line).collect();
        let pick = pick.to_owned();
        return Err(ScenarioError::new(Kind::SeveralNamed { pick, lines }).in_file(path));
    }
    named.pop().map(Ok).or(by_line).unwrap_or_else(|| {
        let pick = pick.to_owned();
        Err(ScenarioError::new(Kind::NotFound { pick }).in_file(path))
    })
}

fn split(path: &Path, text: Result<String, Kind>) -> Result<Vec<Source>, Kind> {
    let ending = path
        .extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase())
        .unwrap_or_default();
    let one = |syntax, text: Result<String, Kind>| {
        let text = text?;
        Ok(vec![Source {
            text,
            syntax,
            first_line: 1,
            obstacle_names: Vec::new(),
            robot_radius: 0.0,
        }])
    };
    match ending.as_str() {
        "toml" => one(Syntax::Toml, text),
        "json" => one(Syntax::Json, text),
        "jsonl" | "ndjson" => Ok(lines(&text?)),
        "" => {
            let text = text?;
            if text.trim().is_empty() {
                return Err(Kind::Empty);
            }
            match guess(&text) {
                Guess::Toml => one(Syntax::Toml, Ok(text)),
                Guess::Json => one(Syntax::Json, Ok(text)),
                Guess::JsonLines => Ok(lines(&text)),
            }
        }
        _ => Err(Kind::UnknownEnding { found: ending }),
    }
}

/// What a text without an ending is taken for.
enum Guess {
    Toml,
    Json,
    JsonLines,
}

/// Tells the format of a text that comes from a pipe, and so without an ending, from its beginning: objects
/// begin with a brace, tables never do; and where the first line is an object by itself, each line is one.
fn guess(text: &str) -> Guess {
    if !text.trim_start().starts_with('{') {
        return Guess::Toml;
    }
    let mut all = text.lines().filter(|line| !line.trim().is_empty());
    let first = all.next().unwrap_or_default();
    let is_whole = serde_json::from_str::<serde::de::IgnoredAny>(first).is_ok();
    match is_whole && all.next().is_some() {
        true => Guess::JsonLines,
        false => Guess::Json,
    }
}

fn lines(text: &str) -> Vec<Source> {
    text.lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|(i, line)| Source {
            text: line.to_owned(),
            syntax: Syntax::Json,
            first_line: i + 1,
            obstacle_names: Vec::new(),
            robot_radius: 0.0,
        })
        .collect()
}

fn read_text(path: &Path) -> Result<String, Kind> {
    let mut bytes = Vec::new();
    let read = if path == Path::new(STDIN) {
        std::io::stdin()
            .lock()
            .take(MAX_BYTES + 1)
            .read_to_end(&mut bytes)
    } else {
        let file = File::open(path).map_err(Kind::Read)?;
        file.take(MAX_BYTES + 1).read_to_end(&mut bytes)
    };
    read.map_err(Kind::Read)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(Kind::TooLarge { limit: MAX_BYTES });
    }
    let text = String::from_utf8(bytes).map_err(|_| Kind::NotText)?;
    // Editors on some systems put a byte-order mark first.
    Ok(text
        .strip_prefix('\u{feff}')
        .map_or(text.clone(), str::to_owned))
}

fn named(mut spec: ScenarioSpec, path: &Path, source: &Source) -> ScenarioSpec {
    if spec.name.is_empty() {
        let stem = path
            .file_stem()
            .filter(|s| *s != STDIN)
            .map_or("stdin".to_owned(), |s| s.to_string_lossy().into_owned());
        spec.name = if source.first_line > 1 {
            format!("{stem}-{}", source.first_line)
        } else {
            stem
        };
    }
    spec
}
