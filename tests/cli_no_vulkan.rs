//! The program where Vulkan is missing, and where Mesa's software adapter is there.
//!
//! The first half hides drivers and loader from the program. The second needs an adapter: without
//! one it prints that it is skipped, with `NNGTL_REQUIRE_GPU_TESTS=1` it fails instead.
//! Linux alone: elsewhere adapters are reached by interfaces that cannot be hidden.
#![cfg(all(feature = "gpu", target_os = "linux"))]
#![allow(clippy::print_stdout)] // tells what was skipped

mod cli;

use std::fs;
use std::path::Path;
use std::process::Command;

use cli::{Run, command, finish, folder, shipped};
use nngtl::nn::MODEL_FILES;
use nngtl::plan::PlanFile;
use serde_json::Value;

/// Networks with random weights, in the order of [`MODEL_FILES`].
const NETWORKS: [&str; 2] = ["pathnet-paint-200", "statenet-lookup"];

/// What is hidden.
#[derive(Clone, Copy, Debug)]
enum Hidden {
    /// The drivers; the loader finds none.
    Drivers,
    /// The loader, and the drivers with it.
    Loader,
}

impl Hidden {
    const ALL: [Self; 2] = [Self::Drivers, Self::Loader];

    /// Hides it from a command that has not started yet.
    fn hide(self, command: &mut Command, folder: &Path) {
        let nowhere = folder.join("no-such-driver.json");
        command
            .env("VK_DRIVER_FILES", &nowhere)
            .env("VK_ICD_FILENAMES", &nowhere)
            .env_remove("VK_ADD_DRIVER_FILES");
        if matches!(self, Self::Loader) {
            // The dynamic linker takes the first file of this name and refuses it, being empty.
            for name in ["libvulkan.so.1", "libvulkan.so"] {
                fs::write(folder.join(name), b"").unwrap();
            }
            command.env("LD_LIBRARY_PATH", folder);
        }
    }
}

/// A folder that holds a model.
fn model() -> tempfile::TempDir {
    let folder = folder();
    let goldens = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/goldens/models");
    for (name, network) in MODEL_FILES.iter().zip(NETWORKS) {
        let from = goldens.join(format!("{network}.safetensors"));
        fs::copy(from, folder.path().join(name)).unwrap();
    }
    folder
}

/// The case study to its first plan, which waits for the networks of the model in `folder`; the plan goes there, too.
fn plan(folder: &Path, device: &str) -> Command {
    let mut command = command();
    command
        .args(["plan", &shipped("case-study.toml"), "--first"])
        .args(["--sampler", "guided", "--networks-first"])
        .args(["--device", device, "--model"])
        .arg(folder)
        .arg("--out")
        .arg(folder.join("plan.json"));
    command
}

fn written(folder: &Path) -> PlanFile {
    PlanFile::read(folder.join("plan.json")).unwrap()
}

/// What is said beside the files that were written.
fn said(run: &Run) -> Vec<&str> {
    let lines = run.err.lines();
    lines.filter(|l| !l.starts_with("nngtl: wrote ")).collect()
}

fn adapters(command: &mut Command) -> Vec<Value> {
    let run = finish(command.args(["devices", "--json"]));
    assert_eq!(run.code, 0, "{run:?}");
    run.json()["adapters"].as_array().unwrap().clone()
}

#[test]
fn without_vulkan_the_cpu_plans_and_one_line_says_so() {
    for hidden in Hidden::ALL {
        for device in ["auto", "gpu", "software"] {
            let model = model();
            let mut command = plan(model.path(), device);
            hidden.hide(&mut command, model.path());
            let run = finish(&mut command);
            let place = format!("{hidden:?}, {device}: {run:?}");
            assert_eq!(run.code, 0, "{place}");
            assert!(run.out.contains("planned and verified"), "{place}");
            assert!(run.out.contains("networks on cpu"), "{place}");
            assert_eq!(
                written(model.path()).device.as_deref(),
                Some("cpu"),
                "{place}"
            );
            match (device, &said(&run)[..]) {
                // Nobody asked for an adapter, so nobody misses one.
                ("auto", []) => {}
                ("gpu" | "software", [line]) => {
                    let wanted = format!("no {device} adapter was found");
                    assert!(line.contains(&wanted), "{place}");
                    assert!(line.contains("the CPU ran the networks"), "{place}");
                }
                _ => panic!("one line for a device that was asked for, else none: {place}"),
            }
        }
    }
}

/// Wherever networks are asked late, or for a library, a missing adapter is told as well, and once.
#[test]
fn without_vulkan_every_command_that_asks_networks_says_so_once() {
    let scenario = shipped("case-study.toml");
    let folder = folder();
    let file = |name: &str| folder.path().join(name).display().to_string();
    let (library, heatmap) = (file("skills.library"), file("heat.npy"));
    let (networks, first) = (model(), ["plan", &scenario, "--first", "--model"]);
    let model = networks.path().display().to_string();
    let loaded_and_not_asked = [&first[..], &[&model]].concat();
    let commands: [&[&str]; 4] = [
        &loaded_and_not_asked,
        &["plan", &scenario, "--iterations", "300", "--threads", "2"],
        &[
            "library",
            "build",
            &scenario,
            "--sampler",
            "guided",
            "--samples",
            "200",
            "--out",
            &library,
        ],
        &["heatmap", &scenario, "--out", &heatmap],
    ];
    for arguments in commands {
        let mut command = command();
        command.args(arguments).args(["--device", "gpu"]);
        Hidden::Drivers.hide(&mut command, folder.path());
        let run = finish(&mut command);
        assert_eq!(run.code, 0, "{arguments:?}: {run:?}");
        let lines = said(&run);
        let [line] = &lines[..] else {
            panic!("{arguments:?}: {run:?}");
        };
        assert!(line.contains("no gpu adapter was found"), "{run:?}");
    }
}

#[test]
fn without_vulkan_devices_lists_the_cpu() {
    for hidden in Hidden::ALL {
        let folder = folder();
        let mut listing = command();
        hidden.hide(&mut listing, folder.path());
        assert!(adapters(&mut listing).is_empty(), "{hidden:?}");
        let mut told = command();
        hidden.hide(&mut told, folder.path());
        let run = finish(told.arg("devices"));
        assert!(run.out.contains("the networks run on the cpu"), "{run:?}");
        assert!(run.err.is_empty(), "{hidden:?}: {run:?}");
    }
}

#[test]
fn an_adapter_plans_the_same_mission_through_its_kernels() {
    let found = adapters(&mut command());
    // A hardware GPU must do where the software adapter is not installed beside it.
    let software = found.iter().find(|a| a["kind"] == "software");
    let Some(adapter) = software.or(found.first()) else {
        let required = std::env::var("NNGTL_REQUIRE_GPU_TESTS").is_ok_and(|v| v == "1");
        assert!(
            !required,
            "NNGTL_REQUIRE_GPU_TESTS=1, and there is no adapter"
        );
        println!("skipped: an_adapter_plans_the_same_mission_through_its_kernels (no adapter)");
        return;
    };
    let wanted = if software.is_some() {
        "software"
    } else {
        "gpu"
    };
    let on_cpu = model();
    assert_eq!(finish(&mut plan(on_cpu.path(), "cpu")).code, 0);
    let on_adapter = model();
    let run = finish(&mut plan(on_adapter.path(), wanted));
    assert_eq!(run.code, 0, "{run:?}");
    let (cpu, other) = (written(on_cpu.path()), written(on_adapter.path()));
    assert_eq!(cpu.device.as_deref(), Some("cpu"));
    assert_eq!(other.device.as_deref(), adapter["name"].as_str(), "{run:?}");
    assert_eq!(cpu.model_hash, other.model_hash);
    let verified = finish(
        command()
            .arg("verify")
            .arg(shipped("case-study.toml"))
            .arg(on_adapter.path().join("plan.json")),
    );
    assert_eq!(verified.code, 0, "{verified:?}");
}
