//! The parameters of each kernel, shared with WGSL.
//!
//! Each struct has the fields of `struct Params` in the shader of its name, in order, all `u32`; a
//! test compares them with what the shader validator reflects.

/// What a kernel's uniform binding holds.
pub(super) trait Params: bytemuck::Pod {
    /// The kernel: the shader's file without its ending.
    const KERNEL: &'static str;
    /// The fields' names, in order.
    #[cfg_attr(not(test), allow(dead_code))] // for comparison with the shaders
    const FIELDS: &'static [&'static str];
}

macro_rules! params {
    ($($kernel:literal $name:ident { $($field:ident),* $(,)? })*) => {$(
        #[repr(C)]
        #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
        pub(super) struct $name { $(pub(super) $field: u32),* }

        impl Params for $name {
            const KERNEL: &'static str = $kernel;
            const FIELDS: &'static [&'static str] = &[$(stringify!($field)),*];
        }
    )*

        /// Kernels with their parameters' names.
        #[cfg(test)]
        pub(super) const ALL: &[(&str, &[&str])] = &[$(($kernel, $name::FIELDS)),*];
    };
}

params! {
    "conv2d" Conv2d {
        x_offset, channels, height, width, y_offset, out, out_height, out_width, kernel, stride,
        padding, activation, has_residual, residual_offset,
    }
    "conv_transpose2d" ConvTranspose2d {
        x_offset, channels, height, width, y_offset, out, out_height, out_width, taps, stride,
        padding, activation,
    }
    "linear" Linear {
        x_offset, x_stride, x_columns, second_offset, second_stride, second_columns, y_offset,
        y_stride, rows, out, activation,
    }
    "gat" Gat {
        x_offset, x_stride, x_columns, target_offset, target_stride, target_columns, y_offset,
        y_stride, targets, offsets_at, sources_at,
    }
    "max_pool2d" MaxPool2d {
        x_offset, height, width, y_offset, out_height, out_width, kernel, stride, padding, count,
    }
    "global_mean_pool" GlobalMeanPool { x_offset, channels, cells, y_offset }
    "mean_rows" MeanRows { x_offset, x_stride, rows, y_offset, count }
    "region_mean" RegionMean { x_offset, channels, cells, mask_offset, y_offset, y_stride, count }
    "sign_mean" SignMean {
        x_offset, x_stride, columns, literals_offset, literals_stride, labels, negative, y_offset,
        y_stride, count,
    }
    "region_form" RegionForm {
        x_offset, x_stride, columns, literals_offset, literals_stride, rows, negative, y_offset,
        y_stride, count,
    }
    "paint" Paint { x_offset, labels, cells, colour_offset, colour_stride, y_offset, count }
    "upsample" Upsample { x_offset, height, width, y_offset, out_height, out_width, count }
    "broadcast" Broadcast { x_offset, cells, add, y_offset, count }
    "copy_rows" CopyRows { x_offset, x_stride, columns, y_offset, y_stride, count }
}
