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
