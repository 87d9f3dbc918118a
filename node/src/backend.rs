//! Opens the one backend or the other.

use std::sync::Arc;

use crate::cpu::CpuRaycaster;
use crate::gpu::{GpuError, GpuOptions, GpuRaycaster};
use crate::kernel::Raycaster;

/// Which backend the user asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BackendChoice {
    /// A real GPU, or the CPU kernel where there is none, saying why. A driver that renders on the processor is taken
    /// only as [`BackendChoice::Gpu`]: the CPU kernel is faster than it.
    #[default]
    Auto,
    Gpu,
    Cpu,
}

/// Opens the backend that `choice` names; the adapter is chosen as [`GpuOptions::from_env`] says.
///
/// # Errors
/// Only for [`BackendChoice::Gpu`]: no adapter, or one that cannot be used.
pub fn open(choice: BackendChoice) -> Result<Arc<dyn Raycaster>, GpuError> {
    let gpu = |real_only| GpuRaycaster::new(GpuOptions { real_only, ..GpuOptions::from_env() });
    match choice {
        BackendChoice::Cpu => Ok(Arc::new(CpuRaycaster::from_env())),
        BackendChoice::Gpu => Ok(Arc::new(gpu(false)?)),
        BackendChoice::Auto => match gpu(true) {
            Ok(raycaster) => Ok(Arc::new(raycaster)),
            Err(error) => Ok(Arc::new(CpuRaycaster::from_env().with_note(format!("rendering on the CPU: {error}")))),
        },
    }
}
