//! How a GPU is chosen, and why there may be none.

use std::time::Duration;

use crate::kernel::RaycastError;

/// How the adapter is chosen and used.
#[derive(Debug, Clone)]
pub struct GpuOptions {
    /// Part of the adapter's name, driver or backend, any case; `None` takes the best.
    pub adapter: Option<String>,
    /// Take no driver that renders on the processor (lavapipe, WARP): the CPU kernel is faster there. Without a device
    /// file of any GPU (Linux) no driver is loaded, unless `adapter` names one.
    pub real_only: bool,
    /// Store voxels as R32Float even where R16Unorm is there (for tests of the fallback).
    pub without_norm16: bool,
    /// Filter the transfer function as half floats even where full ones are faster (for tests of what real GPUs do).
    pub without_float_table: bool,
    /// Build macrocell maps by kernels even where the processor plays GPU and is quicker without (for tests of what
    /// real GPUs do).
    pub with_map_kernels: bool,
    /// The longest wait for a piece of work that takes seconds on the slowest adapter.
    pub timeout: Duration,
    /// Most bytes of accumulators on the GPU at a time (as many again for reading back); clamped to the adapter's
    /// limits.
    pub accumulator_bytes: u64,
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self {
            adapter: None,
            real_only: false,
            without_norm16: false,
            without_float_table: false,
            with_map_kernels: false,
            timeout: Duration::from_secs(60),
            accumulator_bytes: 128 << 20,
        }
    }
}

impl GpuOptions {
    /// The default with the adapter that `BRICKCAST_ADAPTER` names, if set.
    #[must_use]
    pub fn from_env() -> Self {
        let adapter = std::env::var("BRICKCAST_ADAPTER").ok().filter(|name| !name.trim().is_empty());
        Self { adapter, ..Self::default() }
    }
}

/// Why there is no GPU raycaster.
#[derive(Debug, Clone, thiserror::Error)]
pub enum GpuError {
    #[error(
        "no Vulkan, Metal, DirectX 12 or OpenGL driver found; install your GPU's driver, or mesa-vulkan-drivers for \
         rendering in software"
    )]
    NoAdapter,
    #[error("no adapter's description holds `{wanted}` (BRICKCAST_ADAPTER); found: {found}")]
    NoSuchAdapter { wanted: String, found: String },
    #[error("no GPU found, only a software driver ({found})")]
    OnlySoftware { found: String },
    #[error("no GPU found")]
    NoDevice,
    #[error("no adapter can run the compute kernel; found: {found}; update the driver, or use --backend cpu")]
    NoCompute { found: String },
    #[error("adapter {adapter} does not open: {reason}; update the driver, or use --backend cpu")]
    Open { adapter: String, reason: String },
    #[error("adapter {adapter} fails at start-up: {source}; update the driver, or use --backend cpu")]
    StartUp { adapter: String, source: RaycastError },
}
