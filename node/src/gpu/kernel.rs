//! The raycast pipelines and what they bind: group 0 the frame, group 1 the accumulator and the dispatch, group 2 a
//! brick.

use std::collections::HashMap;
use std::num::NonZeroU64;
use std::sync::{Mutex, PoisonError};

use brickcast_shaders::{
    BrickUniform, FrameUniform, KernelKey, RaycastVariant, StyleUniform, TakeKind, accelerated_wgsl, integral_wgsl,
    raycast_wgsl,
};
use wgpu::{BindGroupLayoutEntry, BindingType, BufferBindingType, TextureFormat, TextureSampleType};

use super::device::Gpu;
pub(super) use super::tables::FrameTables;
use crate::kernel::RaycastError;

/// One variant's plain pipeline, and what all its pipelines have in common.
#[derive(Debug)]
struct Pipelines {
    variant: RaycastVariant,
    frame_layout: wgpu::BindGroupLayout,
    pipeline_layout: wgpu::PipelineLayout,
    plain: wgpu::ComputePipeline,
    /// Compiled when first needed: start-up does not wait for what few scenes use.
    accelerated: Mutex<HashMap<KernelKey, wgpu::ComputePipeline>>,
}

/// Pipelines of both variants; the hardware one only where voxels can be filtered.
#[derive(Debug)]
pub(super) struct Kernels {
    hardware: Option<Pipelines>,
    exact: Pipelines,
    dispatch_layout: wgpu::BindGroupLayout,
    pub(super) volume_layout: wgpu::BindGroupLayout,
    sampler: wgpu::Sampler,
    pub(super) voxel_format: TextureFormat,
}

pub(super) const FRAME_BYTES: u64 = size_of::<FrameUniform>() as u64;
/// The frame, and the style behind it.
pub(super) const SCENE_BYTES: u64 = FRAME_BYTES + size_of::<StyleUniform>() as u64;
pub(super) const DISPATCH_BYTES: u64 = size_of::<BrickUniform>() as u64;

pub(super) fn entry(binding: u32, ty: BindingType) -> BindGroupLayoutEntry {
    BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
}

/// What does not change within a dispatch.
fn constants(bytes: u64, has_dynamic_offset: bool) -> BindingType {
    let ty = BufferBindingType::Storage { read_only: true };
    BindingType::Buffer { ty, has_dynamic_offset, min_binding_size: NonZeroU64::new(bytes) }
}

fn storage(read_only: bool) -> BindingType {
    let ty = BufferBindingType::Storage { read_only };
    BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

fn texture(view_dimension: wgpu::TextureViewDimension, filterable: bool) -> BindingType {
    BindingType::Texture { sample_type: TextureSampleType::Float { filterable }, view_dimension, multisampled: false }
}

/// Of unsigned integers.
pub(super) fn integers(view_dimension: wgpu::TextureViewDimension) -> BindingType {
    BindingType::Texture { sample_type: TextureSampleType::Uint, view_dimension, multisampled: false }
}

pub(super) fn layout(gpu: &Gpu, label: &str, entries: &[BindGroupLayoutEntry]) -> wgpu::BindGroupLayout {
    gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
}

/// Linear between texel centres, clamped at the edge.
pub(super) fn linear_sampler(gpu: &Gpu) -> wgpu::Sampler {
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("linear, clamped"),
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        ..Default::default()
    })
}

impl Kernels {
    /// `norm16`: voxels are R16Unorm, else R32Float. `exact_only`: no hardware variant.
    pub(super) fn new(gpu: &Gpu, norm16: bool, exact_only: bool) -> Result<Self, RaycastError> {
        gpu.guarded("the raycast kernels", 0, || {
            let d3 = wgpu::TextureViewDimension::D3;
            let means = texture(wgpu::TextureViewDimension::D2, false);
            // Plain kernels read the first only.
            let brick = [texture(d3, norm16), means, integers(d3), integers(d3)];
            let entries: Vec<_> = brick.into_iter().zip(0..).map(|(ty, binding)| entry(binding, ty)).collect();
            let volume_layout = layout(gpu, "brick", &entries);
            let dispatch_layout = layout(
                gpu,
                "dispatch",
                &[entry(0, constants(DISPATCH_BYTES, true)), entry(1, storage(false)), entry(2, storage(false))],
            );
            let build = |variant| Pipelines::new(gpu, variant, &dispatch_layout, &volume_layout);
            Self {
                hardware: (!exact_only).then(|| build(RaycastVariant::Hardware)),
                exact: build(RaycastVariant::Exact),
                dispatch_layout,
                volume_layout,
                sampler: linear_sampler(gpu),
                voxel_format: if norm16 { TextureFormat::R16Unorm } else { TextureFormat::R32Float },
            }
        })
    }

    pub(super) fn voxel_bytes(&self) -> u64 {
        if self.voxel_format == TextureFormat::R16Unorm { 2 } else { 4 }
    }

    fn kernel(&self, variant: RaycastVariant) -> &Pipelines {
        match (variant, &self.hardware) {
            (RaycastVariant::Hardware, Some(kernel)) => kernel,
            _ => &self.exact,
        }
    }

    /// The pipeline that does just this.
    pub(super) fn pipeline(
        &self,
        gpu: &Gpu,
        variant: RaycastVariant,
        key: KernelKey,
    ) -> Result<wgpu::ComputePipeline, RaycastError> {
        let kernel = self.kernel(variant);
        if key == KernelKey::PLAIN {
            return Ok(kernel.plain.clone());
        }
        let mut known = kernel.accelerated.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = known.get(&key) {
            return Ok(pipeline.clone());
        }
        let pipeline = gpu.guarded("an accelerated kernel", 0, || kernel.accelerated(gpu, key))?;
        known.insert(key, pipeline.clone());
        Ok(pipeline)
    }

    /// Group 0: the frame's uniform and the tables.
    pub(super) fn bind_frame(
        &self,
        gpu: &Gpu,
        variant: RaycastVariant,
        frame: &wgpu::Buffer,
        tables: &FrameTables,
    ) -> wgpu::BindGroup {
        let filtered = variant == RaycastVariant::Hardware && self.hardware.is_some();
        let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: frame.as_entire_binding() }];
        let views = tables.views(gpu, filtered);
        entries.extend(views.iter().map(|(binding, view)| wgpu::BindGroupEntry {
            binding: *binding,
            resource: wgpu::BindingResource::TextureView(view),
        }));
        if filtered {
            let resource = wgpu::BindingResource::Sampler(&self.sampler);
            entries.push(wgpu::BindGroupEntry { binding: 2, resource });
        }
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("frame"),
            layout: &self.kernel(variant).frame_layout,
            entries: &entries,
        })
    }

    /// Group 1: one dispatch's uniform (at a dynamic offset), the accumulator and the counters.
    pub(super) fn bind_dispatch(
        &self,
        gpu: &Gpu,
        dispatches: &wgpu::Buffer,
        accumulator: &wgpu::Buffer,
        counters: &wgpu::Buffer,
    ) -> wgpu::BindGroup {
        let uniform = wgpu::BufferBinding { buffer: dispatches, offset: 0, size: NonZeroU64::new(DISPATCH_BYTES) };
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("dispatch"),
            layout: &self.dispatch_layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::Buffer(uniform) },
                wgpu::BindGroupEntry { binding: 1, resource: accumulator.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 2, resource: counters.as_entire_binding() },
            ],
        })
    }
}

impl Pipelines {
    fn new(
        gpu: &Gpu,
        variant: RaycastVariant,
        dispatch_layout: &wgpu::BindGroupLayout,
        volume_layout: &wgpu::BindGroupLayout,
    ) -> Self {
        let filtered = variant == RaycastVariant::Hardware;
        let d2 = wgpu::TextureViewDimension::D2;
        let mut entries = vec![entry(0, constants(SCENE_BYTES, false))];
        // Tables of samples and warps are loaded, whatever the variant.
        entries.extend([1, 3, 9, 10].map(|binding| entry(binding, texture(d2, false))));
        entries.extend((5..9).map(|binding| entry(binding, texture(d2, filtered))));
        if filtered {
            entries.push(entry(2, BindingType::Sampler(wgpu::SamplerBindingType::Filtering)));
        }
        let frame_layout = layout(gpu, "frame", &entries);
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("raycast"),
            bind_group_layouts: &[Some(&frame_layout), Some(dispatch_layout), Some(volume_layout)],
            immediate_size: 0,
        });
        let plain = compute_pipeline(gpu, Some(&pipeline_layout), "raycast", raycast_wgsl(variant), &[]);
        Self { variant, frame_layout, pipeline_layout, plain, accelerated: Mutex::default() }
    }

    fn accelerated(&self, gpu: &Gpu, key: KernelKey) -> wgpu::ComputePipeline {
        let KernelKey { leaps, regions, holes, take, .. } = key;
        let switches = [("LEAP", leaps), ("MAP", key.has_map()), ("REGIONS", regions), ("HOLES", holes)];
        let mut overrides = switches.map(|(name, on)| (name, f64::from(on))).to_vec();
        let layout = Some(&self.pipeline_layout);
        if take == TakeKind::Sampled {
            return compute_pipeline(gpu, layout, "accelerated", accelerated_wgsl(self.variant), &overrides);
        }
        let kinds = take.slab_kind();
        overrides.extend([
            ("PREINTEGRATED", f64::from(kinds.preintegrated)),
            ("LIGHT", f64::from(kinds.light_number())),
            ("SURFACES", f64::from(kinds.surfaces)),
            ("MODE", f64::from(take.pixel_kind() as u8)),
        ]);
        compute_pipeline(gpu, layout, "integral", integral_wgsl(self.variant), &overrides)
    }
}

/// Compiles `entry` of `source`.
pub(super) fn compute_pipeline(
    gpu: &Gpu,
    layout: Option<&wgpu::PipelineLayout>,
    entry: &str,
    source: String,
    constants: &[(&str, f64)],
) -> wgpu::ComputePipeline {
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(entry),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(entry),
        layout,
        module: &module,
        entry_point: Some(entry),
        compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
        cache: None,
    })
}
