use super::*;
use crate::automaton::StateId;
use crate::plan::Waypoint;
use crate::workspace::{Bounds, Polygon, Region};

fn square(x: f64, y: f64, side: f64) -> Polygon {
    Polygon::rectangle(Point2::new(x, y), Point2::new(x + side, y + side)).unwrap()
}

fn map() -> Workspace {
    let bounds = Bounds {
        min: Point2::new(-1.0, 0.0),
        max: Point2::new(1.0, 1.0),
    };
    let region = |name: &str, x| Region {
        name: name.into(),
        polygon: square(x, 0.7, 0.2),
    };
    let obstacles = vec![square(-0.2, 0.3, 0.3)];
    Workspace::new(
        bounds,
        obstacles,
        vec![region("left", -0.8), region("right", 0.5)],
    )
    .unwrap()
}

fn path() -> Path {
    let w = |x: f64, y| Waypoint {
        at: Point2::new(x, y),
        state: StateId(0),
    };
    Path {
        prefix: vec![w(-0.5, 0.2), w(-0.7, 0.8)],
        suffix: vec![w(-0.7, 0.8), w(0.6, 0.85), w(-0.7, 0.8)],
    }
}

fn heatmap() -> Heatmap {
    let side = 20;
    let value = |n: usize| (n / side) as f32 * (n % side) as f32 / 361.0;
    Heatmap {
        side,
        values: (0..side * side).map(value).collect(),
    }
}

#[test]
fn an_svg_is_well_formed_and_names_every_region() {
    let (map, path, heatmap) = (map(), path(), heatmap());
    let svg = Picture::new(&map)
        .start(Point2::new(-0.5, 0.2))
        .heatmap(&heatmap)
        .tree([(Point2::new(0.0, 0.0), Point2::new(0.5, 0.5))])
        .path(&path)
        .title("a <b> & \"c\" \u{1}")
        .subtitle("[]<> left && <> right")
        .to_svg();
    let tree = resvg::usvg::Tree::from_str(&svg, &resvg::usvg::Options::default()).unwrap();
    assert!(tree.size().width() > 800.0 && tree.size().height() > 400.0);
    for part in [
        ">left</text>",
        ">right</text>",
        "data:image/png;base64,",
        "&lt;b&gt; &amp;",
    ] {
        assert!(svg.contains(part), "{part} is missing");
    }
}

#[test]
fn a_png_shows_heatmap_regions_and_text() {
    let (map, path, heatmap) = (map(), path(), heatmap());
    let plain = Picture::new(&map).path(&path);
    let pixels = |picture: &Picture<'_>| {
        let png = picture.to_png(1.0).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(png))
            .read_info()
            .unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        assert_eq!(info.color_type, png::ColorType::Rgb);
        bytes
    };
    let (a, b) = (pixels(&plain), pixels(&plain.clone().heatmap(&heatmap)));
    let different = |a: &[u8], b: &[u8]| a.iter().zip(b).filter(|(a, b)| a != b).count();
    assert!(
        different(&a, &b) > 100_000,
        "the heatmap covers most of the map"
    );
    // The names are drawn as glyphs: without a font, these two would be the same.
    let titled = pixels(&plain.clone().title("one"));
    let other = pixels(&plain.clone().title("two"));
    assert!(different(&titled, &other) > 50, "glyphs are missing");
}

#[test]
fn a_plan_that_stays_is_marked_by_a_ring() {
    let map = map();
    let mut path = path();
    assert!(
        !Picture::new(&map)
            .path(&path)
            .to_svg()
            .contains("stays here")
    );
    path.suffix.truncate(1);
    assert!(
        Picture::new(&map)
            .path(&path)
            .to_svg()
            .contains("stays here")
    );
}

#[test]
fn scales_out_of_range_are_refused() {
    let map = map();
    for scale in [0.0, f64::NAN, 100.0] {
        assert!(matches!(
            Picture::new(&map).to_png(scale),
            Err(RenderError::Scale(_))
        ));
    }
}

/// The left ends of all texts that end at their place, and what they say.
fn numbers_beside(svg: &str) -> Vec<(f64, String)> {
    let texts = svg
        .lines()
        .filter(|line| line.contains("text-anchor=\"end\""));
    let part = |line: &str, from: &str, to: &str| {
        let rest = line.split(from).nth(1).unwrap().to_owned();
        rest.split(to).next().unwrap().to_owned()
    };
    let ends = texts.map(|line| {
        let text = part(line, "\">", "<");
        let x: f64 = part(line, "x=\"", "\"").parse().unwrap();
        (x - 12.0 * text::text_width(&text), text)
    });
    ends.collect()
}

#[test]
fn long_numbers_beside_the_map_are_not_cut() {
    let bounds = Bounds {
        min: Point2::new(0.0, 5_300_000.0),
        max: Point2::new(100.0, 5_300_060.0),
    };
    let map = Workspace::new(bounds, vec![], vec![]).unwrap();
    let numbers = numbers_beside(&Picture::new(&map).to_svg());
    assert!(
        numbers.iter().any(|n| n.1.contains("5300020")),
        "{numbers:?}"
    );
    assert!(numbers.iter().all(|n| n.0 > 0.0), "{numbers:?}");
}

/// Thirty regions with long names, close together: the names get smaller, and in the end shorter, not unreadable.
#[test]
fn long_names_keep_clear_of_each_other() {
    let regions = (0..30).map(|i| Region {
        name: format!("storage_of_spare_parts_{i}"),
        polygon: square(
            f64::from(i % 5) * 0.2 + 0.02,
            f64::from(i / 5) * 0.16 + 0.02,
            0.05,
        ),
    });
    let map = Workspace::new(Bounds::unit(), vec![], regions.collect()).unwrap();
    let svg = Picture::new(&map).to_svg();
    let boxes: Vec<[f64; 4]> = svg
        .lines()
        .filter(|line| line.contains("paint-order"))
        .map(|line| {
            let part = |from: &str| line.split(from).nth(1).unwrap().split('"').next().unwrap();
            let number = |from: &str| part(from).parse::<f64>().unwrap();
            let text = line.split("\">").nth(1).unwrap().split('<').next().unwrap();
            let (x, y, size) = (number("x=\""), number("y=\""), number("font-size=\""));
            let half = size * text::text_width(text) / 2.0;
            [x - half, x + half, y - size * 0.7, y + size * 0.1]
        })
        .collect();
    assert_eq!(boxes.len(), 30);
    for (i, a) in boxes.iter().enumerate() {
        for b in &boxes[..i] {
            let apart = a[1] <= b[0] || b[1] <= a[0] || a[3] <= b[2] || b[3] <= a[2];
            assert!(apart, "{a:?} {b:?}");
        }
    }
}
