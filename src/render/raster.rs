//! Pixels: PNG pictures, and heatmaps as PNG and as NumPy arrays.

use std::sync::{Arc, OnceLock};

use resvg::tiny_skia::{
    FillRule, FilterQuality, Mask, PathBuilder, Pixmap, PixmapPaint, Rect, Transform,
};
use resvg::usvg::{Options, Tree, fontdb};

use super::Picture;
use super::colour;
use super::svg::{self, Drawing, Layers};
use crate::guidance::Heatmap;

/// Why a picture could not be turned into pixels.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The scale is out of range.
    #[error("a picture's scale is a number from 0.1 to 8, found {0}")]
    Scale(f64),
    /// A heatmap's values do not fit its side.
    #[error("a heatmap of side {side} has {side}·{side} values, found {found}")]
    HeatmapShape {
        /// Cells per side.
        side: usize,
        /// How many values there are.
        found: usize,
    },
    /// The drawing could not be read back.
    #[error("the picture cannot be drawn: {0}")]
    Svg(#[from] resvg::usvg::Error),
    /// The image does not fit into memory.
    #[error("an image of {width} × {height} pixels is too large")]
    TooLarge {
        /// Pixels along x.
        width: u32,
        /// Pixels along y.
        height: u32,
    },
    /// The pixels could not be encoded.
    #[error("the image cannot be encoded: {0}")]
    Png(#[from] png::EncodingError),
}

/// The fonts that stand in the program itself: a bare machine has none.
fn fonts() -> Arc<fontdb::Database> {
    static FONTS: OnceLock<Arc<fontdb::Database>> = OnceLock::new();
    let load = || {
        let mut fonts = fontdb::Database::new();
        fonts.load_font_data(include_bytes!("../../assets/fonts/DejaVuSans-subset.ttf").to_vec());
        fonts.load_font_data(
            include_bytes!("../../assets/fonts/DejaVuSans-Bold-subset.ttf").to_vec(),
        );
        fonts.set_sans_serif_family(svg::FONT);
        Arc::new(fonts)
    };
    Arc::clone(FONTS.get_or_init(load))
}

pub(super) fn picture_png(picture: &Picture<'_>, scale: f64) -> Result<Vec<u8>, RenderError> {
    if !(0.1..=8.0).contains(&scale) {
        return Err(RenderError::Scale(scale));
    }
    // The renderer is built without decoders for embedded images, so the heatmap is drawn here
    // and everything else on top of it.
    let drawing = svg::draw(picture, Layers::WithoutHeatmap);
    let width = (drawing.width * scale).ceil() as u32;
    let height = (drawing.height * scale).ceil() as u32;
    let mut pixels = Pixmap::new(width, height).ok_or(RenderError::TooLarge { width, height })?;
    pixels.fill(resvg::tiny_skia::Color::WHITE);
    let transform = Transform::from_scale(scale as f32, scale as f32);
    if let Some(heatmap) = picture.heatmap {
        lay_heatmap(&mut pixels, heatmap, &drawing, transform)?;
    }
    let options = Options {
        fontdb: fonts(),
        font_family: svg::FONT.to_owned(),
        ..Options::default()
    };
    let tree = Tree::from_str(&drawing.text, &options)?;
    resvg::render(&tree, transform, &mut pixels.as_mut());
    encode(width, height, &opaque(&pixels))
}

/// A drawing that stands for itself, as PNG.
pub(crate) fn svg_png(text: &str, scale: f32) -> Result<Vec<u8>, RenderError> {
    let options = Options {
        fontdb: fonts(),
        font_family: svg::FONT.to_owned(),
        ..Options::default()
    };
    let tree = Tree::from_str(text, &options)?;
    let [width, height] =
        [tree.size().width(), tree.size().height()].map(|side| (side * scale).ceil() as u32);
    let mut pixels = Pixmap::new(width, height).ok_or(RenderError::TooLarge { width, height })?;
    pixels.fill(resvg::tiny_skia::Color::WHITE);
    let transform = Transform::from_scale(scale, scale);
    resvg::render(&tree, transform, &mut pixels.as_mut());
    encode(width, height, &opaque(&pixels))
}

/// The pixels without transparency: three channels make a smaller file than four.
fn opaque(pixels: &Pixmap) -> Vec<u8> {
    pixels
        .pixels()
        .iter()
        .flat_map(|p| [p.red(), p.green(), p.blue()])
        .collect()
}

fn lay_heatmap(
    pixels: &mut Pixmap,
    heatmap: &Heatmap,
    drawing: &Drawing,
    transform: Transform,
) -> Result<(), RenderError> {
    let side = heatmap.side as u32;
    let rgb = heatmap_pixels(heatmap, 1)?;
    let Some(mut image) = Pixmap::new(side, side) else {
        return Ok(()); // a heatmap of no cells shows nothing
    };
    for (target, source) in image
        .data_mut()
        .chunks_exact_mut(4)
        .zip(rgb.chunks_exact(3))
    {
        target.copy_from_slice(&[source[0], source[1], source[2], 255]);
    }
    let frame = drawing.map_frame;
    let square = drawing.heatmap_frame;
    let cell = (square.max[0] - square.min[0]) / f64::from(side);
    let place = transform
        .pre_translate(square.min[0] as f32, square.min[1] as f32)
        .pre_scale(cell as f32, cell as f32);
    let clip = Rect::from_ltrb(
        frame.min[0] as f32,
        frame.min[1] as f32,
        frame.max[0] as f32,
        frame.max[1] as f32,
    )
    .map(PathBuilder::from_rect);
    let mut mask = Mask::new(pixels.width(), pixels.height());
    if let (Some(mask), Some(clip)) = (&mut mask, clip) {
        mask.fill_path(&clip, FillRule::Winding, true, transform);
    }
    let paint = PixmapPaint {
        quality: FilterQuality::Bilinear,
        ..PixmapPaint::default()
    };
    pixels.draw_pixmap(0, 0, image.as_ref(), &paint, place, mask.as_ref());
    Ok(())
}

/// A heatmap as a PNG image in colour, `cell` pixels for each cell's side, north up.
///
/// Dark teal is the largest value of the heatmap, white is zero. For the numbers themselves use
/// [`heatmap_npy`].
///
/// # Errors
/// If the heatmap's values do not fit its side, or the image would be too large.
pub fn heatmap_png(heatmap: &Heatmap, cell: u32) -> Result<Vec<u8>, RenderError> {
    let cell = cell.max(1);
    let side = (heatmap.side as u32).saturating_mul(cell);
    if side > 1 << 15 {
        let (width, height) = (side, side);
        return Err(RenderError::TooLarge { width, height });
    }
    let rgb = heatmap_pixels(heatmap, cell as usize)?;
    encode(side, side, &rgb)
}

/// Rows from the top, three bytes a pixel.
fn heatmap_pixels(heatmap: &Heatmap, cell: usize) -> Result<Vec<u8>, RenderError> {
    let side = heatmap.side;
    check_shape(heatmap)?;
    let peak = heatmap.values.iter().copied().fold(0.0_f32, f32::max);
    let scale = if peak > 0.0 { 1.0 / peak } else { 0.0 };
    let colours: Vec<[u8; 3]> = heatmap
        .values
        .iter()
        .map(|v| colour::heat(f64::from(v * scale)))
        .collect();
    let mut rgb = Vec::with_capacity(side * side * cell * cell * 3);
    for row in 0..side * cell {
        let j = side - 1 - row / cell;
        for i in 0..side {
            for _ in 0..cell {
                rgb.extend(colours[i * side + j]);
            }
        }
    }
    Ok(rgb)
}

fn check_shape(heatmap: &Heatmap) -> Result<(), RenderError> {
    let (side, found) = (heatmap.side, heatmap.values.len());
    if found == side * side {
        Ok(())
    } else {
        Err(RenderError::HeatmapShape { side, found })
    }
}

/// A heatmap as a NumPy file: float32, little endian, shape (side, side) with axes (x, y) and the
/// lowest coordinates first.
///
/// # Errors
/// If the heatmap's values do not fit its side.
pub fn heatmap_npy(heatmap: &Heatmap) -> Result<Vec<u8>, RenderError> {
    check_shape(heatmap)?;
    let side = heatmap.side;
    let mut header =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({side}, {side}), }}");
    // Magic, version and length take 10 bytes; the whole header is padded to a multiple of 64.
    let padding = 63 - (10 + header.len()) % 64;
    header.push_str(&" ".repeat(padding));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(heatmap.values.iter().flat_map(|v| v.to_le_bytes()));
    Ok(bytes)
}

fn encode(width: u32, height: u32, rgb: &[u8]) -> Result<Vec<u8>, RenderError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(rgb)?;
    writer.finish()?;
    Ok(bytes)
}

/// The heatmap as it is embedded in an SVG document.
pub(super) fn heatmap_data_uri(heatmap: &Heatmap) -> Option<String> {
    let png = heatmap_png(heatmap, 1).ok()?;
    Some(format!("data:image/png;base64,{}", base64(&png)))
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let group = (u32::from(chunk[0]) << 16)
            | (u32::from(chunk.get(1).copied().unwrap_or(0)) << 8)
            | u32::from(chunk.get(2).copied().unwrap_or(0));
        for k in 0..4 {
            let digit = DIGITS[(group >> (18 - 6 * k) & 63) as usize] as char;
            text.push(if k > chunk.len() { '=' } else { digit });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_matches_the_standard_examples() {
        let pairs = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ];
        for (plain, coded) in pairs {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }

    #[test]
    fn npy_has_an_aligned_header_and_the_values() {
        let heatmap = Heatmap {
            side: 2,
            values: vec![0.0, 0.25, 0.5, 1.0],
        };
        let bytes = heatmap_npy(&heatmap).unwrap();
        let header = 10 + u16::from_le_bytes([bytes[8], bytes[9]]) as usize;
        assert_eq!(header % 64, 0);
        assert_eq!(bytes[header - 1], b'\n');
        assert!(String::from_utf8_lossy(&bytes[10..header]).contains("'shape': (2, 2)"));
        assert_eq!(bytes[header + 4..header + 8], 0.25_f32.to_le_bytes());
        assert_eq!(bytes.len(), header + 16);
    }

    #[test]
    fn a_heatmap_image_has_north_at_the_top() {
        // Cell (0, 1): lowest x, highest y.
        let heatmap = Heatmap {
            side: 2,
            values: vec![0.0, 1.0, 0.0, 0.0],
        };
        let rgb = heatmap_pixels(&heatmap, 1).unwrap();
        assert_eq!(rgb[0..3], colour::heat(1.0));
        assert_eq!(rgb[3..6], colour::heat(0.0));
        let broken = Heatmap {
            side: 3,
            values: vec![0.0],
        };
        assert!(matches!(
            heatmap_png(&broken, 1),
            Err(RenderError::HeatmapShape { side: 3, found: 1 })
        ));
    }
}
