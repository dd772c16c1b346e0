//! Map rasters against those of the training code (`training/nngtl_training/goldens.py`).

mod common;

use nalgebra::Point2;
use nngtl::encoding::{MapInput, MapTensor};
use serde::Deserialize;

#[derive(Deserialize)]
struct Golden {
    resolution: usize,
    bounds: [[f64; 2]; 2],
    obstacles: Vec<Vec<[f64; 2]>>,
    regions: Vec<Vec<[f64; 2]>>,
    start: [f64; 2],
    start_cell: [usize; 2],
    /// For each channel runs `[i, j, n]`: the cells (i, j) to (i, j + n − 1).
    channels: Vec<Vec<[usize; 3]>>,
}

fn point([x, y]: [f64; 2]) -> Point2<f64> {
    Point2::new(x, y)
}

fn outlines(polygons: &[Vec<[f64; 2]>]) -> Vec<Vec<Point2<f64>>> {
    let outline = |polygon: &Vec<[f64; 2]>| polygon.iter().copied().map(point).collect();
    polygons.iter().map(outline).collect()
}

#[test]
fn every_raster_agrees_with_training() {
    let text = std::fs::read_to_string(common::goldens().join("rasters.json")).unwrap();
    let goldens: Vec<Golden> = serde_json::from_str(&text).unwrap();
    assert!(goldens.len() >= 6);
    for (number, golden) in goldens.iter().enumerate() {
        let side = golden.resolution;
        let (obstacles, regions) = (outlines(&golden.obstacles), outlines(&golden.regions));
        let map = MapInput {
            bounds: golden.bounds.map(point),
            obstacles: obstacles.iter().map(Vec::as_slice).collect(),
            regions: regions.iter().map(Vec::as_slice).collect(),
            start: point(golden.start),
            ways: Vec::new(),
        };
        let tensor = MapTensor::new(&map, side);
        let mut expected = vec![0.0; golden.channels.len() * side * side];
        for (channel, runs) in golden.channels.iter().enumerate() {
            for &[i, j, n] in runs {
                expected[(channel * side + i) * side + j..][..n].fill(1.0);
            }
        }
        let [i, j] = golden.start_cell;
        expected[i * side + j] = -1.0;
        let wrong: Vec<_> = (0..expected.len())
            .filter(|&k| expected[k] != tensor.values[k])
            .map(|k| (k / side / side, k / side % side, k % side))
            .collect();
        assert!(wrong.is_empty(), "map {number}: (channel, i, j) {wrong:?}");
    }
}
