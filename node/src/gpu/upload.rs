//! Bricks on the GPU: one 3D texture each, so that the same point gets the same filter weights in every brick.

use std::any::Any;
use std::sync::Arc;

use brickcast_shaders::binding;
use brickcast_shaders::layout::BrickUniform;
use brickcast_volume::brick::OwnedBox;
use brickcast_volume::lod::Sides;
use brickcast_volume::regions::code::MAX_SLOTS;

use super::cells::CellTextures;
use super::device::Gpu;
use super::kernel::{Kernels, bound};
use crate::brick::bytes::CELL_BYTES;
use crate::brick::emptiness::Emptiness;
use crate::brick::texels::BuiltBrick;
use crate::brick::worth::LastOccupied;
use crate::kernel::{KernelScene, Placed, RaycastError, ResidentBrick};

/// A brick's textures, bound once.
#[derive(Debug)]
pub(super) struct GpuBrick {
    gpu: Arc<Gpu>,
    textures: Vec<wgpu::Texture>,
    pub(super) bind_group: wgpu::BindGroup,
    pub(super) owned: OwnedBox,
    /// Boxes, cells and flags; rectangle, accumulator, counter and the map's mask are the dispatch's.
    uniform: BrickUniform,
    has_leaps: bool,
    cells: Option<CellTextures>,
    occupancy: LastOccupied,
    bytes: u64,
}

impl GpuBrick {
    pub(super) fn is_on(&self, gpu: &Arc<Gpu>) -> bool {
        Arc::ptr_eq(&self.gpu, gpu)
    }

    /// What the brick needs in this scene.
    pub(super) fn in_scene(&self, sides: Sides, scene: &KernelScene, emptiness: Option<&Arc<Emptiness>>) -> Placed {
        let cells = self.cells.as_ref();
        let ask = |(emptiness, cells): (_, &CellTextures)| self.occupancy.ask(emptiness, &self.owned, &cells.cells);
        let has_cubes = cells.is_some_and(CellTextures::has_homogeneous);
        Placed::new(scene, &self.uniform, (self.has_leaps, has_cubes), emptiness.zip(cells).map(ask), sides)
    }

    /// The cells whose map is not that of `emptiness`; afterwards it counts as such.
    pub(super) fn outdated_cells(&self, emptiness: &Arc<Emptiness>) -> Option<&CellTextures> {
        self.cells.as_ref().filter(|cells| cells.is_outdated(emptiness))
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
        self.textures.iter().for_each(wgpu::Texture::destroy);
    }
}

pub(super) fn upload(
    gpu: &Arc<Gpu>,
    kernels: &Kernels,
    owned: OwnedBox,
    mut prepared: BuiltBrick<'_>,
) -> Result<GpuBrick, RaycastError> {
    let dims = prepared.uniform.stored_dims;
    let max = gpu.limits.max_texture_dimension_3d;
    if dims.iter().any(|&n| n > max) {
        return Err(RaycastError::BrickTooLarge { dims, max });
    }
    let bytes = prepared.bytes(kernels.voxel_bytes(), CELL_BYTES);
    let floats: Vec<f32>;
    let data: &[u8] = if kernels.voxel_bytes() == 2 {
        bytemuck::cast_slice(&prepared.texels)
    } else {
        floats = prepared.texels.iter().map(|&texel| f32::from(texel) / 65535.0).collect();
        bytemuck::cast_slice(&floats)
    };
    let mut means = prepared.means.clone().unwrap_or_default();
    means.resize(MAX_SLOTS + 1, 0.0);
    let cells = prepared.cells.take();
    let (textures, cells, bind_group, submission) = gpu.guarded("a brick", bytes, || {
        let volume = texture_3d(gpu, dims, kernels.voxel_format, data);
        let means = means_texture(gpu, &means);
        let flags = match &prepared.flags {
            Some(flags) => texture_3d(gpu, dims, wgpu::TextureFormat::R8Uint, flags),
            None => texture_3d(gpu, [1; 3], wgpu::TextureFormat::R8Uint, &[0]),
        };
        let cells = cells.map(|cells| CellTextures::new(gpu, cells));
        let map = match &cells {
            Some(cells) => cells.map.clone(),
            None => texture_3d(gpu, [1; 3], wgpu::TextureFormat::R32Uint, &[0; 4]),
        };
        let mut textures = vec![volume, means, map, flags];
        let views = textures.iter().map(|t| t.create_view(&wgpu::TextureViewDescriptor::default()));
        let views: Vec<_> = views.collect();
        let order = [binding::VOLUME, binding::MEANS, binding::MAP, binding::FLAGS];
        let entries: Vec<_> = order
            .into_iter()
            .zip(&views)
            .map(|(at, view)| bound(at, wgpu::BindingResource::TextureView(view)))
            .collect();
        let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("brick"),
            layout: &kernels.volume_layout,
            entries: &entries,
        });
        textures.extend(cells.iter().flat_map(CellTextures::inputs));
        (textures, cells, bind_group, gpu.queue.submit([]))
    })?;
    let (uniform, has_leaps) = (prepared.uniform, prepared.means.is_some());
    let brick = GpuBrick {
        gpu: gpu.clone(),
        textures,
        bind_group,
        owned,
        uniform,
        has_leaps,
        cells,
        occupancy: LastOccupied::default(),
        bytes,
    };
    // Else the staging copies of many bricks would pile up.
    gpu.wait("the upload of a brick", submission)?;
    Ok(brick)
}

fn means_texture(gpu: &Gpu, means: &[f32]) -> wgpu::Texture {
    let size = wgpu::Extent3d { width: means.len() as u32, height: 1, depth_or_array_layers: 1 };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("means"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::R32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let rows = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: None, rows_per_image: None };
    gpu.queue.write_texture(texture.as_image_copy(), bytemuck::cast_slice(means), rows, size);
    texture
}

/// A filled 3D texture; `data` is x fastest, without padding. Those of 32-bit integers can also be written by kernels.
pub(super) fn texture_3d(gpu: &Gpu, dims: [u32; 3], format: wgpu::TextureFormat, data: &[u8]) -> wgpu::Texture {
    let [width, height, depth_or_array_layers] = dims;
    let size = wgpu::Extent3d { width, height, depth_or_array_layers };
    let mut usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
    usage.set(wgpu::TextureUsages::STORAGE_BINDING, format == wgpu::TextureFormat::R32Uint);
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("brick"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D3,
        format,
        usage,
        view_formats: &[],
    });
    fill_texture_3d(gpu, &texture, dims, data);
    texture
}

/// New content for a texture of these dims.
pub(super) fn fill_texture_3d(gpu: &Gpu, texture: &wgpu::Texture, dims: [u32; 3], data: &[u8]) {
    let [width, height, depth_or_array_layers] = dims;
    let size = wgpu::Extent3d { width, height, depth_or_array_layers };
    let row = texture.format().block_copy_size(None).map(|bytes| bytes * width);
    let rows = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: row, rows_per_image: Some(height) };
    gpu.queue.write_texture(texture.as_image_copy(), data, rows, size);
}
