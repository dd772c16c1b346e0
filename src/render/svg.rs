//! The drawing itself, as SVG text.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use nalgebra::Point2;

use super::Picture;
use super::colour::{self, BAND, FAINT, HATCH, INK, OBSTACLE, PREFIX, Rgb, SUFFIX, hex};
use super::labels::{Board, Px, Rect};
use super::legend::{self, Sign};
use super::raster;
use super::shapes::{arrow_places, nice_step, number, once, polyline, side_by_side, ticks};
use super::text::{self, escaped, text_width, write_text};
use crate::alphabet::Letter;
use crate::plan::{Path, Waypoint, length};
use crate::workspace::{Bounds, Polygon};

/// The family of the embedded font.
pub(super) const FONT: &str = "DejaVu Sans";

/// Length of the map's longer side, in pixels.
const MAP_PIXELS: f64 = 820.0;
/// Room for the numbers on the left, at least, and for nothing on the right.
const LEFT: f64 = 58.0;
const RIGHT: f64 = 26.0;
/// The size of the numbers beside the map, and what is between them and it.
const NUMBER: f64 = 12.0;
const TICK: f64 = 9.0;
/// Sizes of the regions' names, and how long a name may get, in pixels, before it ends in dots: the first at which it has room of its
/// own is taken.
const NAMES: [[f64; 2]; 5] = [
    [16.0, 400.0],
    [13.5, 400.0],
    [11.5, 400.0],
    [10.0, 400.0],
    [10.0, 150.0],
];
/// The picture is at least this wide, so that headings fit beside a narrow map.
const MIN_WIDTH: f64 = 560.0;
/// Which layers are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layers {
    /// Everything.
    All,
    /// Neither background nor heatmap, which are drawn as pixels below this.
    WithoutHeatmap,
}

/// A finished drawing, and where in it the map lies.
pub(super) struct Drawing {
    pub(super) text: String,
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) map_frame: Rect,
    /// The square that the heatmap's cells divide; it may reach beyond the map.
    pub(super) heatmap_frame: Rect,
}

/// From map units to pixels.
struct Scale {
    origin: Px,
    min: Point2<f64>,
    factor: f64,
}

impl Scale {
    fn px(&self, p: Point2<f64>) -> Px {
        [
            self.origin[0] + (p.x - self.min.x) * self.factor,
            self.origin[1] - (p.y - self.min.y) * self.factor,
        ]
    }

    fn ring(&self, polygon: &Polygon) -> Vec<Px> {
        polygon.vertices().iter().map(|&v| self.px(v)).collect()
    }
}

pub(super) fn draw(picture: &Picture<'_>, layers: Layers) -> Drawing {
    let bounds = picture.workspace.bounds();
    let factor = MAP_PIXELS / bounds.side();
    let (map_width, map_height) = (bounds.width() * factor, bounds.height() * factor);
    let left = room_for_numbers(bounds);
    let width = (left + map_width + RIGHT).max(MIN_WIDTH);
    let heading = text::heading(
        picture.title.as_deref(),
        picture.subtitle.as_deref(),
        left,
        width - left - RIGHT,
    );
    let top = 18.0 + heading.height;
    let scale = Scale {
        origin: [left, top + map_height],
        min: bounds.min,
        factor,
    };
    let map_frame = Rect {
        min: [left, top],
        max: [left + map_width, top + map_height],
    };
    let heatmap_frame = Rect {
        min: [left, top + map_height - MAP_PIXELS],
        max: [left + MAP_PIXELS, top + map_height],
    };
    let legend = legend::draw(
        &signs(picture),
        [left, map_frame.max[1] + 40.0],
        width - left - RIGHT,
    );
    let height = map_frame.max[1] + 40.0 + legend.height + 14.0;

    let mut canvas = Canvas {
        text: String::new(),
        picture,
        scale,
        frame: map_frame,
    };
    canvas.open(width, height);
    if layers == Layers::All {
        canvas.background(width, height, heatmap_frame);
    }
    canvas.text.push_str(&heading.text);
    canvas.map();
    canvas.axes();
    let mut board = canvas.board();
    canvas.tree();
    canvas.bands();
    canvas.plan(&mut board);
    canvas.start(&mut board);
    canvas.region_names(&mut board);
    canvas.text.push_str(&legend.text);
    canvas.text.push_str("</svg>\n");
    Drawing {
        text: canvas.text,
        width,
        height,
        map_frame,
        heatmap_frame,
    }
}

/// How wide the numbers on the left are, with what is beside them.
fn room_for_numbers(bounds: Bounds) -> f64 {
    let step = nice_step(bounds.side() / 5.0);
    let numbers = ticks(bounds.min.y, bounds.max.y, step);
    let widths = numbers.map(|value| NUMBER * text_width(&number(value, step)));
    widths.fold(LEFT, |left, width| left.max(width + TICK + 8.0))
}

/// What the legend explains: what is in the picture, and nothing else.
fn signs(picture: &Picture<'_>) -> Vec<Sign> {
    let mut signs = Vec::new();
    if picture.start.is_some() {
        signs.push(Sign::Start);
    }
    if let Some(path) = picture.path {
        signs.push(Sign::Prefix(length(&path.prefix)));
        signs.push(if stays(path) {
            Sign::Stays
        } else {
            Sign::Suffix(length(&path.suffix))
        });
    }
    if !picture.workspace.regions().is_empty() {
        signs.push(Sign::Region);
    }
    if !picture.workspace.obstacles().is_empty() {
        signs.push(Sign::Obstacle);
    }
    if !picture.tree.is_empty() {
        signs.push(Sign::Tree(picture.tree.len()));
    }
    if !picture.bands.is_empty() {
        signs.push(Sign::Band(picture.bands_meaning));
    }
    if let Some(heatmap) = picture.heatmap {
        let peak = heatmap.values.iter().copied().fold(0.0_f32, f32::max);
        signs.push(Sign::Heatmap(peak));
    }
    signs
}

/// Whether the robot stays where the prefix ends.
fn stays(path: &Path) -> bool {
    path.suffix.windows(2).all(|w| w[0].at == w[1].at)
}

struct Canvas<'a, 'b> {
    text: String,
    picture: &'b Picture<'a>,
    scale: Scale,
    frame: Rect,
}

impl Canvas<'_, '_> {
    fn add(&mut self, element: std::fmt::Arguments<'_>) {
        let _ = self.text.write_fmt(element);
        self.text.push('\n');
    }

    fn open(&mut self, width: f64, height: f64) {
        let Rect { min, max } = self.frame;
        let (ink, hatch, ground) = (hex(INK), hex(HATCH), hex(OBSTACLE));
        self.add(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
             viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"{FONT}, Verdana, sans-serif\" fill=\"{ink}\">"
        ));
        if let Some(title) = &self.picture.title {
            let title = escaped(title);
            self.add(format_args!("<title>{title}</title>"));
        }
        self.add(format_args!(
            "<defs>\
             <clipPath id=\"map\"><rect x=\"{:.2}\" y=\"{:.2}\" width=\"{:.2}\" height=\"{:.2}\"/></clipPath>\
             <pattern id=\"hatch\" width=\"8\" height=\"8\" patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(45)\">\
             <rect width=\"8\" height=\"8\" fill=\"{ground}\"/><rect width=\"1.6\" height=\"8\" fill=\"{hatch}\"/></pattern>\
             </defs>",
            min[0],
            min[1],
            max[0] - min[0],
            max[1] - min[1],
        ));
    }

    fn background(&mut self, width: f64, height: f64, square: Rect) {
        self.add(format_args!(
            "<rect width=\"{width:.0}\" height=\"{height:.0}\" fill=\"#ffffff\"/>"
        ));
        let uri = self.picture.heatmap.and_then(raster::heatmap_data_uri);
        if let Some(uri) = uri {
            self.add(format_args!(
                "<g clip-path=\"url(#map)\"><image x=\"{:.2}\" y=\"{:.2}\" width=\"{:.2}\" height=\"{:.2}\" href=\"{uri}\"/></g>",
                square.min[0],
                square.min[1],
                square.max[0] - square.min[0],
                square.max[1] - square.min[1],
            ));
        }
    }

    fn map(&mut self) {
        let workspace = self.picture.workspace;
        let opacity = if self.picture.heatmap.is_some() {
            0.4
        } else {
            0.8
        };
        self.add(format_args!("<g clip-path=\"url(#map)\">"));
        for (i, region) in workspace.regions().iter().enumerate() {
            let ring = polyline(&self.scale.ring(&region.polygon));
            let (fill, border) = (colour::region_fill(i), colour::region_border(i));
            self.add(format_args!(
                "<path d=\"{ring}Z\" fill=\"{}\" fill-opacity=\"{opacity}\" stroke=\"{}\" stroke-width=\"1.4\"/>",
                hex(fill),
                hex(border)
            ));
        }
        for obstacle in workspace.obstacles() {
            let ring = polyline(&self.scale.ring(obstacle));
            self.add(format_args!(
                "<path d=\"{ring}Z\" fill=\"url(#hatch)\" stroke=\"{}\" stroke-width=\"1.2\"/>",
                hex(FAINT)
            ));
        }
        self.add(format_args!("</g>"));
    }

    fn axes(&mut self) {
        let Rect { min, max } = self.frame;
        let faint = hex(FAINT);
        self.add(format_args!(
            "<rect x=\"{:.2}\" y=\"{:.2}\" width=\"{:.2}\" height=\"{:.2}\" fill=\"none\" stroke=\"{faint}\" stroke-width=\"1.4\"/>",
            min[0],
            min[1],
            max[0] - min[0],
            max[1] - min[1]
        ));
        let bounds = self.picture.workspace.bounds();
        let step = nice_step(bounds.side() / 5.0);
        for value in ticks(bounds.min.x, bounds.max.x, step) {
            let x = self.scale.px(Point2::new(value, bounds.min.y))[0];
            let y = max[1];
            self.add(format_args!(
                "<path d=\"M{x:.2} {y:.2}v5\" stroke=\"{faint}\"/>"
            ));
            let style = format!("font-size=\"{NUMBER}\" fill=\"{faint}\" text-anchor=\"middle\"");
            write_text(&mut self.text, [x, y + 18.0], &number(value, step), &style);
        }
        for value in ticks(bounds.min.y, bounds.max.y, step) {
            let y = self.scale.px(Point2::new(bounds.min.x, value))[1];
            let x = min[0];
            self.add(format_args!(
                "<path d=\"M{x:.2} {y:.2}h-5\" stroke=\"{faint}\"/>"
            ));
            let style = format!("font-size=\"{NUMBER}\" fill=\"{faint}\" text-anchor=\"end\"");
            write_text(
                &mut self.text,
                [x - TICK, y + 4.2],
                &number(value, step),
                &style,
            );
        }
    }

    /// What labels must keep clear of.
    fn board(&self) -> Board {
        let mut lines = Vec::new();
        if let Some(path) = self.picture.path {
            for part in [&path.prefix, &path.suffix] {
                let points = self.points(part);
                lines.extend(points.windows(2).map(|w| (w[0], w[1])));
            }
        }
        Board {
            frame: self.frame,
            lines,
            boxes: Vec::new(),
            walls: self
                .picture
                .workspace
                .obstacles()
                .iter()
                .map(|o| self.scale.ring(o))
                .collect(),
        }
    }

    fn points(&self, part: &[Waypoint]) -> Vec<Px> {
        part.iter().map(|w| self.scale.px(w.at)).collect()
    }

    fn tree(&mut self) {
        // Product states that share a place share edges, too: each line once, to the tenth of
        // a pixel.
        let tenths = |p: Point2<f64>| self.scale.px(p).map(|x| (x * 10.0).round() as i64);
        let lines: BTreeSet<[[i64; 2]; 2]> = self
            .picture
            .tree
            .iter()
            .map(|&(a, b)| [tenths(a).min(tenths(b)), tenths(a).max(tenths(b))])
            .collect();
        if lines.is_empty() {
            return;
        }
        let mut data = String::new();
        for [[ax, ay], [bx, by]] in &lines {
            let [ax, ay, bx, by] = [ax, ay, bx, by].map(|&x| x as f64 / 10.0);
            let _ = write!(data, "M{ax} {ay}L{bx} {by}");
        }
        // The more there are, the thinner they get: a large tree must not become one grey area.
        let width = (0.9 * (1500.0 / lines.len() as f64).sqrt()).clamp(0.16, 0.9);
        self.add(format_args!(
            "<path d=\"{data}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width:.2}\" stroke-opacity=\"0.5\"/>",
            hex(FAINT)
        ));
    }

    fn bands(&mut self) {
        let tenths = |p: Point2<f64>| self.scale.px(p).map(|x| (x * 10.0).round() as i64);
        let lines: BTreeSet<[[i64; 2]; 2]> = self
            .picture
            .bands
            .iter()
            .map(|&(a, b)| [tenths(a).min(tenths(b)), tenths(a).max(tenths(b))])
            .collect();
        let mut data = String::new();
        for [a, b] in &lines {
            let [ax, ay, bx, by] = [a[0], a[1], b[0], b[1]].map(|x| x as f64 / 10.0);
            let _ = write!(data, "M{ax} {ay}L{bx} {by}");
        }
        if !data.is_empty() {
            self.add(format_args!(
                "<path d=\"{data}\" fill=\"none\" stroke=\"{}\" stroke-width=\"12\" stroke-opacity=\"0.35\" stroke-linecap=\"round\"/>",
                hex(BAND)
            ));
        }
    }

    fn plan(&mut self, board: &mut Board) {
        let Some(path) = self.picture.path else {
            return;
        };
        let (prefix, suffix) = (self.points(&path.prefix), self.points(&path.suffix));
        // Both halos first: a suffix that runs along the prefix must not hide it.
        for line in [&prefix, &suffix] {
            self.stroke(
                &polyline(line),
                [255, 255, 255],
                "stroke-width=\"7\" stroke-opacity=\"0.85\"",
            );
        }
        self.stroke(&polyline(&prefix), PREFIX, "stroke-width=\"3\"");
        self.stroke(
            &once(&suffix),
            SUFFIX,
            "stroke-width=\"3\" stroke-dasharray=\"10 6\"",
        );
        let mut arrows = Vec::new();
        self.waypoints(&prefix, PREFIX);
        self.arrows(&prefix, PREFIX, &mut arrows);
        if stays(path) {
            let at = suffix[0];
            self.ring(at, board);
        } else {
            self.waypoints(&suffix, SUFFIX);
            self.arrows(&suffix, SUFFIX, &mut arrows);
        }
        self.visits(path, board);
    }

    /// Draws path data, if there are any.
    fn stroke(&mut self, data: &str, colour: Rgb, style: &str) {
        if !data.contains('L') {
            return;
        }
        self.add(format_args!(
            "<path d=\"{data}\" fill=\"none\" stroke=\"{}\" stroke-linejoin=\"round\" stroke-linecap=\"round\" {style}/>",
            hex(colour)
        ));
    }

    fn waypoints(&mut self, points: &[Px], colour: Rgb) {
        for [x, y] in points {
            self.add(format_args!(
                "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"2.6\" fill=\"#ffffff\" stroke=\"{}\" stroke-width=\"1.6\"/>",
                hex(colour)
            ));
        }
    }

    fn arrows(&mut self, points: &[Px], colour: Rgb, taken: &mut Vec<Px>) {
        for (at, direction) in arrow_places(points, taken) {
            let [x, y] = at;
            let degrees = direction.to_degrees();
            self.add(format_args!(
                "<path d=\"M8 0L-6 6L-3 0L-6 -6Z\" transform=\"translate({x:.2} {y:.2}) rotate({degrees:.1})\" \
                 fill=\"{}\" stroke=\"#ffffff\" stroke-width=\"1\"/>",
                hex(colour)
            ));
        }
    }

    fn ring(&mut self, at: Px, board: &mut Board) {
        let [x, y] = at;
        for (radius, width) in [(15.0, 3.0), (20.0, 1.4)] {
            self.add(format_args!(
                "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\"/>",
                hex(SUFFIX)
            ));
        }
        board.boxes.push(Rect::centred(at, 42.0, 42.0));
        self.label(board, at, 23.0, "stays here", SUFFIX);
    }

    /// Numbers the visits of regions, in the order in which they happen.
    fn visits(&mut self, path: &Path, board: &mut Board) {
        let closing = path.suffix.len() - 1;
        let prefix = path.prefix.iter().map(|w| (w, PREFIX));
        let suffix = path.suffix[1.min(closing)..closing]
            .iter()
            .map(|w| (w, SUFFIX));
        // Where the robot starts is no visit, even if it starts in a region.
        let props_at = |at: Point2<f64>| {
            let letter = self.picture.workspace.letter_at(at).unwrap_or(Letter(0));
            self.picture.workspace.alphabet().props(letter)
        };
        let mut before = props_at(path.prefix[0].at);
        let mut badges = Vec::new();
        for (w, colour) in prefix.chain(suffix) {
            let props = props_at(w.at);
            if props.0 & !before.0 != 0 {
                badges.push((self.scale.px(w.at), colour));
            }
            before = props;
        }
        let places: Vec<Px> = badges.iter().map(|b| b.0).collect();
        let places = side_by_side(&places, 20.0, &self.frame);
        for (i, (at, (_, colour))) in places.into_iter().zip(badges).enumerate() {
            let [x, y] = at;
            self.add(format_args!(
                "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"9.5\" fill=\"{}\" stroke=\"#ffffff\" stroke-width=\"1.5\"/>",
                hex(colour)
            ));
            let style =
                "font-size=\"12\" font-weight=\"bold\" fill=\"#ffffff\" text-anchor=\"middle\"";
            write_text(&mut self.text, [x, y + 4.3], &(i + 1).to_string(), style);
            board.boxes.push(Rect::centred(at, 20.0, 20.0));
        }
    }

    fn start(&mut self, board: &mut Board) {
        let Some(start) = self.picture.start else {
            return;
        };
        let [x, y] = self.scale.px(start);
        self.add(format_args!(
            "<path d=\"M{x:.2} {:.2}l8 8l-8 8l-8 -8Z\" fill=\"{}\" stroke=\"#ffffff\" stroke-width=\"1.6\"/>",
            y - 8.0,
            hex(INK)
        ));
        board.boxes.push(Rect::centred([x, y], 18.0, 18.0));
        self.label(board, [x, y], 14.0, "start", INK);
    }

    /// A short text beside a marker.
    fn label(&mut self, board: &mut Board, at: Px, radius: f64, text: &str, colour: Rgb) {
        let size = 14.0;
        let [x, y] = board.place_beside(at, radius, text_width(text) * size, size * 1.1);
        self.haloed([x, y], text, size, colour);
    }

    /// Text centred on a point, readable on any ground.
    fn haloed(&mut self, [x, y]: Px, text: &str, size: f64, colour: Rgb) {
        let style = format!(
            "font-size=\"{size}\" font-weight=\"bold\" text-anchor=\"middle\" fill=\"{}\" \
             stroke=\"#ffffff\" stroke-width=\"3.5\" stroke-linejoin=\"round\" paint-order=\"stroke\"",
            hex(colour)
        );
        write_text(&mut self.text, [x, y + size * 0.36], text, &style);
    }

    fn region_names(&mut self, board: &mut Board) {
        for (i, region) in self.picture.workspace.regions().iter().enumerate() {
            let ring = self.scale.ring(&region.polygon);
            let mut placed = None;
            for [size, longest] in NAMES {
                let name = text::fitted(&region.name, longest / size);
                let (width, height) = (text_width(&name) * size + 4.0, size * 1.15);
                let place = board.room_in(&ring, width, height);
                let free = !board.overlaps(&place);
                placed = Some((place, name, size));
                if free {
                    break;
                }
            }
            let Some((place, name, size)) = placed else {
                continue;
            };
            let at = board.take(place);
            self.haloed(at, &name, size, colour::region_border(i));
        }
    }
}
