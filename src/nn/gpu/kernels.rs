//! The shaders and how they are put together.

/// Prepended to every kernel.
const COMMON: &str = include_str!("../../../shaders/common.wgsl");

/// Appended to kernels that are products.
const TILE: &str = include_str!("../../../shaders/tile.wgsl");

/// The shape of a product's workgroup: 4·`rows` outputs by 4·`columns` cells a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
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
            (_, 0..=4) => (64, 1),
            (_, 5..=16) => (16, 4),
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
    pub fn for_software() -> Self {
        Self::DEFAULT
    }
}

/// A kernel in one of its shapes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Kernel {
    /// The name: that of the shader's file and of the CPU's function.
    pub name: &'static str,
    /// The workgroup of a product.
    pub tile: Option<Tile>,
}

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
        }
    }

    /// The whole text of the shader.
    ///
    /// # Panics
    /// If there is no shader of that name.
    #[must_use]
    pub fn source(&self) -> String {
        let found = SHADERS.iter().find(|(name, _)| *name == self.name);
        let (_, text) = found.expect("every operation has a shader");
        match self.tile {
            None => format!("{COMMON}{text}"),
            Some(Tile { rows, columns }) => {
                let tile = TILE
                    .replace("THREADS_M: u32 = 8u", &format!("THREADS_M: u32 = {rows}u"))
                    .replace(
                        "THREADS_N: u32 = 8u",
                        &format!("THREADS_N: u32 = {columns}u"),
                    );
                format!("{COMMON}{text}{tile}")
            }
        }
    }
}
