//! Transfer functions and pre-integrated slabs as textures.

use std::sync::Arc;

use brickcast_volume::preintegration::Preintegrated;
use brickcast_volume::transfer_function::TransferTable;
use half::f16;
use wgpu::TextureFormat;

use super::device::Gpu;
use crate::kernel_style::KernelStyle;
use crate::raycaster::KernelScene;

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
                style.kinds.light == others.kinds.light && is_same(slabs, other)
            }
            _ => false,
        };
        same_slabs && is_same(&self.samples, &other.samples)
    }

    pub(super) fn bytes(&self) -> u64 {
        let samples: usize = self.samples.iter().map(|table| table.entries.len()).sum();
        let slabs: usize = self.slabs.iter().flat_map(|(_, slabs)| slabs).map(|slabs| 2 * slabs.total.len()).sum();
        (samples + slabs) as u64 * ENTRY_BYTES
    }

    /// Views by binding of group 0; `filtered` for the hardware variant.
    pub(super) fn views(&self, gpu: &Gpu, filtered: bool) -> Vec<(u32, wgpu::TextureView)> {
        let line = if filtered { wgpu::TextureDimension::D1 } else { wgpu::TextureDimension::D2 };
        let d2 = wgpu::TextureDimension::D2;
        let samples = |table: &TransferTable| view(gpu, filtered, line, table.entries.len(), &table.entries);
        let [outside, inside] = &self.samples;
        let first = samples(outside);
        let second = if Arc::ptr_eq(outside, inside) { first.clone() } else { samples(inside) };
        let mut views = vec![(1, first), (3, second)];
        let nothing = view(gpu, filtered, d2, 1, &[[0.0; 4]]);
        let Some((style, [outside, inside])) = &self.slabs else {
            views.extend((5..9).map(|binding| (binding, nothing.clone())));
            return views;
        };
        let pair = |slabs: &Preintegrated| {
            style.slab_entries(slabs).map(|entries| {
                if entries.is_empty() { nothing.clone() } else { view(gpu, filtered, d2, slabs.size, entries) }
            })
        };
        let [front, back] = pair(outside);
        let inner = if Arc::ptr_eq(outside, inside) { [front.clone(), back.clone()] } else { pair(inside) };
        views.extend([(5, front), (6, back)]);
        views.extend((7..9).zip(inner));
        views
    }
}

/// A texture `width` entries wide.
fn view(
    gpu: &Gpu,
    filtered: bool,
    dimension: wgpu::TextureDimension,
    width: usize,
    entries: &[[f32; 4]],
) -> wgpu::TextureView {
    // GPUs filter half floats at full speed and full ones at a half or a quarter; software is faster without decoding.
    let (format, bytes) = if filtered && !gpu.is_float_table_faster {
        let halves: Vec<[f16; 4]> = entries.iter().map(|e| e.map(f16::from_f32)).collect();
        (TextureFormat::Rgba16Float, bytemuck::cast_slice(&halves).to_vec())
    } else {
        (TextureFormat::Rgba32Float, bytemuck::cast_slice(entries).to_vec())
    };
    let height = (entries.len() / width) as u32;
    let size = wgpu::Extent3d { width: width as u32, height, depth_or_array_layers: 1 };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("transfer function"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let bytes_per_row = format.block_copy_size(None).map(|bytes| bytes * width as u32);
    let rows = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row, rows_per_image: Some(height) };
    gpu.queue.write_texture(texture.as_image_copy(), &bytes, rows, size);
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}
