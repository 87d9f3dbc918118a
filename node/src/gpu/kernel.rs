//! The raycast pipelines and what they bind: group 0 the frame, group 1 the accumulator and the dispatch, group 2 a
//! brick.

use std::collections::HashMap;
use std::num::NonZeroU64;
use std::sync::{Mutex, PoisonError};

use brickcast_shaders::binding::{self, Binding};
use brickcast_shaders::{BrickUniform, FrameUniform, KernelKey, RaycastVariant, StyleUniform, march_wgsl, overrides};
use wgpu::{BindGroupLayoutEntry, BindingType, BufferBindingType, TextureFormat, TextureSampleType};

use super::device::Gpu;
pub(super) use super::tables::FrameTables;
use crate::kernel::RaycastError;

/// One variant's pipelines, and what they have in common.
#[derive(Debug)]
struct Pipelines {
    variant: RaycastVariant,
    frame_layout: wgpu::BindGroupLayout,
    pipeline_layout: wgpu::PipelineLayout,
    /// Compiled when first needed: start-up does not wait for what few scenes use.
    built: Mutex<HashMap<KernelKey, wgpu::ComputePipeline>>,
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

pub(super) fn storage(read_only: bool) -> BindingType {
    let ty = BufferBindingType::Storage { read_only };
    BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

pub(super) fn texture(view_dimension: wgpu::TextureViewDimension, filterable: bool) -> BindingType {
    BindingType::Texture { sample_type: TextureSampleType::Float { filterable }, view_dimension, multisampled: false }
}

/// Of unsigned integers.
pub(super) fn integers(view_dimension: wgpu::TextureViewDimension) -> BindingType {
    BindingType::Texture { sample_type: TextureSampleType::Uint, view_dimension, multisampled: false }
}

/// Group 0: the frame. Tables of samples and warps are loaded, whatever the variant.
fn frame_entries(variant: RaycastVariant) -> Vec<BindGroupLayoutEntry> {
    let filtered = variant == RaycastVariant::Hardware;
    let d2 = wgpu::TextureViewDimension::D2;
    let mut entries = vec![at(binding::SCENE, constants(SCENE_BYTES, false))];
    let loaded = [binding::TABLE, binding::REGION_TABLE, binding::WARP, binding::REGION_WARP];
    entries.extend(loaded.map(|binding| at(binding, texture(d2, false))));
    let slabs = [binding::SLAB_FRONT, binding::SLAB_BACK, binding::REGION_SLAB_FRONT, binding::REGION_SLAB_BACK];
    entries.extend(slabs.map(|binding| at(binding, texture(d2, filtered))));
    if filtered {
        entries.push(at(binding::SAMPLER, BindingType::Sampler(wgpu::SamplerBindingType::Filtering)));
    }
    entries
}

/// Group 1: the accumulator and the dispatch.
fn dispatch_entries() -> Vec<BindGroupLayoutEntry> {
    vec![
        at(binding::BRICK, constants(DISPATCH_BYTES, true)),
        at(binding::ACCUMULATOR, storage(false)),
        at(binding::COUNTERS, storage(false)),
    ]
}

/// Group 2: a brick, in the order of its textures.
fn brick_entries(norm16: bool) -> Vec<BindGroupLayoutEntry> {
    let (d2, d3) = (wgpu::TextureViewDimension::D2, wgpu::TextureViewDimension::D3);
    vec![
        at(binding::VOLUME, texture(d3, norm16)),
        at(binding::MEANS, texture(d2, false)),
        at(binding::MAP, integers(d3)),
        at(binding::FLAGS, integers(d3)),
    ]
}

fn at(binding: Binding, ty: BindingType) -> BindGroupLayoutEntry {
    entry(binding.number, ty)
}

/// What is bound there.
pub(super) fn bound(binding: Binding, resource: wgpu::BindingResource<'_>) -> wgpu::BindGroupEntry<'_> {
    wgpu::BindGroupEntry { binding: binding.number, resource }
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
    /// `norm16`: voxels are R16Unorm, else R32Float. `exact_only`: no hardware variant. Compiles the plain kernel: an
    /// adapter that cannot is told at start-up.
    pub(super) fn new(gpu: &Gpu, norm16: bool, exact_only: bool) -> Result<Self, RaycastError> {
        let kernels = gpu.guarded("the raycast kernels", 0, || {
            let volume_layout = layout(gpu, "brick", &brick_entries(norm16));
            let dispatch_layout = layout(gpu, "dispatch", &dispatch_entries());
            let build = |variant| Pipelines::new(gpu, variant, &dispatch_layout, &volume_layout);
            Self {
                hardware: (!exact_only).then(|| build(RaycastVariant::Hardware)),
                exact: build(RaycastVariant::Exact),
                dispatch_layout,
                volume_layout,
                sampler: linear_sampler(gpu),
                voxel_format: if norm16 { TextureFormat::R16Unorm } else { TextureFormat::R32Float },
            }
        })?;
        let variant = if exact_only { RaycastVariant::Exact } else { RaycastVariant::Hardware };
        kernels.pipeline(gpu, variant, KernelKey::PLAIN)?;
        Ok(kernels)
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
        let mut known = kernel.built.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = known.get(&key) {
            return Ok(pipeline.clone());
        }
        let pipeline = gpu.guarded("a kernel", 0, || kernel.build(gpu, key))?;
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
        let views = tables.views(gpu, filtered);
        let mut entries = vec![bound(binding::SCENE, frame.as_entire_binding())];
        entries.extend(views.iter().map(|(at, view)| bound(*at, wgpu::BindingResource::TextureView(view))));
        if filtered {
            entries.push(bound(binding::SAMPLER, wgpu::BindingResource::Sampler(&self.sampler)));
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
                bound(binding::BRICK, wgpu::BindingResource::Buffer(uniform)),
                bound(binding::ACCUMULATOR, accumulator.as_entire_binding()),
                bound(binding::COUNTERS, counters.as_entire_binding()),
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
        let frame_layout = layout(gpu, "frame", &frame_entries(variant));
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("raycast"),
            bind_group_layouts: &[Some(&frame_layout), Some(dispatch_layout), Some(volume_layout)],
            immediate_size: 0,
        });
        Self { variant, frame_layout, pipeline_layout, built: Mutex::default() }
    }

    fn build(&self, gpu: &Gpu, key: KernelKey) -> wgpu::ComputePipeline {
        let source = march_wgsl(self.variant, key);
        compute_pipeline(gpu, Some(&self.pipeline_layout), "march", source, &overrides(key))
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

#[cfg(test)]
mod tests {
    use brickcast_shaders::{SlabKind, TakeKind};
    use brickcast_volume::PixelKind;
    use brickcast_volume::style::Lighting;

    use super::super::reflection::unbound;
    use super::*;

    fn groups(variant: RaycastVariant) -> [Vec<BindGroupLayoutEntry>; 3] {
        [frame_entries(variant), dispatch_entries(), brick_entries(true)]
    }

    const ALL_OF_SLABS: TakeKind =
        TakeKind::Slabs(SlabKind { preintegrated: true, light: Some(Lighting::Centroid), surfaces: true });

    #[test]
    fn layouts_bind_what_kernels_declare() {
        for variant in [RaycastVariant::Hardware, RaycastVariant::Exact] {
            for take in [TakeKind::Sampled, ALL_OF_SLABS, TakeKind::Projection(PixelKind::Mean)] {
                for (skips, leaps) in [(false, false), (true, false), (false, true), (true, true)] {
                    let key = KernelKey { skips, leaps, take, ..KernelKey::PLAIN };
                    assert_eq!(unbound(&march_wgsl(variant, key), &groups(variant)), [""; 0], "{key:?}");
                }
            }
        }
    }

    /// A buffer that is written but bound for reading, a texture of another dimension, a missing sampler.
    #[test]
    fn what_is_bound_as_something_else_is_noticed() {
        let key = KernelKey { take: ALL_OF_SLABS, ..KernelKey::PLAIN };
        let source = march_wgsl(RaycastVariant::Hardware, key);
        assert_eq!(unbound(&source, &groups(RaycastVariant::Exact)), ["linear_clamped"]);
        let other = "@group(2) @binding(0) var volume: texture_2d<f32>;";
        assert_eq!(unbound(other, &groups(RaycastVariant::Exact)), ["volume"]);
        let written = "@group(1) @binding(0) var<storage, read_write> brick_data: array<f32>;";
        assert_eq!(unbound(written, &groups(RaycastVariant::Exact)), ["brick_data"]);
    }
}
