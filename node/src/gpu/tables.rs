//! Transfer functions and pre-integrated slabs as textures.

use std::sync::Arc;

use brickcast_shaders::binding::{self, Binding};
use brickcast_volume::preintegration::Preintegrated;
use brickcast_volume::transfer_function::TransferTable;
use half::f16;
use wgpu::TextureFormat;

use super::device::Gpu;
use crate::kernel::{KernelScene, KernelStyle};

/// Slabs outside regions, front and back.
const OUTER: [Binding; 2] = [binding::SLAB_FRONT, binding::SLAB_BACK];
/// The same in regions.
const INNER: [Binding; 2] = [binding::REGION_SLAB_FRONT, binding::REGION_SLAB_BACK];

/// Bytes of an entry: four f32.
const ENTRY_BYTES: u64 = 16;

/// The tables of a scene: two of each kind, outside and inside regions.
#[derive(Debug, Clone)]
pub(super) struct FrameTables {
    samples: [Arc<TransferTable>; 2],
    slabs: Option<(KernelStyle, [Arc<Preintegrated>; 2])>,
}

fn is_same<T: PartialEq>(a: &[Arc<T>; 2], b: &[Arc<T>; 2]) -> bool {
    a.iter().zip(b).all(|(a, b)| Arc::ptr_eq(a, b) || a == b)
}

impl FrameTables {
    pub(super) fn of(scene: &KernelScene) -> Self {
        let region = scene.region_table.as_ref().unwrap_or(&scene.table);
        let slabs = scene.style.as_ref().and_then(|style| Some((style.clone(), style.slabs.clone()?)));
        Self { samples: [scene.table.clone(), region.clone()], slabs }
    }

    /// True where `other` would be the same textures.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        let same_slabs = match (&self.slabs, &other.slabs) {
            (None, None) => true,
            (Some((style, slabs)), Some((others, other))) => {
                style.take.slab_kind().light == others.take.slab_kind().light && is_same(slabs, other)
            }
            _ => false,
        };
        same_slabs && is_same(&self.samples, &other.samples)
    }

    pub(super) fn bytes(&self) -> u64 {
        let samples: usize = self.samples.iter().map(|table| table.entries.len()).sum();
        let of_slabs = |slabs: &Arc<Preintegrated>| 2 * slabs.total.len() + slabs.warp.len();
        let slabs: usize = self.slabs.iter().flat_map(|(_, slabs)| slabs).map(of_slabs).sum();
        (samples + slabs) as u64 * ENTRY_BYTES
    }

    /// Views and where they are bound; slabs `filtered` for the hardware variant.
    pub(super) fn views(&self, gpu: &Gpu, filtered: bool) -> Vec<(Binding, wgpu::TextureView)> {
        let samples = |table: &TransferTable| line(gpu, TextureFormat::Rgba32Float, &table.entries);
        let [outside, inside] = &self.samples;
        let first = samples(outside);
        let second = if Arc::ptr_eq(outside, inside) { first.clone() } else { samples(inside) };
        let mut views = vec![(binding::TABLE, first), (binding::REGION_TABLE, second)];
        let nothing = square(gpu, filtered, 1, &[[0.0; 4]]);
        let Some((style, [outside, inside])) = &self.slabs else {
            views.extend(OUTER.into_iter().chain(INNER).map(|binding| (binding, nothing.clone())));
            let straight = line(gpu, TextureFormat::Rg32Float, &[[0.0_f32; 2]]);
            views.extend([(binding::WARP, straight.clone()), (binding::REGION_WARP, straight)]);
            return views;
        };
        let all = |slabs: &Preintegrated| {
            let [front, back] = style.slab_entries(slabs).map(|entries| {
                if entries.is_empty() { nothing.clone() } else { square(gpu, filtered, slabs.size, entries) }
            });
            [front, back, line(gpu, TextureFormat::Rg32Float, &slabs.warp)]
        };
        let [front, back, warp] = all(outside);
        let inner =
            if Arc::ptr_eq(outside, inside) { [front.clone(), back.clone(), warp.clone()] } else { all(inside) };
        let bound = |slabs: [Binding; 2], warp| slabs.into_iter().chain([warp]);
        views.extend(bound(OUTER, binding::WARP).zip([front, back, warp]));
        views.extend(bound(INNER, binding::REGION_WARP).zip(inner));
        views
    }
}

/// Texels of a line to a row, at most.
pub(super) const ROW: usize = brickcast_shaders::layout::TABLE_ROW as usize;

/// A line of texels, cut into rows; the last one is filled up.
fn line<T: bytemuck::Pod>(gpu: &Gpu, format: TextureFormat, texels: &[T]) -> wgpu::TextureView {
    let width = texels.len().min(ROW);
    let mut bytes = bytemuck::cast_slice::<T, u8>(texels).to_vec();
    bytes.resize(texels.len().next_multiple_of(width) * size_of::<T>(), 0);
    texture(gpu, format, width, &bytes)
}

/// Slabs, `width` nodes each way.
fn square(gpu: &Gpu, filtered: bool, width: usize, entries: &[[f32; 4]]) -> wgpu::TextureView {
    // GPUs filter half floats at full speed and full ones at a half or a quarter; software is faster without decoding.
    if filtered && !gpu.is_float_table_faster {
        let halves: Vec<[f16; 4]> = entries.iter().map(|e| e.map(f16::from_f32)).collect();
        return texture(gpu, TextureFormat::Rgba16Float, width, bytemuck::cast_slice(&halves));
    }
    texture(gpu, TextureFormat::Rgba32Float, width, bytemuck::cast_slice(entries))
}

/// A texture `width` texels wide.
fn texture(gpu: &Gpu, format: TextureFormat, width: usize, bytes: &[u8]) -> wgpu::TextureView {
    let bytes_per_row = format.block_copy_size(None).map(|bytes| bytes * width as u32);
    let height = bytes_per_row.map_or(1, |row| bytes.len() as u32 / row);
    let size = wgpu::Extent3d { width: width as u32, height, depth_or_array_layers: 1 };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("transfer function"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let rows = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row, rows_per_image: Some(height) };
    gpu.queue.write_texture(texture.as_image_copy(), bytes, rows, size);
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}
