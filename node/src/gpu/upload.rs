//! Bricks on the GPU: one 3D texture each, so that the same point gets the same filter weights in every brick.

use std::any::Any;
use std::sync::Arc;

use brickcast_shaders::BrickUniform;
use brickcast_volume::brick::OwnedBox;

use super::device::Gpu;
use super::kernel::Kernels;
use crate::raycaster::{RaycastError, ResidentBrick};
use crate::texels::PreparedBrick;

/// Bytes of a macrocell: its range and its texel of the map.
pub(super) const CELL_BYTES: u64 = 8;

/// A brick's texture, bound once.
#[derive(Debug)]
pub(super) struct GpuBrick {
    gpu: Arc<Gpu>,
    texture: wgpu::Texture,
    pub(super) bind_group: wgpu::BindGroup,
    pub(super) owned: OwnedBox,
    /// Boxes only; rectangle, accumulator and counter are the dispatch's.
    pub(super) boxes: BrickUniform,
    bytes: u64,
}

impl GpuBrick {
    pub(super) fn is_on(&self, gpu: &Arc<Gpu>) -> bool {
        Arc::ptr_eq(&self.gpu, gpu)
    }
}

impl ResidentBrick for GpuBrick {
    fn bytes(&self) -> u64 {
        self.bytes
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

impl Drop for GpuBrick {
    fn drop(&mut self) {
        // Now, not when wgpu next looks for garbage.
        self.texture.destroy();
    }
}

pub(super) fn upload(
    gpu: &Arc<Gpu>,
    kernels: &Kernels,
    owned: OwnedBox,
    prepared: PreparedBrick<'_>,
) -> Result<GpuBrick, RaycastError> {
    let dims = glam::UVec3::from(prepared.uniform.stored_dims);
    let max = gpu.limits.max_texture_dimension_3d;
    if dims.max_element() > max {
        return Err(RaycastError::BrickTooLarge { dims: dims.into(), max });
    }
    let bytes = prepared.bytes(kernels.voxel_bytes(), CELL_BYTES);
    let floats: Vec<f32>;
    let data: &[u8] = if kernels.voxel_bytes() == 2 {
        bytemuck::cast_slice(&prepared.texels)
    } else {
        floats = prepared.texels.iter().map(|&code| f32::from(code) / 65535.0).collect();
        bytemuck::cast_slice(&floats)
    };
    let size = wgpu::Extent3d { width: dims.x, height: dims.y, depth_or_array_layers: dims.z };
    let (texture, bind_group, submission) = gpu.guarded("a brick", bytes, || {
        let texture = volume_texture(gpu, size, kernels.voxel_format, data);
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("brick"),
            layout: &kernels.volume_layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) }],
        });
        (texture, bind_group, gpu.queue.submit([]))
    })?;
    let boxes = prepared.uniform;
    let brick = GpuBrick { gpu: gpu.clone(), texture, bind_group, owned, boxes, bytes };
    // Else the staging copies of many bricks would pile up.
    gpu.wait("the upload of a brick", submission)?;
    Ok(brick)
}

/// A filled 3D texture; `data` is x fastest, without padding.
pub(super) fn volume_texture(
    gpu: &Gpu,
    size: wgpu::Extent3d,
    format: wgpu::TextureFormat,
    data: &[u8],
) -> wgpu::Texture {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("brick"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D3,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let row = if format == wgpu::TextureFormat::R16Unorm { 2 * size.width } else { 4 * size.width };
    let rows = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: Some(size.height) };
    gpu.queue.write_texture(texture.as_image_copy(), data, rows, size);
    texture
}
