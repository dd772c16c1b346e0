//! Occupancy maps of ROS' `map_server`: a YAML file beside a picture.

use std::collections::BTreeMap;

use super::outline::Cells;
use super::picture::Picture;
use super::{Import, MapErrorKind, MapOptions};

/// What the YAML file says.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MapFile {
    pub(super) image: String,
    resolution: f64,
    origin: [f64; 3],
    occupied: f64,
    free: f64,
    negate: bool,
    mode: Mode,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    Trinary,
    Scale,
    Raw,
}

/// The values of a flat mapping, with their lines.
type Fields = BTreeMap<String, (usize, Vec<String>)>;

type Fault = (Option<usize>, MapErrorKind);

/// Reads the YAML file; the error names its line.
pub(super) fn read(text: &str) -> Result<MapFile, Fault> {
    let fields = fields(text)?;
    let image = one(&fields, "image")?.1;
    if image.is_empty() {
        return Err(wrong(&fields, "image", "is empty: name the picture's file"));
    }
    let resolution = number(&fields, "resolution")?;
    if resolution <= 0.0 {
        let problem = format!("is {resolution}: expected metres per pixel, above 0");
        return Err(wrong(&fields, "resolution", &problem));
    }
    let origin = &fields.get("origin").ok_or_else(|| missing("origin"))?.1;
    let origin: Vec<f64> = origin.iter().map_while(|v| finite(v)).collect();
    let &[x, y, yaw] = origin.as_slice() else {
        let problem = "should be three numbers: [x, y, yaw]";
        return Err(wrong(&fields, "origin", problem));
    };
    let share = |name: &str| {
        let value = number(&fields, name)?;
        let problem = format!("is {value}: expected a number from 0 to 1");
        let fits = (0.0..=1.0).contains(&value);
        fits.then_some(value)
            .ok_or_else(|| wrong(&fields, name, &problem))
    };
    let (occupied, free) = (share("occupied_thresh")?, share("free_thresh")?);
    if free >= occupied {
        let problem = format!("is {free}: it must be less than `occupied_thresh`, {occupied}");
        return Err(wrong(&fields, "free_thresh", &problem));
    }
    let negate = match optional(&fields, "negate")?.as_deref() {
        None | Some("0" | "false" | "False") => false,
        Some("1" | "true" | "True") => true,
        Some(_) => return Err(wrong(&fields, "negate", "should be 0 or 1")),
    };
    let mode = match optional(&fields, "mode")?.as_deref() {
        None | Some("trinary") => Mode::Trinary,
        Some("scale") => Mode::Scale,
        Some("raw") => Mode::Raw,
        Some(_) => {
            let problem = "should be trinary, scale or raw";
            return Err(wrong(&fields, "mode", problem));
        }
    };
    Ok(MapFile {
        image,
        resolution,
        origin: [x, y, yaw],
        occupied,
        free,
        negate,
        mode,
    })
}

impl MapFile {
    /// Tells free from occupied cells.
    pub(super) fn cells(&self, picture: &Picture, options: &MapOptions) -> Import {
        let mut unknown = 0;
        let (width, height) = (picture.width, picture.height);
        let mut occupied = Vec::with_capacity(width * height);
        for row in (0..height).rev() {
            for i in row * width..(row + 1) * width {
                let state = self.state(picture, i);
                unknown += usize::from(state.is_none());
                occupied.push(state.unwrap_or(!options.unknown_is_free));
            }
        }
        Import {
            cells: Cells {
                width,
                height,
                occupied,
            },
            scale: self.resolution,
            origin: self.origin,
            unknown,
        }
    }

    /// Whether a pixel is occupied; `None` if that is unknown. Between the thresholds every mode
    /// knows nothing.
    fn state(&self, picture: &Picture, i: usize) -> Option<bool> {
        let light = f64::from(picture.light[i]);
        let alpha = picture.alpha.get(i).map(|&a| f64::from(a));
        let p = match (self.mode, alpha) {
            (Mode::Raw, _) => {
                let value = (light * 255.0).round();
                if value > 100.0 {
                    return None;
                }
                value / 100.0
            }
            (Mode::Scale, Some(alpha)) if alpha < 1.0 => return None,
            (Mode::Scale, _) | (Mode::Trinary, None) => self.occupancy(light),
            (Mode::Trinary, Some(alpha)) => {
                let channels = picture.channels as f64;
                self.occupancy((light * channels + alpha) / (channels + 1.0))
            }
        };
        if p > self.occupied {
            Some(true)
        } else if p < self.free {
            Some(false)
        } else {
            None
        }
    }

    fn occupancy(&self, light: f64) -> f64 {
        if self.negate { light } else { 1.0 - light }
    }
}

fn missing(field: &str) -> Fault {
    let problem = "is missing".to_owned();
    let field = field.to_owned();
    (None, MapErrorKind::Field { field, problem })
}

fn wrong(fields: &Fields, field: &str, problem: &str) -> Fault {
    let line = fields.get(field).map(|f| f.0);
    let (field, problem) = (field.to_owned(), problem.to_owned());
    (line, MapErrorKind::Field { field, problem })
}

/// The line and the value of a field that has one value.
fn one(fields: &Fields, name: &str) -> Result<(usize, String), Fault> {
    match fields.get(name) {
        None => Err(missing(name)),
        Some((line, values)) => match values.as_slice() {
            [value] => Ok((*line, value.clone())),
            [] => Err(wrong(fields, name, "has no value")),
            _ => Err(wrong(fields, name, "should be one value, not a list")),
        },
    }
}

fn optional(fields: &Fields, name: &str) -> Result<Option<String>, Fault> {
    if fields.contains_key(name) {
        one(fields, name).map(|f| Some(f.1))
    } else {
        Ok(None)
    }
}

fn number(fields: &Fields, name: &str) -> Result<f64, Fault> {
    let (_, text) = one(fields, name)?;
    finite(&text).ok_or_else(|| wrong(fields, name, "should be a finite number"))
}

fn finite(text: &str) -> Option<f64> {
    text.parse::<f64>().ok().filter(|v| v.is_finite())
}

/// The flat mapping that the file is: `name: value`, values being words, quoted words, or lists of
/// them in brackets or one a line behind `-`.
fn fields(text: &str) -> Result<Fields, Fault> {
    let syntax = |line, message: &str| (Some(line), MapErrorKind::Syntax(message.to_owned()));
    let mut fields = Fields::new();
    let mut open: Option<String> = None;
    let mut lines = text.lines().enumerate();
    while let Some((i, line)) = lines.next() {
        let number = i + 1;
        let line = without_comment(line);
        let trimmed = line.trim();
        if trimmed.is_empty() || trimmed == "---" || trimmed.starts_with('%') {
            continue;
        }
        if trimmed == "..." {
            break;
        }
        let item = trimmed.strip_prefix("- ");
        if let (Some(value), Some(name)) = (item, &open) {
            if let Some(field) = fields.get_mut(name) {
                field.1.push(unquoted(value));
            }
            continue;
        }
        let Some((name, value)) = trimmed.split_once(':') else {
            let message = "expected `name: value`, as in `resolution: 0.05`";
            return Err(syntax(number, message));
        };
        let name = unquoted(name);
        let mut value = value.trim().to_owned();
        // A list in brackets may go on for some lines.
        while value.starts_with('[') && !value.contains(']') {
            let Some((_, more)) = lines.next() else {
                return Err(syntax(number, "the list is not closed: `]` is missing"));
            };
            value.push(' ');
            value.push_str(without_comment(more).trim());
        }
        let values = match value.strip_prefix('[') {
            Some(list) => {
                let list = list.split(']').next().unwrap_or_default();
                list.split(',').map(unquoted).collect()
            }
            None if value.is_empty() => Vec::new(),
            None => vec![unquoted(&value)],
        };
        open = values.is_empty().then(|| name.clone());
        if fields.insert(name, (number, values)).is_some() {
            return Err(syntax(number, "this field is there twice"));
        }
    }
    Ok(fields)
}

fn unquoted(text: &str) -> String {
    let text = text.trim();
    let inner = ['"', '\'']
        .iter()
        .find_map(|&q| text.strip_prefix(q)?.strip_suffix(q));
    inner.unwrap_or(text).to_owned()
}

/// A line without its comment: `#` at its beginning or behind white space, out of quotes.
fn without_comment(line: &str) -> &str {
    let mut quote = None;
    let mut before = ' ';
    for (i, c) in line.char_indices() {
        match quote {
            Some(q) if c == q => quote = None,
            Some(_) => {}
            None if c == '"' || c == '\'' => quote = Some(c),
            None if c == '#' && before.is_whitespace() => return &line[..i],
            None => {}
        }
        before = c;
    }
    line
}
