//! What a kernel is asked for and answers: the one interface that both backends have, and the words that it is spoken
//! in. Nothing here knows a backend, a store or a client.

mod brick;
mod error;
mod job;
mod occupied;
mod placed;
mod raycaster;
mod recipe;
mod scene;
mod style;
mod watch;

pub use brick::{BrickInput, ResidentBrick};
pub use brickcast_shaders::{BrickTraits, KernelKey, LookTraits, SlabKind, TakeKind};
pub use error::RaycastError;
pub use job::{BrickCounts, Job, JobImage};
pub use raycaster::{BackendInfo, Raycaster};
pub use recipe::Recipe;
pub use scene::KernelScene;
pub use style::KernelStyle;
pub use watch::{Cancelled, Pulse, Watch};

pub(crate) use brick::check_brick;
pub(crate) use job::{check_jobs, new_pixels};
pub(crate) use occupied::Occupied;
pub(crate) use placed::Placed;
pub(crate) use recipe::knows_only_region;
