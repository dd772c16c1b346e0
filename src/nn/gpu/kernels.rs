//! The shaders and how they are put together.

use sha2::{Digest as _, Sha256};

use crate::number::hex;

/// Prepended to every kernel.
const COMMON: &str = include_str!("../../../shaders/common.wgsl");

/// Appended to kernels that are products.
const TILE: &str = include_str!("../../../shaders/tile.wgsl");

/// Prepended to kernels that add up values of a whole workgroup: without and with subgroup
/// operations.
const REDUCE: [&str; 2] = [
    include_str!("../../../shaders/reduce.wgsl"),
    include_str!("../../../shaders/reduce_subgroups.wgsl"),
];

/// Picks the tile for a result of so many rows and columns.
pub type TileRule = fn(usize, usize) -> Tile;

/// The shape of a product's workgroup: 4·`rows` outputs by 4·`columns` cells a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Tile {
    /// Threads along the outputs.
    pub rows: u32,
    /// Threads along the cells.
    pub columns: u32,
}

impl Tile {
    /// What the shader's text has.
    const DEFAULT: Self = Self {
        rows: 8,
        columns: 8,
    };

    /// The tile for a result of `rows` × `columns` on a hardware GPU: narrow results get narrow
    /// tiles, large ones 256 threads.
    #[must_use]
    pub fn for_hardware(rows: usize, columns: usize) -> Self {
        let (rows, columns) = match (rows, columns) {
            (_, 0..=8) => (32, 2),
            (_, 9..=16) => (16, 4),
            (0..=8, _) => (2, 32),
            (9..=16, _) => (4, 16),
            (r, c) if r >= 64 && c >= 4096 => (16, 16),
            _ => return Self::DEFAULT,
        };
        Self { rows, columns }
    }

    /// The one tile for software adapters, where each pipeline takes tenths of a second to
    /// compile and the shape hardly matters.
    #[must_use]
    pub fn for_software(_rows: usize, _columns: usize) -> Self {
        Self::DEFAULT
    }
}

/// A kernel in one of its shapes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Kernel {
    /// The name: that of the shader's file and of the CPU's function.
    pub name: &'static str,
    /// The workgroup of a product.
    pub tile: Option<Tile>,
    /// Whether a product's weights are stored as 16-bit floats. That alone takes no feature: they
    /// are unpacked as they are read.
    pub half: bool,
    /// Whether a product is computed in 16-bit floats, with sums of sixteen products added up in
    /// 32 bits. Takes the feature `SHADER_F16`.
    pub narrow: bool,
    /// Whether sums over a workgroup take subgroup operations. Takes the feature `SUBGROUP`.
    pub subgroups: bool,
}

/// Lines of the products' text where they are computed in 32-bit floats, and what stands there
/// otherwise.
const NARROW: [(&str, &str); 2] = [
    ("alias Number = f32; // f32", "alias Number = f16;"),
    (
        "const NARROW: bool = false; // f32",
        "const NARROW: bool = true;",
    ),
];

/// Lines of the common text where weights are 32-bit floats, and what stands there otherwise.
const HALF: [(&str, &str); 2] = [
    ("array<vec4<f32>>; // f32", "array<vec2<u32>>;"),
    (
        "return weight[i]; // f32",
        "let w = weight[i]; return vec4<f32>(unpack2x16float(w.x), unpack2x16float(w.y));",
    ),
];

macro_rules! shaders {
    ($($name:literal),* $(,)?) => {
        /// All kernels: name and text.
        pub const SHADERS: &[(&str, &str)] = &[
            $(($name, include_str!(concat!("../../../shaders/", $name, ".wgsl")))),*
        ];
    };
}

shaders!(
    "broadcast",
    "conv2d",
    "conv_transpose2d",
    "copy_rows",
    "gat",
    "global_mean_pool",
    "linear",
    "max_pool2d",
    "mean_rows",
    "paint",
    "region_form",
    "region_mean",
    "sign_mean",
    "upsample",
);

impl Kernel {
    /// The kernel of this name; products get the default tile.
    #[must_use]
    pub fn new(name: &'static str) -> Self {
        let product = matches!(name, "conv2d" | "conv_transpose2d" | "linear");
        Self {
            name,
            tile: product.then_some(Tile::DEFAULT),
            half: false,
            narrow: false,
            subgroups: false,
        }
    }

    /// Whether it adds up values of a whole workgroup, so that subgroup operations serve it.
    #[must_use]
    pub fn reduces(&self) -> bool {
        matches!(self.name, "global_mean_pool" | "region_mean")
    }

    /// The whole text of the shader.
    ///
    /// # Panics
    /// If there is no shader of that name.
    #[must_use]
    pub fn source(&self) -> String {
        let found = SHADERS.iter().find(|(name, _)| *name == self.name);
        let (_, text) = found.expect("every operation has a shader");
        let mut common = COMMON.to_owned();
        if self.half {
            for (whole, half) in HALF {
                common = common.replace(whole, half);
            }
        }
        let Some(Tile { rows, columns }) = self.tile else {
            let reduce = if self.reduces() {
                REDUCE[usize::from(self.subgroups)]
            } else {
                ""
            };
            return format!("{common}{reduce}{text}");
        };
        let mut tile = TILE
            .replace("THREADS_M: u32 = 8u", &format!("THREADS_M: u32 = {rows}u"))
            .replace(
                "THREADS_N: u32 = 8u",
                &format!("THREADS_N: u32 = {columns}u"),
            );
        if !self.narrow {
            return format!("{common}{text}{tile}");
        }
        for (wide, narrow) in NARROW {
            tile = tile.replace(wide, narrow);
        }
        format!("enable f16;\n{common}{text}{tile}")
    }
}

/// A digest of all that shaders are made from: whether kernels that were compiled once are still
/// those that would be compiled today.
#[must_use]
pub fn digest() -> String {
    let mut digest = Sha256::new();
    let parts = [COMMON, TILE, REDUCE[0], REDUCE[1]];
    for text in parts.iter().chain(SHADERS.iter().map(|(_, text)| text)) {
        digest.update(text.as_bytes());
    }
    hex(&digest.finalize())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use wgpu::naga;

    use super::*;
    use crate::nn::gpu::params;

    /// Every kernel in every tile that a rule picks.
    fn all() -> Vec<Kernel> {
        let mut kernels = Vec::new();
        for &(name, _) in SHADERS {
            let kernel = Kernel::new(name);
            kernels.push(kernel);
            kernels.push(Kernel {
                subgroups: kernel.reduces(),
                ..kernel
            });
            if kernel.tile.is_some() {
                let sizes = [1, 8, 12, 40, 100, 5000];
                let pairs = sizes
                    .iter()
                    .flat_map(|&r| sizes.iter().map(move |&c| (r, c)));
                let tiles: Vec<Tile> = pairs.map(|(r, c)| Tile::for_hardware(r, c)).collect();
                kernels.extend(tiles.iter().flat_map(|&t| {
                    [(false, false), (false, true), (true, false), (true, true)].map(
                        |(half, narrow)| Kernel {
                            tile: Some(t),
                            half,
                            narrow,
                            ..kernel
                        },
                    )
                }));
            }
        }
        kernels.sort_unstable();
        kernels.dedup();
        kernels
    }

    #[test]
    fn variants_differ_in_the_marked_lines() {
        for (whole, half) in HALF {
            assert_eq!(COMMON.matches(whole).count(), 1, "{whole}");
            let kernel = Kernel {
                half: true,
                ..Kernel::new("linear")
            };
            assert!(kernel.source().contains(half));
        }
        for (wide, narrow) in NARROW {
            assert_eq!(TILE.matches(wide).count(), 1, "{wide}");
            let kernel = Kernel {
                narrow: true,
                ..Kernel::new("linear")
            };
            assert!(kernel.source().contains(narrow));
        }
    }

    fn parse(kernel: &Kernel) -> naga::Module {
        let source = kernel.source();
        naga::front::wgsl::parse_str(&source)
            .unwrap_or_else(|e| panic!("{kernel:?}: {}", e.emit_to_string(&source)))
    }

    #[test]
    fn every_shader_is_valid_within_the_default_limits() {
        for kernel in all() {
            let module = parse(&kernel);
            use naga::valid::Capabilities;
            let needed = [
                (kernel.half, Capabilities::SHADER_FLOAT16_IN_FLOAT32),
                (kernel.narrow, Capabilities::SHADER_FLOAT16),
                (kernel.subgroups, Capabilities::SUBGROUP),
            ];
            let needed = needed.into_iter().filter(|(needs, _)| *needs);
            let needed: Capabilities = needed.map(|(_, capability)| capability).collect();
            let flags = naga::valid::ValidationFlags::all();
            let checked = naga::valid::Validator::new(flags, needed).validate(&module);
            checked
                .unwrap_or_else(|e| panic!("{kernel:?}: {}", e.emit_to_string(&kernel.source())));
            let [x, y, z] = module.entry_points[0].workgroup_size;
            assert!(x * y * z <= 256, "{kernel:?}: {} threads", x * y * z);
            let workgroup = naga::AddressSpace::WorkGroup;
            let mut layout = naga::proc::Layouter::default();
            layout.update(module.to_ctx()).unwrap();
            let shared: u32 = module
                .global_variables
                .iter()
                .filter(|(_, v)| v.space == workgroup)
                .map(|(_, v)| layout[v.ty].size)
                .sum();
            assert!(
                shared <= 16_384,
                "{kernel:?}: {shared} bytes of workgroup memory"
            );
        }
    }

    #[test]
    fn parameters_are_the_same_in_rust_and_wgsl() {
        assert_eq!(params::ALL.len(), SHADERS.len());
        for &(name, fields) in params::ALL {
            let module = parse(&Kernel::new(name));
            let params = module
                .types
                .iter()
                .find(|(_, t)| t.name.as_deref() == Some("Params"));
            let naga::TypeInner::Struct { members, span } = &params.unwrap().1.inner else {
                panic!("{name}: Params is no struct");
            };
            let reflected: Vec<_> = members
                .iter()
                .map(|m| (m.name.as_deref().unwrap(), m.offset))
                .collect();
            let expected: Vec<_> = fields.iter().zip(0..).map(|(&f, i)| (f, 4 * i)).collect();
            assert_eq!(reflected, expected, "{name}");
            assert!(*span <= 256, "{name}: {span} bytes");
        }
    }

    #[test]
    fn every_file_in_shaders_is_a_kernel() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/shaders");
        let files: BTreeSet<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .filter(|name| {
                let parts = [
                    "common.wgsl",
                    "reduce.wgsl",
                    "reduce_subgroups.wgsl",
                    "tile.wgsl",
                ];
                !parts.contains(&name.as_str())
            })
            .collect();
        let known: BTreeSet<String> = SHADERS
            .iter()
            .map(|(name, _)| format!("{name}.wgsl"))
            .collect();
        assert_eq!(files, known);
    }
}
