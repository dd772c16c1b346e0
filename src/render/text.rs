//! Words in a picture: how wide they are, where lines break, how they are written.

use std::fmt::Write as _;

use super::colour::{FAINT, hex};
use super::labels::Px;

/// The lines above the map.
pub(super) struct Heading {
    pub(super) text: String,
    pub(super) height: f64,
}

/// Draws title and subtitle from `left` on, in lines no longer than `room`.
pub(super) fn heading(
    title: Option<&str>,
    subtitle: Option<&str>,
    left: f64,
    room: f64,
) -> Heading {
    let mut text = String::new();
    let mut height = 0.0;
    if let Some(title) = title {
        height += 26.0;
        let title = fitted(title, room / 20.0);
        write_text(
            &mut text,
            [left, height - 2.0],
            &title,
            "font-size=\"20\" font-weight=\"bold\"",
        );
    }
    if let Some(subtitle) = subtitle {
        for line in wrapped(subtitle, room / 15.0, 3) {
            height += 21.0;
            write_text(
                &mut text,
                [left, height],
                &line,
                &format!("font-size=\"15\" fill=\"{}\"", hex(FAINT)),
            );
        }
    }
    if height > 0.0 {
        height += 10.0;
    }
    Heading { text, height }
}

/// As much of `text` as fits into `room` (in units of the font size).
pub(super) fn fitted(text: &str, room: f64) -> String {
    if text_width(text) <= room {
        return text.to_owned();
    }
    let mut kept = String::new();
    for c in text.chars() {
        kept.push(c);
        if text_width(&kept) > room - 1.0 {
            break;
        }
    }
    kept.push('…');
    kept
}

/// `text` in at most `lines` lines, broken at spaces.
fn wrapped(text: &str, room: f64, lines: usize) -> Vec<String> {
    let mut done: Vec<String> = vec![String::new()];
    for word in text.split_whitespace() {
        let current = done.len() - 1;
        let line = &mut done[current];
        if line.is_empty() {
            line.push_str(word);
        } else if text_width(line) + 0.4 + text_width(word) <= room {
            line.push(' ');
            line.push_str(word);
        } else {
            done.push(word.to_owned());
        }
    }
    if done.len() > lines {
        done.truncate(lines);
        if let Some(last) = done.last_mut() {
            last.push_str(" …");
        }
    }
    done.iter().map(|line| fitted(line, room)).collect()
}

/// Appends a text element; `at` is the left end of its baseline unless `style` says otherwise.
pub(super) fn write_text(out: &mut String, at: Px, text: &str, style: &str) {
    let _ = writeln!(
        out,
        "<text x=\"{:.1}\" y=\"{:.1}\" {style}>{}</text>",
        at[0],
        at[1],
        escaped(text)
    );
}

/// `text` as XML character data, without characters that XML does not allow.
pub(super) fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => safe.push(' '),
            c => safe.push(c),
        }
    }
    safe
}

/// The width of `text` in DejaVu Sans, in units of the font size, estimated by kinds of letters: near
/// enough to keep labels apart and lines within the picture.
pub(super) fn text_width(text: &str) -> f64 {
    text.chars()
        .map(|c| match c {
            'i' | 'j' | 'l' | 'I' | '.' | ',' | ':' | ';' | '\'' | '|' | '!' => 0.34,
            ' ' | 'f' | 't' | 'r' | '(' | ')' | '[' | ']' | '-' | '/' => 0.4,
            'm' | 'w' | 'M' | 'W' | '@' | '&' | '<' | '>' | '=' | '+' | '→' => 0.88,
            c if c.is_uppercase() => 0.72,
            _ => 0.63,
        })
        .sum()
}
