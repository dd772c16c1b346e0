//! Colours that stay apart for colour-blind readers and in grey print.

/// An opaque colour: red, green, blue.
pub(super) type Rgb = [u8; 3];

/// The prefix: blue of the Okabe–Ito palette, which common colour blindness leaves distinct.
pub(super) const PREFIX: Rgb = [0x00, 0x5f, 0xa3];
/// The suffix: vermilion of the same palette.
pub(super) const SUFFIX: Rgb = [0xc8, 0x4c, 0x00];
/// Bands under lines: bluish green of the same palette.
pub(super) const BAND: Rgb = [0x00, 0x9e, 0x73];
/// Text and the start.
pub(super) const INK: Rgb = [0x22, 0x26, 0x2b];
/// Axes and other things of second rank.
pub(super) const FAINT: Rgb = [0x6b, 0x72, 0x78];
/// Fill of obstacles; their hatching and border.
pub(super) const OBSTACLE: Rgb = [0xdd, 0xdf, 0xe1];
pub(super) const HATCH: Rgb = [0x9a, 0x9f, 0xa4];

/// Hues of regions, degrees in OKLCh; neighbours in the list are far apart.
const REGION_HUES: [f64; 8] = [145.0, 300.0, 85.0, 230.0, 20.0, 190.0, 340.0, 115.0];

/// Fill of region `i`: pastel.
pub(super) fn region_fill(i: usize) -> Rgb {
    oklch(0.91, 0.06, REGION_HUES[i % REGION_HUES.len()])
}

/// Border of region `i`: the same hue, dark.
pub(super) fn region_border(i: usize) -> Rgb {
    oklch(0.52, 0.10, REGION_HUES[i % REGION_HUES.len()])
}

/// The heatmap's scale: value in `[0, 1]` to colour. Lightness falls evenly in a perceptual colour
/// space (OKLab, B. Ottosson 2020), so equal steps look equal and grey print keeps the order; the
/// hue runs from yellow to teal, away from the colours of paths.
pub(super) fn heat(value: f64) -> Rgb {
    let t = if value.is_finite() {
        value.clamp(0.0, 1.0)
    } else {
        0.0
    };
    oklch(
        1.0 - 0.40 * t,
        0.14 * (1.0 - (1.0 - t).powi(2)),
        95.0 + 95.0 * t,
    )
}

/// The colour as `#rrggbb`.
pub(super) fn hex([r, g, b]: Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// From lightness, chroma and hue (degrees) of OKLCh to sRGB, clipped to what it can show.
fn oklch(lightness: f64, chroma: f64, hue: f64) -> Rgb {
    let (sin, cos) = hue.to_radians().sin_cos();
    let (a, b) = (chroma * cos, chroma * sin);
    let cube = |x: f64| x * x * x;
    let l = cube(lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b);
    let m = cube(lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b);
    let s = cube(lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b);
    [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ]
    .map(|linear: f64| {
        let linear = linear.clamp(0.0, 1.0);
        let encoded = if linear <= 0.003_130_8 {
            12.92 * linear
        } else {
            1.055 * linear.powf(1.0 / 2.4) - 0.055
        };
        (encoded * 255.0).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn luminance([r, g, b]: Rgb) -> f64 {
        0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
    }

    #[test]
    fn the_heat_scale_darkens_step_by_step() {
        let steps: Vec<f64> = (0..=20)
            .map(|i| luminance(heat(f64::from(i) / 20.0)))
            .collect();
        assert!(steps.windows(2).all(|w| w[1] < w[0]), "{steps:?}");
        assert!(steps[0] > 240.0 && steps[20] < 150.0);
        assert_eq!(heat(f64::NAN), heat(0.0));
        assert_eq!(heat(7.0), heat(1.0));
    }

    #[test]
    fn white_and_black_convert_exactly() {
        assert_eq!(oklch(1.0, 0.0, 0.0), [255, 255, 255]);
        assert_eq!(oklch(0.0, 0.0, 0.0), [0, 0, 0]);
    }
}
