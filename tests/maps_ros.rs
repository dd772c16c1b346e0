//! Occupancy maps of ROS: what pixels mean, and where they lie.

use std::f64::consts::FRAC_PI_4;
use std::path::Path;

use nalgebra::Point2;
use nngtl::maps::{self, Format, ImportedMap, MapOptions};
use nngtl::workspace::{Place, Workspace};

const YAML: &str = "image: 'a.pgm'  # beside this file\nresolution: 0.5\norigin: [1.0, -2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";

fn read(yaml: &str, picture: &[u8]) -> ImportedMap {
    let options = MapOptions {
        tolerance: Some(0.0),
        ..MapOptions::default()
    };
    let mut open = |name: &str| {
        assert_eq!(name, "a.pgm");
        Ok(picture.to_vec())
    };
    maps::read(
        Path::new("m.yaml"),
        Format::Ros,
        yaml.as_bytes(),
        &options,
        &mut open,
    )
    .unwrap_or_else(|e| panic!("{e}"))
}

fn png(color: png::ColorType, depth: png::BitDepth, size: [u32; 2], data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
    encoder.set_color(color);
    encoder.set_depth(depth);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(data).unwrap();
    writer.finish().unwrap();
    bytes
}

#[test]
fn thresholds_decide_and_205_is_the_trap() {
    let picture = b"P5\n4 1\n255\n\xfe\x00\xcd\xfe";
    assert_eq!(read(YAML, picture).cells, Some([2, 1, 1]), "205 is unknown");
    let newer = YAML.replace("0.196", "0.25");
    assert_eq!(read(&newer, picture).cells, Some([3, 1, 0]), "205 is free");
    let negated = YAML.replace("negate: 0", "negate: true");
    assert_eq!(read(&negated, picture).cells, Some([1, 3, 0]));
    let raw = format!("{YAML}mode: raw\n");
    // Raw values are percents; what is above 100 is unknown.
    assert_eq!(
        read(&raw, b"P5 4 1 255 \x00\x64\x32\xff").cells,
        Some([1, 1, 2])
    );
}

#[test]
fn every_kind_of_picture_says_the_same() {
    let cells = read(YAML, b"P5 3 2 255\n\xfe\x00\xcd\x00\xfe\xfe").cells;
    assert_eq!(cells, Some([3, 2, 1]));
    let text = b"P2 # written by hand\n3 2\n# next line\n255\n254 0 205\n0 254 254 and more";
    let wide: Vec<u8> = [254_u16, 0, 205, 0, 254, 254]
        .iter()
        .flat_map(|v| (v * 257).to_be_bytes())
        .collect();
    let deep = [b"P5 3 2 65535\n".as_slice(), &wide].concat();
    let grey = [254, 0, 205, 0, 254, 254];
    let rgb: Vec<u8> = grey.iter().flat_map(|&v| [v; 3]).collect();
    let alpha: Vec<u8> = grey.iter().flat_map(|&v| [v, 255]).collect();
    use png::{BitDepth, ColorType};
    let pictures = [
        text.to_vec(),
        deep,
        png(ColorType::Grayscale, BitDepth::Eight, [3, 2], &grey),
        png(ColorType::Grayscale, BitDepth::Sixteen, [3, 2], &wide),
        png(ColorType::Rgb, BitDepth::Eight, [3, 2], &rgb),
    ];
    for (i, picture) in pictures.iter().enumerate() {
        assert_eq!(read(YAML, picture).cells, cells, "picture {i}");
    }
    // Opacity is averaged in as one more channel: 205 becomes free, 0 becomes unknown.
    let picture = png(ColorType::GrayscaleAlpha, BitDepth::Eight, [3, 2], &alpha);
    assert_eq!(read(YAML, &picture).cells, Some([4, 0, 2]));
    // In scale mode it is not, but nothing is known where it is missing.
    let scale = format!("{YAML}mode: scale\n");
    assert_eq!(read(&scale, &picture).cells, cells);
    let clear: Vec<u8> = grey.iter().flat_map(|&v| [v, 254]).collect();
    let picture = png(ColorType::GrayscaleAlpha, BitDepth::Eight, [3, 2], &clear);
    assert_eq!(read(&scale, &picture).cells, Some([0, 0, 6]));
    // Two colours in one bit.
    let bits = png(
        ColorType::Grayscale,
        BitDepth::One,
        [3, 2],
        &[0b1010_0000, 0b0110_0000],
    );
    assert_eq!(read(YAML, &bits).cells, Some([4, 2, 0]));
}

#[test]
fn the_first_row_is_the_top_and_the_origin_the_lower_left() {
    // The upper left cell is occupied.
    let map = read(YAML, b"P5 3 2 255\n\x00\xfe\xfe\xfe\xfe\xfe");
    let (min, max) = (map.bounds.min, map.bounds.max);
    assert_eq!((min, max), (Point2::new(1.0, -2.0), Point2::new(2.5, -1.0)));
    assert_eq!(map.obstacles.len(), 1);
    let [low, high] = [map.obstacles[0].min(), map.obstacles[0].max()];
    assert_eq!(
        (low, high),
        (Point2::new(1.0, -1.5), Point2::new(1.5, -1.0))
    );
}

/// A rotated map: cells lie where the rotation puts them, and what is outside the picture but inside
/// its bounding box cannot be entered.
#[test]
fn a_yaw_turns_the_map() {
    let yaml = YAML.replace("-2.0, 0.0]", &format!("-2.0, {FRAC_PI_4}]"));
    let map = read(
        &yaml,
        b"P5 4 4 255\n\xfe\xfe\xfe\xfe\xfe\x00\xfe\xfe\xfe\xfe\xfe\xfe\xfe\xfe\xfe\xfe",
    );
    let edge = map
        .obstacle_names
        .iter()
        .filter(|n| *n == "the edge of the map");
    assert!(edge.count() >= 2, "{:?}", map.obstacle_names);
    let map = Workspace::new(map.bounds, map.obstacles, Vec::new()).unwrap();
    let (sin, cos) = FRAC_PI_4.sin_cos();
    let centre = |i: f64, j: f64| {
        let (x, y) = ((i + 0.5) * 0.5, (j + 0.5) * 0.5);
        Point2::new(1.0 + cos * x - sin * y, -2.0 + sin * x + cos * y)
    };
    for i in -2..6_i32 {
        for j in -2..6_i32 {
            let inside = (0..4).contains(&i) && (0..4).contains(&j);
            let free = matches!(map.locate(centre(i.into(), j.into())), Place::Free { .. });
            assert_eq!(free, inside && (i, j) != (1, 2), "cell ({i}, {j})");
        }
    }
    let half = 2.0 * std::f64::consts::FRAC_1_SQRT_2;
    assert!((map.bounds().min.x - (1.0 - half)).abs() < 1e-12);
}
