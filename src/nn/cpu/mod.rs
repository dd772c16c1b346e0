//! Runs programs on the processor.
//!
//! One function per operation, of the operation's name; each has a twin of that name in
//! `shaders/`. Products are [`product`]'s; the crate `gemm`, in
//! [`matmul`], tells what the processor can do at most.

mod conv2d;
mod conv_transpose2d;
mod gat;
mod interleave;
mod linear;
pub mod math;
pub mod matmul;
mod moves;
mod padded;
mod pool;
pub mod product;
mod regions;
mod session;
mod share;
mod views;
mod winograd;

pub use conv_transpose2d::conv_transpose2d;
pub use conv2d::conv2d;
pub use gat::gat;
pub use linear::linear;
pub use moves::{broadcast, copy_rows, upsample};
pub use pool::{global_mean_pool, max_pool2d, mean_rows};
pub use regions::{paint, region_form, region_mean, sign_mean};
pub use session::Session;
use share::share;
pub use views::{Kernel, Mat, MatMut, Planes, PlanesMut, Scratch};
