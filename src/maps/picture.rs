//! Pictures of maps: PGM and PNG, as brightness and opacity.

use std::io::Cursor;

use super::{MAX_CELLS, MapErrorKind};

/// A picture, the top row first.
pub(super) struct Picture {
    pub(super) width: usize,
    pub(super) height: usize,
    /// The brightness of each pixel, in `[0, 1]`.
    pub(super) light: Vec<f32>,
    /// The opacity of each pixel, in `[0, 1]`; empty for pictures without.
    pub(super) alpha: Vec<f32>,
    /// How many colour channels there are.
    pub(super) channels: usize,
}

/// Reads a picture by its first bytes.
pub(super) fn read(bytes: &[u8]) -> Result<Picture, MapErrorKind> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => png(bytes),
        [b'P', b'5' | b'2', ..] => pgm(bytes),
        _ => Err(syntax(
            "the picture is neither PGM (`P5` or `P2`) nor PNG: save it as one of them",
        )),
    }
}

fn syntax(message: impl Into<String>) -> MapErrorKind {
    MapErrorKind::Syntax(message.into())
}

fn cells(width: u64, height: u64) -> Result<usize, MapErrorKind> {
    let fits = width.checked_mul(height).filter(|&n| n <= MAX_CELLS);
    if width == 0 || height == 0 {
        return Err(syntax(format!("the picture has {width} × {height} pixels")));
    }
    let limit = MAX_CELLS;
    let too_many = MapErrorKind::TooManyCells {
        width,
        height,
        limit,
    };
    fits.map(|n| n as usize).ok_or(too_many)
}

fn pgm(bytes: &[u8]) -> Result<Picture, MapErrorKind> {
    let mut header = Header { bytes, at: 2 };
    let width = header.number("the width")?;
    let height = header.number("the height")?;
    let most = header.number("the largest grey value")?;
    if !(1..=65_535).contains(&most) {
        return Err(syntax(format!(
            "the largest grey value is {most}: expected 1 to 65535"
        )));
    }
    let n = cells(width, height)?;
    let short = |found: usize| {
        syntax(format!(
            "the picture ends after {found} of {n} pixels: is the file complete?"
        ))
    };
    let sample = |v: u64| (v.min(most) as f64 / most as f64) as f32;
    let mut light = Vec::new();
    if bytes[1] == b'2' {
        while light.len() < n {
            let Ok(value) = header.number("a pixel") else {
                return Err(short(light.len()));
            };
            light.push(sample(value));
        }
    } else {
        let data = bytes.get(header.at + 1..).unwrap_or_default();
        let size = if most < 256 { 1 } else { 2 };
        if data.len() < n * size {
            return Err(short(data.len() / size));
        }
        let value = |b: &[u8]| b.iter().fold(0, |v, &b| v << 8 | u64::from(b));
        light.extend(
            data[..n * size]
                .chunks_exact(size)
                .map(|b| sample(value(b))),
        );
    }
    Ok(Picture {
        width: width as usize,
        height: height as usize,
        light,
        alpha: Vec::new(),
        channels: 1,
    })
}

/// The text before the pixels.
struct Header<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Header<'_> {
    /// The next number; `#` begins a comment up to the end of its line.
    fn number(&mut self, what: &str) -> Result<u64, MapErrorKind> {
        while let Some(&b) = self.bytes.get(self.at) {
            if b == b'#' {
                let rest = &self.bytes[self.at..];
                self.at += rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
            } else if b.is_ascii_whitespace() {
                self.at += 1;
            } else {
                break;
            }
        }
        let from = self.at;
        while self.bytes.get(self.at).is_some_and(u8::is_ascii_digit) {
            self.at += 1;
        }
        let digits = std::str::from_utf8(&self.bytes[from..self.at]).unwrap_or_default();
        digits
            .parse()
            .map_err(|_| syntax(format!("byte {from}: expected {what}, a whole number")))
    }
}

fn png(bytes: &[u8]) -> Result<Picture, MapErrorKind> {
    let broken = |e: png::DecodingError| syntax(format!("the PNG cannot be read: {e}"));
    let limits = png::Limits { bytes: 256 << 20 };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(broken)?;
    let (width, height) = reader.info().size();
    let n = cells(width.into(), height.into())?;
    let size = reader.output_buffer_size().filter(|&s| s <= 8 * n);
    let Some(size) = size else {
        return Err(syntax("the PNG's rows do not fit its size"));
    };
    let mut buffer = vec![0; size];
    let frame = reader.next_frame(&mut buffer).map_err(broken)?;
    let wide = frame.bit_depth == png::BitDepth::Sixteen;
    let samples = frame.color_type.samples();
    let has_alpha = samples % 2 == 0;
    let channels = samples - usize::from(has_alpha);
    let sample = |b: &[u8]| match *b {
        [high, low] => f32::from(u16::from_be_bytes([high, low])) / 65_535.0,
        [one] => f32::from(one) / 255.0,
        _ => 0.0,
    };
    let bytes = if wide { 2 } else { 1 };
    let mut picture = Picture {
        width: width as usize,
        height: height as usize,
        light: Vec::with_capacity(n),
        alpha: Vec::new(),
        channels,
    };
    for pixel in buffer.chunks_exact(samples * bytes).take(n) {
        let values: Vec<f32> = pixel.chunks_exact(bytes).map(sample).collect();
        picture
            .light
            .push(values[..channels].iter().sum::<f32>() / channels as f32);
        if has_alpha {
            picture.alpha.push(values[channels]);
        }
    }
    if picture.light.len() < n {
        return Err(syntax("the PNG holds fewer pixels than it says"));
    }
    Ok(picture)
}
