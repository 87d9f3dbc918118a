//! Macrocell maps on the GPU: built anew when the transfer function changes, by kernels, or by the processor where it
//! plays GPU (a software driver takes hundreds of times as long for the many small dispatches).

use std::sync::{Arc, Mutex, PoisonError, Weak};

use brickcast_shaders::twin::macrocell::empty_distances;
use brickcast_shaders::{distance_wgsl, macrocell_wgsl};
use brickcast_volume::macrocell::{Macrocells, MapTexel};
use rayon::prelude::*;
use wgpu::{BindGroupLayoutEntry, BindingType, TextureFormat, TextureViewDimension};

use super::device::Gpu;
use super::kernel::{compute_pipeline, entry, integers, layout};
use super::upload::{GpuBrick, fill_texture_3d, texture_3d};
use crate::brick::emptiness::{Emptiness, is_same};
use crate::brick::texels::BuiltCells;
use crate::kernel::RaycastError;

/// Cells of a workgroup, per axis.
const WORKGROUP_CELLS: u32 = 4;
/// Bricks whose maps are built in one submission.
const SUBMIT_MAPS: usize = 64;

/// A brick's macrocells.
#[derive(Debug)]
pub(super) struct CellTextures {
    pub(super) cells: Macrocells,
    /// What the kernels read: ranges and homogeneous bits; `None` where the processor builds the map.
    inputs: Option<[wgpu::Texture; 2]>,
    /// The map's homogeneous bits by cell.
    homogeneous: Option<Vec<u32>>,
    pub(super) map: wgpu::Texture,
    /// No more than its name: counts of half a megabyte must not live as long as every brick that once saw them.
    built_for: Mutex<Weak<Emptiness>>,
}

impl CellTextures {
    pub(super) fn new(gpu: &Gpu, prepared: BuiltCells) -> Self {
        let BuiltCells { cells, homogeneous } = prepared;
        let integers =
            |dims, texels: &[u32]| texture_3d(gpu, dims, TextureFormat::R32Uint, bytemuck::cast_slice(texels));
        let dims = cells.dims.into();
        let map = match &homogeneous {
            Some(texels) => integers(dims, texels),
            None => integers(dims, &vec![0; cells.ranges.len()]),
        };
        let inputs = gpu.has_map_kernels.then(|| {
            let ranges = cells.ranges.iter().map(|&[min, max]| u32::from(min) | u32::from(max) << 16);
            let homogeneous = homogeneous.as_ref().map_or_else(|| integers([1; 3], &[0]), |bits| integers(dims, bits));
            [integers(dims, &ranges.collect::<Vec<_>>()), homogeneous]
        });
        Self { cells, inputs, homogeneous, map, built_for: Mutex::default() }
    }

    fn dims(&self) -> [u32; 3] {
        self.cells.dims.into()
    }

    pub(super) fn has_homogeneous(&self) -> bool {
        self.homogeneous.is_some()
    }

    /// What the map is built from, where kernels build it.
    pub(super) fn inputs(&self) -> impl Iterator<Item = wgpu::Texture> {
        self.inputs.iter().flatten().cloned()
    }

    /// The map's texels as the kernels would write them.
    fn texels(&self, emptiness: &Emptiness) -> Vec<u32> {
        let distances = empty_distances(&emptiness.counts, &self.cells.ranges, self.dims());
        let mut texels = self.homogeneous.clone().unwrap_or_else(|| vec![0; distances.len()]);
        let bits = |empty| MapTexel { empty, ..MapTexel::default() }.pack();
        texels.iter_mut().zip(distances).for_each(|(texel, distance)| *texel |= bits(distance));
        texels
    }

    pub(super) fn is_outdated(&self, emptiness: &Arc<Emptiness>) -> bool {
        let built_for = self.built_for.lock().unwrap_or_else(PoisonError::into_inner);
        !is_same(&built_for, emptiness)
    }

    fn is_built_for(&self, emptiness: &Arc<Emptiness>) {
        *self.built_for.lock().unwrap_or_else(PoisonError::into_inner) = Arc::downgrade(emptiness);
    }
}

/// Pipelines, created when a scene skips for the first time, and what they need from call to call.
#[derive(Debug, Default)]
pub(super) struct MapBuilder(Option<Builder>);

#[derive(Debug)]
struct Builder {
    occupancy_layout: wgpu::BindGroupLayout,
    distance_layout: wgpu::BindGroupLayout,
    occupancy: wgpu::ComputePipeline,
    /// Along x, y, z.
    distance: [wgpu::ComputePipeline; 3],
    /// Maps on their way from pass to pass, as large as the largest so far.
    between: Option<([u32; 3], [wgpu::Texture; 2])>,
    counts: Option<(Arc<Emptiness>, wgpu::Texture)>,
}

fn view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

const WRITTEN: BindingType = BindingType::StorageTexture {
    access: wgpu::StorageTextureAccess::WriteOnly,
    format: TextureFormat::R32Uint,
    view_dimension: TextureViewDimension::D3,
};

/// Ranges of cells, counts of opaque entries, and the map.
fn occupancy_entries() -> [BindGroupLayoutEntry; 3] {
    let (d2, d3) = (integers(TextureViewDimension::D2), integers(TextureViewDimension::D3));
    [entry(0, d3), entry(1, d2), entry(2, WRITTEN)]
}

/// Ranges of cells, the map before, homogeneous bits, and the map after.
fn distance_entries() -> [BindGroupLayoutEntry; 4] {
    let d3 = integers(TextureViewDimension::D3);
    [entry(0, d3), entry(1, d3), entry(2, d3), entry(3, WRITTEN)]
}

impl Builder {
    fn new(gpu: &Gpu) -> Self {
        let occupancy_layout = layout(gpu, "occupancy", &occupancy_entries());
        let distance_layout = layout(gpu, "distance", &distance_entries());
        let with = |bound: &wgpu::BindGroupLayout| {
            gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("macrocells"),
                bind_group_layouts: &[Some(bound)],
                immediate_size: 0,
            })
        };
        let (cells, distances) = (with(&occupancy_layout), with(&distance_layout));
        let occupancy = compute_pipeline(gpu, Some(&cells), "macrocell", macrocell_wgsl(), &[]);
        let distance = [0.0, 1.0, 2.0]
            .map(|axis| compute_pipeline(gpu, Some(&distances), "distance", distance_wgsl(), &[("AXIS", axis)]));
        Self { occupancy_layout, distance_layout, occupancy, distance, between: None, counts: None }
    }

    /// Textures that hold a map of these dims between passes.
    fn between(&mut self, gpu: &Gpu, dims: [u32; 3]) -> [wgpu::Texture; 2] {
        match &self.between {
            Some((have, textures)) if (0..3).all(|a| dims[a] <= have[a]) => textures.clone(),
            other => {
                let have = other.as_ref().map_or([0; 3], |(have, _)| *have);
                let grown: [u32; 3] = std::array::from_fn(|a| dims[a].max(have[a]));
                let zeros = vec![0; grown.iter().product::<u32>() as usize * 4];
                let textures = [(); 2].map(|()| texture_3d(gpu, grown, TextureFormat::R32Uint, &zeros));
                self.between = Some((grown, textures.clone()));
                textures
            }
        }
    }

    fn counts(&mut self, gpu: &Gpu, emptiness: &Arc<Emptiness>) -> wgpu::Texture {
        match &self.counts {
            Some((known, texture)) if Arc::ptr_eq(known, emptiness) => texture.clone(),
            _ => {
                let size = wgpu::Extent3d { width: 256, height: 256, depth_or_array_layers: 1 };
                let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                    label: Some("opaque entries"),
                    size,
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: wgpu::TextureDimension::D2,
                    format: TextureFormat::Rg32Uint,
                    usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                    view_formats: &[],
                });
                let rows =
                    wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(256 * 8), rows_per_image: Some(256) };
                let bytes = bytemuck::cast_slice(&emptiness.counts);
                gpu.queue.write_texture(texture.as_image_copy(), bytes, rows, size);
                self.counts = Some((emptiness.clone(), texture.clone()));
                texture
            }
        }
    }

    /// Occupancy, then distances along x, y and z.
    fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        cells: &CellTextures,
        counts: &wgpu::Texture,
        [a, b]: &[wgpu::Texture; 2],
    ) {
        let Some([ranges, homogeneous]) = &cells.inputs else { return };
        let groups = cells.dims().map(|n| n.div_ceil(WORKGROUP_CELLS));
        let mut dispatch = |pipeline: &wgpu::ComputePipeline, layout, textures: &[&wgpu::Texture]| {
            let views: Vec<_> = textures.iter().map(|t| view(t)).collect();
            let entries: Vec<_> = (0..)
                .zip(&views)
                .map(|(binding, view)| wgpu::BindGroupEntry {
                    binding,
                    resource: wgpu::BindingResource::TextureView(view),
                })
                .collect();
            let label = Some("macrocells");
            let bound = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout, entries: &entries });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bound, &[]);
            pass.dispatch_workgroups(groups[0], groups[1], groups[2]);
        };
        dispatch(&self.occupancy, &self.occupancy_layout, &[ranges, counts, a]);
        for (pipeline, (from, to)) in self.distance.iter().zip([(a, b), (b, a), (a, &cells.map)]) {
            dispatch(pipeline, &self.distance_layout, &[ranges, from, homogeneous, to]);
        }
    }
}

impl MapBuilder {
    /// Creates the pipelines, where there are to be some and that is still to do.
    pub(super) fn warm_up(&mut self, gpu: &Gpu) -> Result<(), RaycastError> {
        if self.0.is_none() && gpu.has_map_kernels {
            self.0 = Some(gpu.guarded("the macrocell kernels", 0, || Builder::new(gpu))?);
        }
        Ok(())
    }

    /// Brings the maps of `bricks` up to date.
    pub(super) fn update<'a>(
        &mut self,
        gpu: &Gpu,
        emptiness: &Arc<Emptiness>,
        bricks: impl Iterator<Item = &'a GpuBrick>,
    ) -> Result<(), RaycastError> {
        let outdated: Vec<&CellTextures> = bricks.filter_map(|brick| brick.outdated_cells(emptiness)).collect();
        if outdated.is_empty() {
            return Ok(());
        }
        if !gpu.has_map_kernels {
            return fill(gpu, emptiness, &outdated);
        }
        self.warm_up(gpu)?;
        let Some(builder) = &mut self.0 else { return Ok(()) };
        let mut largest = [1; 3];
        for cells in &outdated {
            largest = std::array::from_fn(|a| largest[a].max(cells.dims()[a]));
        }
        for some in outdated.chunks(SUBMIT_MAPS) {
            gpu.guarded("macrocell maps", 0, || {
                let counts = builder.counts(gpu, emptiness);
                let between = builder.between(gpu, largest);
                let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                {
                    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                    for cells in some {
                        builder.record(gpu, &mut pass, cells, &counts, &between);
                    }
                }
                gpu.queue.submit([encoder.finish()])
            })?;
            some.iter().for_each(|cells| cells.is_built_for(emptiness));
        }
        Ok(())
    }
}

/// Maps built by the processor.
fn fill(gpu: &Gpu, emptiness: &Arc<Emptiness>, outdated: &[&CellTextures]) -> Result<(), RaycastError> {
    for some in outdated.chunks(SUBMIT_MAPS) {
        let maps: Vec<Vec<u32>> = some.par_iter().map(|cells| cells.texels(emptiness)).collect();
        gpu.guarded("macrocell maps", 0, || {
            for (cells, texels) in some.iter().zip(&maps) {
                fill_texture_3d(gpu, &cells.map, cells.dims(), bytemuck::cast_slice(texels));
            }
        })?;
        some.iter().for_each(|cells| cells.is_built_for(emptiness));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::reflection::unbound;
    use super::*;

    #[test]
    fn layouts_bind_what_the_kernels_of_maps_declare() {
        assert_eq!(unbound(&macrocell_wgsl(), &[occupancy_entries().to_vec()]), [""; 0]);
        assert_eq!(unbound(&distance_wgsl(), &[distance_entries().to_vec()]), [""; 0]);
        // That of the other has counts where the map is, and reads what is written.
        assert_eq!(unbound(&distance_wgsl(), &[occupancy_entries().to_vec()]), ["before", "homogeneous", "after"]);
    }
}
