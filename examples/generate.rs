//! Temporary until `nngtl dataset generate`: OUT SEED MISSIONS [THREADS].
use std::sync::atomic::AtomicBool;
use nngtl::dataset::{GenerateConfig, generate};
fn main() {
    env_logger::init();
    let a: Vec<String> = std::env::args().collect();
    let mut config = GenerateConfig::new(&a[1], a[2].parse().unwrap(), a[3].parse().unwrap());
    config.threads = a.get(4).map_or(0, |t| t.parse().unwrap());
    let t = std::time::Instant::now();
    let out = generate(&config, &|p| {
        if p.maps % 10 == 0 { eprintln!("{} of {} maps, {} missions, {:.1} s", p.maps, p.of, p.missions, t.elapsed().as_secs_f64()); }
    }, &AtomicBool::new(false)).unwrap();
    let m = out.manifest();
    eprintln!("{} missions in {:.1} s; {:?} {:?} {:?}", m.missions, t.elapsed().as_secs_f64(), m.filtered, m.families, m.patterns);
}
