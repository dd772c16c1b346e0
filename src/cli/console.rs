//! Where words go: results to stdout, everything else to stderr.

use std::io::{self, IsTerminal, Write};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::args::{Color, Global};

/// The name that messages begin with.
const PROGRAM: &str = "nngtl";

/// Writes results and messages as the global options ask.
#[derive(Clone, Debug)]
pub(super) struct Console {
    quiet: bool,
    json: bool,
    coloured: bool,
}

impl Console {
    pub(super) fn new(global: &Global) -> Self {
        let coloured = match global.color {
            Color::Always => true,
            Color::Never => false,
            Color::Auto => {
                io::stderr().is_terminal()
                    && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty())
            }
        };
        Self {
            quiet: global.quiet,
            json: global.json,
            coloured,
        }
    }

    /// Whether results are wanted as JSON.
    pub(super) fn json(&self) -> bool {
        self.json
    }

    /// Writes a result. A reader that has gone away wants no more, which is no error.
    pub(super) fn result(&self, text: &str) -> io::Result<()> {
        let mut out = io::stdout().lock();
        let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
        match written {
            Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
            other => other,
        }
    }

    /// Says something worth knowing, unless quiet.
    pub(super) fn note(&self, text: &str) {
        if !self.quiet {
            self.message(None, text);
        }
    }

    /// Says that something is allowed but probably not meant, unless quiet.
    pub(super) fn warn(&self, text: &str) {
        if !self.quiet {
            self.message(Some(("warning", "\u{1b}[1;33m")), text);
        }
    }

    /// Says what went wrong.
    pub(super) fn error(&self, text: &str) {
        self.message(Some(("error", "\u{1b}[1;31m")), text);
    }

    /// Shows lines of the input with a caret.
    pub(super) fn snippet(&self, lines: &str) {
        let _ = writeln!(io::stderr().lock(), "{lines}");
    }

    fn message(&self, label: Option<(&str, &str)>, text: &str) {
        let label = match label {
            Some((word, colour)) if self.coloured => format!("{colour}{word}:\u{1b}[0m "),
            Some((word, _)) => format!("{word}: "),
            None => String::new(),
        };
        // Nobody is left to be told if stderr is closed.
        let _ = writeln!(io::stderr().lock(), "{PROGRAM}: {label}{text}");
    }

    /// A progress bar on stderr; hidden when quiet and where stderr is no terminal.
    pub(super) fn progress(&self, total: u64, what: &'static str) -> ProgressBar {
        let target = if self.quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr_with_hz(10)
        };
        let bar = ProgressBar::with_draw_target(Some(total), target);
        let template = "{prefix} {bar:30} {pos}/{len} {msg}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_prefix(what);
        bar
    }
}

/// Seconds for people to read.
pub(super) fn seconds(s: f64) -> String {
    if s < 0.0995 {
        format!("{:.1} ms", s * 1e3)
    } else if s < 10.0 {
        format!("{s:.2} s")
    } else {
        format!("{s:.0} s")
    }
}

/// "1 skill", "2 skills".
pub(super) fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// 1 − weight, without the digits that rounding adds (1 − 0.7 is 0.30000000000000004).
pub(super) fn rest(weight: f64) -> f64 {
    ((1.0 - weight) * 1e12).round() / 1e12
}
