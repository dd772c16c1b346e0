//! Networks run without allocating once their buffers are there: counted by an allocator of its own.

mod counting;

use std::sync::atomic::Ordering;

use counting::COUNT;
use nngtl::bench::inference::SampleMission;
use nngtl::nn::cpu::Session;
use nngtl::nn::embedded;
use nngtl::nn::models::Model;
use nngtl::nn::weights::WeightFile;
use serde_json::json;

fn models() -> Vec<Model> {
    let built_in = embedded().into_iter().flatten();
    let mut files: Vec<WeightFile<'_>> = built_in
        .map(|bytes| WeightFile::parse("built-in", bytes).unwrap())
        .collect();
    let paper = [
        json!({"kind": "pathnet", "variant": "paper", "format": 1, "encoding": 1, "labels": 7, "resolution": 64,
            "n1": 2, "graph": [8, 8, 8], "fusion": "dense", "skip": "third"}),
        json!({"kind": "statenet", "variant": "paper", "format": 1, "encoding": 1, "labels": 7, "resolution": 64,
            "trunk": "bottleneck", "trunk_widths": [4, 4], "trunk_blocks": [2, 1], "map_feature": 8,
            "first": 8, "graph": [8, 8]}),
    ];
    files.extend(paper.map(|config| WeightFile::random(config, 1).unwrap()));
    files.iter().map(|file| Model::new(file).unwrap()).collect()
}

// One test alone: others beside it would be counted too.
#[test]
fn runs_after_the_first_allocate_nothing() {
    let mission = SampleMission::default();
    for model in models() {
        let raster = mission.raster(model.program.resolution);
        let inputs = mission.inputs(&raster);
        let mut session = Session::new(1);
        let first = session.run(&model.program, &inputs).to_vec();
        let before = COUNT.load(Ordering::Relaxed);
        for _ in 0..3 {
            let same = session.run(&model.program, &inputs) == first;
            assert!(same);
        }
        let counted = COUNT.load(Ordering::Relaxed) - before;
        assert_eq!(counted, 0, "{:?}", model.config.kind());
    }
}
