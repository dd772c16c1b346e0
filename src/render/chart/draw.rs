//! The drawing of charts.

use std::fmt::Write as _;

use super::super::colour::{FAINT, INK, hex};
use super::super::labels::{Px, Rect};
use super::super::svg::FONT;
use super::super::text::{heading, text_width, write_text};
use super::axis::Scale;
use super::{Axis, Chart, Ink, Mark, Panel, Spread};

/// Size of the letters at axes and in the legend, in pixels.
const SIZE: f64 = 13.0;
/// Width of a panel without its numbers.
const WIDE: f64 = 380.0;
/// Height of a panel of numbers.
const HIGH: f64 = 290.0;
/// Height of a name's row.
const ROW: f64 = 34.0;
const EDGE: f64 = 18.0;
/// Room for the numbers and the label below a panel.
const BELOW: f64 = 52.0;
const GRID: &str = "#e3e5e7";

impl Chart {
    /// The picture as an SVG document.
    pub(crate) fn to_svg(&self) -> String {
        let lefts: Vec<f64> = self.panels.iter().map(|p| p.y.room()).collect();
        let panels = self.panels.len() as f64;
        let width = 2.0 * EDGE + lefts.iter().sum::<f64>() + panels * (WIDE + EDGE);
        let room = width - 2.0 * EDGE;
        let head = heading(Some(&self.title), Some(&self.subtitle), EDGE, room);
        let (legend, legend_height) = self.legend([EDGE, EDGE + head.height], room);
        let top = EDGE + head.height + legend_height + 8.0;
        let high = self.panels.iter().map(Panel::height).fold(0.0, f64::max);
        let height = top + high + BELOW + EDGE;
        let mut out = String::new();
        let _ = writeln!(
            out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
             viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"{FONT}, Verdana, sans-serif\" \
             font-size=\"{SIZE}\" fill=\"{}\">\n<rect width=\"{width:.0}\" height=\"{height:.0}\" fill=\"white\"/>",
            hex(INK)
        );
        // Headings are placed for the margin that maps have.
        let _ = writeln!(
            out,
            "<g transform=\"translate(0 {EDGE})\">{}</g>",
            head.text
        );
        out.push_str(&legend);
        let mut left = EDGE;
        for (panel, room) in self.panels.iter().zip(lefts) {
            left += room;
            let frame = Rect {
                min: [left, top],
                max: [left + WIDE, top + panel.height()],
            };
            Canvas {
                out: &mut out,
                panel,
                frame,
            }
            .draw();
            left += WIDE + EDGE;
        }
        out.push_str("</svg>\n");
        out
    }

    /// The legend in rows of at most `room`, and its height.
    fn legend(&self, at: Px, room: f64) -> (String, f64) {
        const SAMPLE: f64 = 30.0;
        const LINE: f64 = 22.0;
        let mut text = String::new();
        let (mut x, mut row) = (0.0, 0.0);
        for (name, ink) in &self.legend {
            let width = SAMPLE + 8.0 + text_width(name) * SIZE + 22.0;
            if x > 0.0 && x + width > room {
                (x, row) = (0.0, row + 1.0);
            }
            let middle = [at[0] + x, at[1] + LINE * (row + 0.5)];
            let _ = writeln!(
                text,
                "<path d=\"M{:.1} {:.1}h{SAMPLE}\" {}/>",
                middle[0],
                middle[1],
                ink.stroke(2.6)
            );
            let beside = [middle[0] + SAMPLE + 8.0, middle[1] + SIZE * 0.36];
            write_text(&mut text, beside, name, "");
            x += width;
        }
        let height = if self.legend.is_empty() {
            0.0
        } else {
            LINE * (row + 1.0)
        };
        (text, height)
    }
}

impl Ink {
    fn stroke(self, width: f64) -> String {
        let mut style = format!(
            "fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"",
            self.colour()
        );
        if !self.dashes().is_empty() {
            let _ = write!(style, " stroke-dasharray=\"{}\"", self.dashes());
        }
        style
    }
}

impl Axis {
    /// Room left of a panel for this axis's names and label.
    fn room(&self) -> f64 {
        let names = self
            .ticks()
            .iter()
            .map(|t| text_width(&t.name))
            .fold(0.0, f64::max);
        let label = if self.label.is_empty() { 0.0 } else { 22.0 };
        names * SIZE + 12.0 + label
    }
}

impl Panel {
    fn height(&self) -> f64 {
        match &self.y.scale {
            Scale::Names(names) => ROW * names.len() as f64,
            _ => HIGH,
        }
    }
}

struct Canvas<'a> {
    out: &'a mut String,
    panel: &'a Panel,
    frame: Rect,
}

impl Canvas<'_> {
    fn draw(&mut self) {
        self.axes();
        for mark in &self.panel.marks {
            match mark {
                Mark::Line(points, ink) => self.line(points, *ink),
                Mark::Band(points, ink) => self.band(points, *ink),
                Mark::Box(row, spread, ink) => self.spread(*row, spread, *ink),
                Mark::Interval(row, [low, value, high], ink) => {
                    self.interval(*row, [*low, *value, *high], *ink);
                }
                Mark::Limit(at, name) => self.limit(*at, name),
            }
        }
    }

    fn x(&self, value: f64) -> f64 {
        let Rect { min, max } = self.frame;
        min[0] + self.panel.x.share(value) * (max[0] - min[0])
    }

    fn y(&self, value: f64) -> f64 {
        let Rect { min, max } = self.frame;
        let share = self.panel.y.share(value);
        let down = match self.panel.y.scale {
            Scale::Names(_) => share,
            _ => 1.0 - share,
        };
        min[1] + down * (max[1] - min[1])
    }

    fn add(&mut self, element: std::fmt::Arguments<'_>) {
        let _ = self.out.write_fmt(element);
        self.out.push('\n');
    }

    fn axes(&mut self) {
        let Rect { min, max } = self.frame;
        let (faint, panel) = (hex(FAINT), self.panel);
        for tick in panel.x.ticks() {
            let x = self.x(tick.at);
            let width = if tick.name.is_empty() { 0.6 } else { 1.2 };
            self.add(format_args!(
                "<path d=\"M{x:.1} {:.1}V{:.1}\" stroke=\"{GRID}\" stroke-width=\"{width}\"/>",
                min[1], max[1]
            ));
            let style = format!("text-anchor=\"middle\" fill=\"{faint}\"");
            if !tick.name.is_empty() {
                write_text(self.out, [x, max[1] + 19.0], &tick.name, &style);
            }
        }
        let named = matches!(panel.y.scale, Scale::Names(_));
        for tick in panel.y.ticks() {
            let y = self.y(tick.at);
            if !named {
                self.add(format_args!(
                    "<path d=\"M{:.1} {y:.1}H{:.1}\" stroke=\"{GRID}\" stroke-width=\"{}\"/>",
                    min[0],
                    max[0],
                    if tick.name.is_empty() { 0.6 } else { 1.2 }
                ));
            }
            let colour = if named { hex(INK) } else { faint.clone() };
            let style = format!("text-anchor=\"end\" fill=\"{colour}\"");
            if !tick.name.is_empty() {
                let at = [min[0] - 8.0, y + SIZE * 0.36];
                write_text(self.out, at, &tick.name, &style);
            }
        }
        self.add(format_args!(
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"none\" stroke=\"{faint}\"/>",
            min[0],
            min[1],
            max[0] - min[0],
            max[1] - min[1]
        ));
        let below = [(min[0] + max[0]) / 2.0, max[1] + 42.0];
        write_text(self.out, below, &panel.x.label, "text-anchor=\"middle\"");
        if !panel.y.label.is_empty() {
            let at = [min[0] - panel.y.room() + 14.0, (min[1] + max[1]) / 2.0];
            let style = format!(
                "text-anchor=\"middle\" transform=\"rotate(-90 {:.1} {:.1})\"",
                at[0], at[1]
            );
            write_text(self.out, at, &panel.y.label, &style);
        }
    }

    fn line(&mut self, points: &[[f64; 2]], ink: Ink) {
        let points: Vec<Px> = points
            .iter()
            .map(|&[x, y]| [self.x(x), self.y(y)])
            .collect();
        if !points.is_empty() {
            let data = path_data(&points);
            self.add(format_args!("<path d=\"{data}\" {}/>", ink.stroke(2.2)));
        }
    }

    fn band(&mut self, points: &[[f64; 3]], ink: Ink) {
        let edge = |k: usize| points.iter().map(move |p| [p[0], p[k]]);
        let px = |[x, y]: [f64; 2]| [self.x(x), self.y(y)];
        let lower: Vec<Px> = edge(1).map(px).collect();
        let upper: Vec<Px> = edge(2).map(px).collect();
        if lower.is_empty() {
            return;
        }
        let around: Vec<Px> = lower.iter().chain(upper.iter().rev()).copied().collect();
        let (data, colour) = (path_data(&around), ink.colour());
        self.add(format_args!(
            "<path d=\"{data}Z\" fill=\"{colour}\" fill-opacity=\"0.08\"/>"
        ));
        // Where several bands lie over each other, their edges tell them apart.
        for edge in [&lower, &upper] {
            self.add(format_args!(
                "<path d=\"{}\" {} stroke-opacity=\"0.55\"/>",
                path_data(edge),
                ink.stroke(0.9)
            ));
        }
    }

    fn spread(&mut self, row: f64, spread: &Spread, ink: Ink) {
        let y = self.y(row);
        let half = ROW * 0.27;
        let [low, first, middle, third, high] = spread.quantiles.map(|v| self.x(v));
        let colour = ink.colour();
        self.add(format_args!(
            "<path d=\"M{low:.1} {y:.1}H{first:.1}M{third:.1} {y:.1}H{high:.1}M{low:.1} {:.1}v{half:.1}M{high:.1} {:.1}v{half:.1}\" stroke=\"{colour}\" stroke-width=\"1.6\"/>",
            y - half / 2.0,
            y - half / 2.0
        ));
        self.add(format_args!(
            "<rect x=\"{first:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"{colour}\" fill-opacity=\"0.22\" stroke=\"{colour}\" stroke-width=\"1.6\"/>",
            y - half,
            (third - first).max(1.0),
            2.0 * half
        ));
        self.add(format_args!(
            "<path d=\"M{middle:.1} {:.1}V{:.1}\" stroke=\"{colour}\" stroke-width=\"3.2\"/>",
            y - half,
            y + half
        ));
        let mean = self.x(spread.mean);
        self.add(format_args!(
            "<circle cx=\"{mean:.1}\" cy=\"{y:.1}\" r=\"3.6\" fill=\"white\" stroke=\"{colour}\" stroke-width=\"1.8\"/>"
        ));
    }

    fn interval(&mut self, row: f64, ends: [f64; 3], ink: Ink) {
        let y = self.y(row);
        let [low, value, high] = ends.map(|v| self.x(v));
        let colour = ink.colour();
        self.add(format_args!(
            "<path d=\"M{low:.1} {y:.1}H{high:.1}M{low:.1} {:.1}v8M{high:.1} {:.1}v8\" stroke=\"{colour}\" stroke-width=\"1.8\"/>\n<circle cx=\"{value:.1}\" cy=\"{y:.1}\" r=\"4.2\" fill=\"{colour}\"/>",
            y - 4.0,
            y - 4.0
        ));
    }

    /// A limit beyond the axis is left out: at its end it would say something else.
    fn limit(&mut self, at: f64, name: &str) {
        let [low, high] = self.panel.x.range;
        if !(low..=high).contains(&at) {
            return;
        }
        let Rect { min, max } = self.frame;
        let (x, faint) = (self.x(at), hex(FAINT));
        self.add(format_args!(
            "<path d=\"M{x:.1} {:.1}V{:.1}\" stroke=\"{faint}\" stroke-dasharray=\"5 4\"/>",
            min[1], max[1]
        ));
        // Beside the line, on the side that has room.
        let (aside, anchor) = if x > (min[0] + max[0]) / 2.0 {
            (-5.0, "end")
        } else {
            (5.0, "start")
        };
        let style = format!("font-size=\"11\" text-anchor=\"{anchor}\" fill=\"{faint}\"");
        write_text(self.out, [x + aside, min[1] + 13.0], name, &style);
    }
}

/// Path data of a line, without the points in the middle of its level stretches.
fn path_data(points: &[Px]) -> String {
    let mut data = String::new();
    for (k, [x, y]) in points.iter().enumerate() {
        let level = |other: Option<&Px>| other.is_some_and(|p| (p[1] - y).abs() < 0.05);
        if k > 0 && level(points.get(k - 1)) && level(points.get(k + 1)) {
            continue;
        }
        let _ = write!(data, "{}{x:.1} {y:.1}", if k == 0 { 'M' } else { 'L' });
    }
    data
}
