//! What the signs in a picture mean.

use std::fmt::Write as _;

use super::colour::{self, BAND, FAINT, INK, PREFIX, SUFFIX, hex};
use super::labels::Px;
use super::text::{text_width, write_text};

/// A sign with its explanation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sign {
    /// Where the robot stands at first.
    Start,
    /// The prefix and its length, map units.
    Prefix(f64),
    /// The suffix and its length, map units.
    Suffix(f64),
    /// The robot stays.
    Stays,
    /// A labelled region.
    Region,
    /// An obstacle.
    Obstacle,
    /// The search tree and its number of edges.
    Tree(usize),
    /// A band under lines, and what it means.
    Band(&'static str),
    /// The heatmap and its largest value.
    Heatmap(f32),
}

/// A drawn legend.
pub(super) struct Legend {
    pub(super) text: String,
    pub(super) height: f64,
}

const SIZE: f64 = 13.0;
const ROW: f64 = 26.0;
const GAP: f64 = 24.0;

/// Draws signs in rows no longer than `room`, from the upper-left corner `at`.
pub(super) fn draw(signs: &[Sign], at: Px, room: f64) -> Legend {
    let mut text = String::new();
    let (mut x, mut row) = (0.0, 0.0);
    for sign in signs {
        let words = sign.words();
        let width = sign.width() + 8.0 + text_width(&words) * SIZE;
        if x > 0.0 && x + width > room {
            x = 0.0;
            row += 1.0;
        }
        let middle = [at[0] + x, at[1] + ROW * row + ROW / 2.0];
        sign.draw(&mut text, middle);
        let beside = [middle[0] + sign.width() + 8.0, middle[1] + SIZE * 0.36];
        let style = format!("font-size=\"{SIZE}\" fill=\"{}\"", hex(INK));
        write_text(&mut text, beside, &words, &style);
        x += width + GAP;
    }
    let rows = if signs.is_empty() { 0.0 } else { row + 1.0 };
    Legend {
        text,
        height: rows * ROW,
    }
}

impl Sign {
    fn words(self) -> String {
        match self {
            Self::Start => "start".to_owned(),
            Self::Prefix(length) => format!("prefix, once: {}", short(length)),
            Self::Suffix(length) => format!("suffix, for ever: {}", short(length)),
            Self::Stays => "stays for ever".to_owned(),
            Self::Region => "region".to_owned(),
            Self::Obstacle => "obstacle".to_owned(),
            Self::Tree(edges) => format!("tree, {edges} edges"),
            Self::Band(meaning) => meaning.to_owned(),
            Self::Heatmap(peak) => format!("heatmap, 0 to {}", short(f64::from(peak))),
        }
    }

    fn width(self) -> f64 {
        match self {
            Self::Start | Self::Stays => 20.0,
            Self::Prefix(_) | Self::Suffix(_) | Self::Band(_) => 40.0,
            Self::Region | Self::Obstacle | Self::Tree(_) => 24.0,
            Self::Heatmap(_) => 90.0,
        }
    }

    fn draw(self, out: &mut String, [x, y]: Px) {
        let _ = match self {
            Self::Start => writeln!(
                out,
                "<path d=\"M{:.1} {:.1}l7 7l-7 7l-7 -7Z\" fill=\"{}\"/>",
                x + 10.0,
                y - 7.0,
                hex(INK)
            ),
            Self::Prefix(_) => line(out, [x, y], 40.0, &hex(PREFIX), "stroke-width=\"3\""),
            Self::Suffix(_) => line(
                out,
                [x, y],
                40.0,
                &hex(SUFFIX),
                "stroke-width=\"3\" stroke-dasharray=\"10 5\"",
            ),
            Self::Band(_) => line(
                out,
                [x, y],
                40.0,
                &hex(BAND),
                "stroke-width=\"12\" stroke-opacity=\"0.35\"",
            ),
            Self::Tree(_) => line(out, [x, y], 24.0, &hex(FAINT), "stroke-width=\"1\""),
            Self::Stays => writeln!(
                out,
                "<circle cx=\"{:.1}\" cy=\"{y:.1}\" r=\"7\" fill=\"none\" stroke=\"{}\" stroke-width=\"3\"/>",
                x + 10.0,
                hex(SUFFIX)
            ),
            Self::Region => swatch(
                out,
                [x, y],
                &hex(colour::region_fill(0)),
                &hex(colour::region_border(0)),
            ),
            Self::Obstacle => swatch(out, [x, y], "url(#hatch)", &hex(FAINT)),
            Self::Heatmap(_) => heat_bar(out, [x, y]),
        };
    }
}

fn line(out: &mut String, [x, y]: Px, length: f64, colour: &str, style: &str) -> std::fmt::Result {
    writeln!(
        out,
        "<path d=\"M{x:.1} {y:.1}h{length}\" fill=\"none\" stroke=\"{colour}\" {style}/>"
    )
}

fn swatch(out: &mut String, [x, y]: Px, fill: &str, border: &str) -> std::fmt::Result {
    writeln!(
        out,
        "<rect x=\"{x:.1}\" y=\"{:.1}\" width=\"24\" height=\"14\" fill=\"{fill}\" stroke=\"{border}\"/>",
        y - 7.0
    )
}

fn heat_bar(out: &mut String, [x, y]: Px) -> std::fmt::Result {
    for i in 0..30 {
        writeln!(
            out,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"3.4\" height=\"12\" fill=\"{}\"/>",
            x + 3.0 * f64::from(i),
            y - 6.0,
            hex(colour::heat(f64::from(i) / 29.0))
        )?;
    }
    Ok(())
}

/// A number with four digits, without trailing zeros.
fn short(value: f64) -> String {
    let digits = (3.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}
