//! The measurements as a picture: one bar for each network and device, on a logarithmic axis.

use std::fmt::Write as _;

use super::InferenceTable;
use crate::render::{RenderError, svg_png};

const ROW: f64 = 22.0;
const LEFT: f64 = 330.0;
const PLOT: f64 = 460.0;
const TOP: f64 = 54.0;
const WIDTH: f64 = LEFT + PLOT + 130.0;

/// Blue, vermilion and green of the Okabe–Ito palette.
const COLOURS: [&str; 3] = ["#005fa3", "#c84c00", "#009e73"];

impl InferenceTable {
    /// The picture as SVG: bars end at the median, whiskers at 95 %.
    #[must_use]
    pub fn to_svg(&self) -> String {
        let ends = |f: fn(f64, f64) -> f64, start: f64| {
            let all = self.rows.iter();
            all.flat_map(|r| [r.steady_ms.median, r.steady_ms.p95])
                .filter(|ms| ms.is_finite() && *ms > 0.0)
                .fold(start, f)
        };
        let low = ends(f64::min, 1.0).log10().floor();
        let high = ends(f64::max, 10.0).log10().ceil();
        let x = |ms: f64| LEFT + PLOT * (ms.max(1e-6).log10() - low) / (high - low);
        let height = TOP + ROW * self.rows.len() as f64 + 46.0;
        let bottom = height - 40.0;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height}\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"DejaVu Sans, sans-serif\" font-size=\"12\" fill=\"#22262b\">\n<rect width=\"{WIDTH}\" height=\"{height}\" fill=\"white\"/>\n<text x=\"12\" y=\"24\" font-size=\"15\">Inference, batch 1, milliseconds (median; whisker: 95 %)</text>\n<text x=\"12\" y=\"42\" fill=\"#6b7278\">{}</text>\n",
            escaped(&self.machine)
        );
        for power in low as i32..=high as i32 {
            let at = x(10f64.powi(power));
            let label = if power < 0 {
                format!("{:.*}", power.unsigned_abs() as usize, 10f64.powi(power))
            } else {
                format!("{:.0}", 10f64.powi(power))
            };
            let _ = writeln!(
                svg,
                "<path d=\"M{at:.1} {TOP}V{bottom:.1}\" stroke=\"#dddfe1\"/>\n<text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"#6b7278\">{label}</text>",
                bottom + 18.0
            );
        }
        for (k, r) in self.rows.iter().enumerate() {
            let y = TOP + ROW * k as f64;
            let device = self.devices.iter().position(|d| d.name == r.device);
            let colour = COLOURS[device.unwrap_or(0) % COLOURS.len()];
            let (median, p95) = (x(r.steady_ms.median), x(r.steady_ms.p95));
            let middle = y + ROW / 2.0;
            let _ = writeln!(
                svg,
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{} · {}</text>\n<rect x=\"{LEFT}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"{colour}\"/>\n<path d=\"M{median:.1} {middle:.1}H{p95:.1}m0 -4v8\" stroke=\"#22262b\" fill=\"none\"/>\n<text x=\"{:.1}\" y=\"{:.1}\">{:.2} ms, {:.0} GFLOP/s</text>",
                LEFT - 8.0,
                middle + 4.0,
                escaped(&r.network),
                escaped(&short(&r.device)),
                y + 4.0,
                (median - LEFT).max(1.0),
                ROW - 8.0,
                p95.max(median) + 8.0,
                middle + 4.0,
                r.steady_ms.median,
                r.gflops
            );
        }
        svg.push_str("</svg>\n");
        svg
    }

    /// The picture as PNG.
    ///
    /// # Errors
    /// If it cannot be drawn.
    pub fn to_png(&self) -> Result<Vec<u8>, RenderError> {
        svg_png(&self.to_svg(), 2.0)
    }
}

/// The first words of an adapter's name.
fn short(name: &str) -> String {
    let word = name.split(" (").next().unwrap_or(name);
    word.chars().take(24).collect()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}
