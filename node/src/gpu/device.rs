//! Finding an adapter, opening it, and noticing when it fails: wgpu's errors become values here, never panics.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, TryRecvError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use brickcast_volume::shown::without_links;
use wgpu::{Adapter, Backend, Backends, DeviceType};

use super::device_files;
use super::options::{GpuError, GpuOptions};
use super::plan::{DISPATCH_SAMPLES, DISPATCH_SAMPLES_IN_SOFTWARE};
use crate::kernel::RaycastError;

/// An open adapter.
#[derive(Debug)]
pub(super) struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) limits: wgpu::Limits,
    /// Name, driver and backend.
    pub(super) name: String,
    /// The processor plays GPU (lavapipe, WARP).
    pub(super) is_software: bool,
    /// Voxels can be R16Unorm, and a linear filter can read them and the table.
    pub(super) can_filter: bool,
    /// The transfer function is filtered as Rgba32Float, else as Rgba16Float.
    pub(super) is_float_table_faster: bool,
    /// Macrocell maps are built by kernels, else by the processor.
    pub(super) has_map_kernels: bool,
    timeout: Duration,
    fault: Arc<Mutex<Option<RaycastError>>>,
}

/// Invocations of the raycast kernel's workgroup.
const WORKGROUP: u32 = brickcast_shaders::WORKGROUP_PIXELS * brickcast_shaders::WORKGROUP_PIXELS;

impl Gpu {
    /// The most samples of a dispatch and of a submission.
    pub(super) fn dispatch_samples(&self) -> f64 {
        if self.is_software { DISPATCH_SAMPLES_IN_SOFTWARE } else { DISPATCH_SAMPLES }
    }

    /// Those that bound volumes and pictures.
    pub(super) fn told_limits(&self) -> Vec<(&'static str, u64)> {
        let limits = &self.limits;
        vec![
            ("max_texture_dimension_2d", limits.max_texture_dimension_2d.into()),
            ("max_texture_dimension_3d", limits.max_texture_dimension_3d.into()),
            ("max_buffer_size", limits.max_buffer_size),
            ("max_storage_buffer_binding_size", limits.max_storage_buffer_binding_size),
            ("max_compute_invocations_per_workgroup", limits.max_compute_invocations_per_workgroup.into()),
            ("max_compute_workgroups_per_dimension", limits.max_compute_workgroups_per_dimension.into()),
        ]
    }

    pub(super) fn open(options: &GpuOptions) -> Result<Self, GpuError> {
        let adapter = choose(options.adapter.as_deref(), options.real_only)?;
        let info = adapter.get_info();
        let name = describe(&adapter);
        let is_software = info.device_type == DeviceType::Cpu;
        let offered = adapter.features();
        // OpenGL ES has no textures of one dimension.
        let can_filter = offered.contains(wgpu::Features::TEXTURE_FORMAT_16BIT_NORM) && info.backend != Backend::Gl;
        let is_float_table_faster =
            is_software && !options.without_float_table && offered.contains(wgpu::Features::FLOAT32_FILTERABLE);
        let mut required_features = wgpu::Features::empty();
        required_features.set(wgpu::Features::TEXTURE_FORMAT_16BIT_NORM, can_filter);
        required_features.set(wgpu::Features::FLOAT32_FILTERABLE, is_float_table_faster);
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("brickcast"),
            required_features,
            // wgpu's defaults are far below what adapters can do.
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).map_err(|e| GpuError::Open {
            adapter: name.clone(),
            reason: without_links(&e.to_string()).into_owned(),
        })?;
        let fault = Arc::new(Mutex::new(None));
        let keep_first = |fault: &Mutex<Option<RaycastError>>, error: RaycastError| {
            fault.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        };
        let uncaptured = fault.clone();
        device.on_uncaptured_error(Arc::new(move |e| keep_first(&uncaptured, from_wgpu("a command", 0, &e))));
        let lost = fault.clone();
        device.set_device_lost_callback(move |reason, message| {
            let reason = format!("{reason:?}: {}", without_links(&message));
            keep_first(&lost, RaycastError::DeviceLost { reason });
        });
        Ok(Self {
            limits: device.limits(),
            device,
            queue,
            name,
            is_software,
            can_filter,
            is_float_table_faster,
            has_map_kernels: !is_software || options.with_map_kernels,
            timeout: options.timeout,
            fault,
        })
    }

    /// Runs `work`, which creates or records something of `bytes` bytes, and returns what wgpu said of it.
    pub(super) fn guarded<T>(
        &self,
        what: &'static str,
        bytes: u64,
        work: impl FnOnce() -> T,
    ) -> Result<T, RaycastError> {
        self.check()?;
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let internal = self.device.push_error_scope(wgpu::ErrorFilter::Internal);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let value = work();
        let errors = [validation.pop(), internal.pop()].map(pollster::block_on);
        let out_of_memory = pollster::block_on(memory.pop());
        match [out_of_memory].into_iter().chain(errors).flatten().next() {
            Some(error) => Err(self.fault().unwrap_or_else(|| from_wgpu(what, bytes, &error))),
            None => self.check().map(|()| value),
        }
    }

    /// What went wrong outside a guard. A lost device stays lost; other faults are reported once.
    fn check(&self) -> Result<(), RaycastError> {
        self.fault().map_or(Ok(()), Err)
    }

    fn fault(&self) -> Option<RaycastError> {
        let mut fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
        match &*fault {
            Some(RaycastError::DeviceLost { .. }) => fault.clone(),
            _ => fault.take(),
        }
    }

    /// Waits until the submission is done, but never longer than the timeout.
    pub(super) fn wait(&self, what: &'static str, submission: wgpu::SubmissionIndex) -> Result<(), RaycastError> {
        self.poll(what, wgpu::PollType::Wait { submission_index: Some(submission), timeout: Some(self.timeout) })
    }

    fn poll(&self, what: &'static str, poll: wgpu::PollType) -> Result<(), RaycastError> {
        // wgpu 30 panics when a device is lost while it is polled; there is no other way to ask.
        match catch_unwind(AssertUnwindSafe(|| self.device.poll(poll))) {
            Ok(Ok(_)) => self.check(),
            Ok(Err(wgpu::PollError::Timeout)) => {
                Err(RaycastError::Timeout { what, seconds: self.timeout.as_secs().max(1) })
            }
            // A lost device accepts no submission, and wgpu says so only here.
            Ok(Err(wgpu::PollError::WrongSubmissionIndex(..))) => Err(self.lost("it accepts no work".to_owned())),
            Err(_) => Err(self.lost(format!("wgpu gave up while waiting for {what}"))),
        }
    }

    /// Notes that the device is lost; what was known of it before comes first.
    fn lost(&self, reason: String) -> RaycastError {
        let mut fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
        match &*fault {
            Some(known @ RaycastError::DeviceLost { .. }) => known.clone(),
            _ => fault.insert(RaycastError::DeviceLost { reason }).clone(),
        }
    }

    /// Maps the buffer's first `bytes` bytes, hands them to `read`, and unmaps.
    pub(super) fn read<T>(
        &self,
        what: &'static str,
        buffer: &wgpu::Buffer,
        bytes: u64,
        read: impl FnOnce(&[u8]) -> T,
    ) -> Result<T, RaycastError> {
        let refused = |reason: String| RaycastError::Gpu { what, reason };
        let slice = buffer.slice(..bytes);
        let (send, receive) = mpsc::channel();
        self.guarded(what, bytes, || {
            // The receiver may be gone after a timeout; nobody is left to tell then.
            slice.map_async(wgpu::MapMode::Read, move |result| drop(send.send(result)));
        })?;
        let deadline = Instant::now() + self.timeout;
        loop {
            match receive.try_recv() {
                Ok(Ok(())) => break,
                Ok(Err(error)) => return Err(refused(error.to_string())),
                Err(TryRecvError::Disconnected) => return Err(refused("the mapping was dropped".to_owned())),
                Err(TryRecvError::Empty) if Instant::now() > deadline => {
                    return Err(RaycastError::Timeout { what, seconds: self.timeout.as_secs().max(1) });
                }
                Err(TryRecvError::Empty) => {
                    let wait = wgpu::PollType::Wait { submission_index: None, timeout: Some(self.timeout) };
                    self.poll(what, wait)?;
                }
            }
        }
        let value = slice.get_mapped_range().map(|view| read(&view)).map_err(|e| refused(e.to_string()));
        buffer.unmap();
        value
    }
}

fn from_wgpu(what: &'static str, bytes: u64, error: &wgpu::Error) -> RaycastError {
    match error {
        wgpu::Error::OutOfMemory { .. } => RaycastError::OutOfMemory { what, bytes },
        other => RaycastError::Gpu { what, reason: without_links(&other.to_string()).into_owned() },
    }
}

/// The best adapter whose description holds `wanted` (any case): real GPUs before software, Vulkan, Metal and DX12
/// before GL; with `real_only` no software, and no driver is loaded where no GPU can be.
fn choose(wanted: Option<&str>, real_only: bool) -> Result<Adapter, GpuError> {
    if real_only && wanted.is_none() && !device_files::may_have_gpu() {
        return Err(GpuError::NoDevice);
    }
    let mut found = Vec::new();
    let mut software = None;
    // GL is only asked where nothing else answers: opening it on a machine without a display is slow and noisy.
    for backends in [Backends::PRIMARY, Backends::GL] {
        if !wgpu::Instance::enabled_backend_features().intersects(backends) {
            continue;
        }
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends,
            flags: wgpu::InstanceFlags::empty(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let mut adapters = pollster::block_on(instance.enumerate_adapters(backends));
        found.extend(adapters.iter().map(describe));
        adapters.retain(|a| can_compute(a) && wanted.is_none_or(|w| contains(&describe(a), w)));
        match adapters.into_iter().min_by_key(rank) {
            Some(best) if !real_only || is_real(&best) => return Ok(best),
            Some(best) => {
                software = Some(best.get_info().name);
                break;
            }
            None => {}
        }
    }
    if let Some(found) = software {
        return Err(GpuError::OnlySoftware { found });
    }
    match (wanted, found.is_empty()) {
        (_, true) => Err(GpuError::NoAdapter),
        (Some(wanted), _) => Err(GpuError::NoSuchAdapter { wanted: wanted.to_owned(), found: found.join("; ") }),
        (None, _) => Err(GpuError::NoCompute { found: found.join("; ") }),
    }
}

fn contains(text: &str, part: &str) -> bool {
    text.to_lowercase().contains(&part.to_lowercase())
}

fn can_compute(adapter: &Adapter) -> bool {
    let limits = adapter.limits();
    adapter.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
        && limits.max_compute_invocations_per_workgroup >= WORKGROUP
        && limits.max_storage_buffers_per_shader_stage >= 2
        && limits.max_storage_buffer_binding_size >= super::plan::MIN_ACCUMULATOR_BYTES
        && limits.max_bind_groups >= 3
}

fn is_real(adapter: &Adapter) -> bool {
    use DeviceType::{DiscreteGpu, IntegratedGpu, VirtualGpu};
    matches!(adapter.get_info().device_type, DiscreteGpu | IntegratedGpu | VirtualGpu)
}

fn rank(adapter: &Adapter) -> u32 {
    match adapter.get_info().device_type {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Other => 3,
        DeviceType::Cpu => 4,
    }
}

fn describe(adapter: &Adapter) -> String {
    let info = adapter.get_info();
    let driver = format!("{} {}", info.driver, info.driver_info);
    let backend = match info.backend {
        Backend::Vulkan => "Vulkan",
        Backend::Metal => "Metal",
        Backend::Dx12 => "DirectX 12",
        Backend::Gl => "OpenGL",
        _ => "other",
    };
    match driver.trim() {
        "" => format!("{} ({backend})", info.name),
        driver => format!("{} ({backend}, {driver})", info.name),
    }
}
