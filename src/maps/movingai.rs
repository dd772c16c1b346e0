//! Grids of the MovingAI benchmarks: `.map`.

use super::outline::Cells;
use super::{Import, MAX_CELLS, MapErrorKind, MapOptions};

/// Reads a `.map` text; the error names its line.
pub(super) fn read(text: &str, options: &MapOptions) -> Result<Import, (usize, MapErrorKind)> {
    let syntax = |line: usize, message: String| (line, MapErrorKind::Syntax(message));
    let mut lines = text.lines().enumerate().map(|(i, l)| (i + 1, l));
    let (mut kind, mut height, mut width) = (None, None, None);
    let mut last = 1;
    let begins = loop {
        let Some((number, line)) = lines.next() else {
            return Err(syntax(last, "the file ends before a line `map`".to_owned()));
        };
        last = number;
        let mut words = line.split_ascii_whitespace();
        let (word, value) = (words.next(), words.next());
        let size = |value: Option<&str>| {
            let value = value.and_then(|v| v.parse::<u64>().ok()).filter(|&v| v > 0);
            let wrong = "expected a whole number above 0 behind `height` and `width`";
            value.ok_or_else(|| syntax(number, wrong.to_owned()))
        };
        match word {
            Some("type") => kind = value,
            Some("height") => height = Some(size(value)?),
            Some("width") => width = Some(size(value)?),
            Some("map") => break number,
            None => {}
            Some(other) => {
                let other: String = other.chars().take(20).collect();
                let message =
                    format!("expected `type`, `height`, `width` or `map`, found `{other}`");
                return Err(syntax(number, message));
            }
        }
    };
    if kind != Some("octile") {
        let message = "the first line should read `type octile`".to_owned();
        return Err(syntax(1, message));
    }
    let (Some(height), Some(width)) = (height, width) else {
        let message = "`height` and `width` must stand before `map`".to_owned();
        return Err(syntax(begins, message));
    };
    if width.checked_mul(height).is_none_or(|n| n > MAX_CELLS) {
        let limit = MAX_CELLS;
        let many = MapErrorKind::TooManyCells {
            width,
            height,
            limit,
        };
        return Err((begins, many));
    }
    let (width, height) = (width as usize, height as usize);
    let mut rows = Vec::new();
    for (number, line) in lines.by_ref().take(height) {
        rows.push(row(line, width, options).map_err(|message| syntax(number, message))?);
        last = number;
    }
    if rows.len() < height {
        let message = format!("the map ends after {} of {height} rows", rows.len());
        return Err(syntax(last, message));
    }
    if let Some((number, _)) = lines.find(|(_, line)| !line.trim().is_empty()) {
        let message = format!("there are more rows than the {height} of `height`");
        return Err(syntax(number, message));
    }
    // The first row is the highest.
    let occupied = rows.into_iter().rev().flatten().collect();
    Ok(Import {
        cells: Cells {
            width,
            height,
            occupied,
        },
        scale: options.cell.unwrap_or(1.0),
        origin: [0.0; 3],
        unknown: 0,
    })
}

fn row(line: &str, width: usize, options: &MapOptions) -> Result<Vec<bool>, String> {
    let cell = |(i, c): (usize, char)| match c {
        '.' | 'G' => Ok(false),
        'S' => Ok(options.swamp_is_obstacle),
        'W' => Ok(!options.water_is_free),
        '@' | 'O' | 'T' => Ok(true),
        other => Err(format!(
            "column {}: `{}` is no terrain: expected one of . G S W @ O T",
            i + 1,
            other.escape_default()
        )),
    };
    let row: Vec<bool> = line
        .chars()
        .enumerate()
        .map(cell)
        .collect::<Result<_, _>>()?;
    if row.len() != width {
        return Err(format!(
            "the row has {} cells, `width` says {width}",
            row.len()
        ));
    }
    Ok(row)
}
