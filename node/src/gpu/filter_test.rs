//! Start-up self-test: does the adapter's trilinear filter do what the kernel relies on?

use std::num::NonZeroU64;

use brickcast_shaders::filter_probe_wgsl;

use super::device::Gpu;
use super::kernel::{compute_pipeline, entry, layout, linear_sampler, storage, texture};
use super::upload::texture_3d;
use crate::kernel::RaycastError;

/// Texels per axis of the test textures.
const EDGE: u32 = 16;
/// Equal texels per axis of the flat texture.
const BLOCK: u32 = 4;
/// Probes per texture.
const PROBES: u32 = 4096;
/// Codes from one texel to the next along each axis of the ramp.
const SLOPES: [u32; 3] = [2048, 1024, 512];

/// Texel codes, and what the filter may answer.
struct Probe {
    codes: Vec<u16>,
    /// Position in texels.
    positions: Vec<[f32; 4]>,
}

/// `None` where the filter is good, else what is wrong, in words.
pub(super) fn complaint(gpu: &Gpu) -> Result<Option<String>, RaycastError> {
    let flat = flat();
    let answers = ask(gpu, &flat)?;
    let wrong = answers.iter().filter(|[filtered, loaded]| filtered != loaded).count();
    if wrong > 0 {
        return Ok(Some(format!("the adapter's filter changes {wrong} of {PROBES} values between equal voxels")));
    }
    let ramp = ramp();
    let worst = ask(gpu, &ramp)?
        .iter()
        .zip(&ramp.positions)
        .map(|([filtered, _], p)| {
            let codes: f32 = (0..3).map(|a| (p[a] - 0.5) * SLOPES[a] as f32).sum();
            (filtered * 65535.0 - codes).abs()
        })
        .fold(0.0, f32::max);
    // Weights of 8 bits, cut off: 1/256 of the step along each axis. Codes themselves round by less than 1.
    let bound = SLOPES.iter().sum::<u32>() as f32 / 256.0 + 1.0;
    let weights_err = worst > bound || worst.is_nan();
    Ok(weights_err.then(|| {
        format!(
            "the adapter's filter errs by {worst:.1} of 65535 codes on a ramp where weights of 8 bits err by {bound:.1}"
        )
    }))
}

/// A repeatable scatter of 0..n.
fn scatter(seed: u32, n: u32) -> u32 {
    let mixed = (seed ^ 0x5bf0_3635).wrapping_mul(0x9e37_79b9);
    ((mixed ^ mixed >> 15).wrapping_mul(0x85eb_ca6b) >> 8) % n
}

fn texture_of(code: impl Fn([u32; 3]) -> u16) -> Vec<u16> {
    (0..EDGE.pow(3)).map(|i| code([i % EDGE, i / EDGE % EDGE, i / EDGE / EDGE])).collect()
}

/// Blocks of equal voxels; probes whose whole support lies in one block.
fn flat() -> Probe {
    let codes = texture_of(|[x, y, z]| scatter(x / BLOCK + 8 * (y / BLOCK) + 64 * (z / BLOCK), 65_536) as u16);
    let inside = |seed: u32| {
        let block = scatter(seed, EDGE / BLOCK) * BLOCK;
        // Half a texel off the block's faces, and a little for rounding.
        let within = scatter(seed ^ 0xaaaa, 1024) as f32 / 1023.0;
        block as f32 + 0.501 + within * (BLOCK as f32 - 1.002)
    };
    let positions = (0..PROBES).map(|i| [inside(3 * i), inside(3 * i + 1), inside(3 * i + 2), 0.0]).collect();
    Probe { codes, positions }
}

/// A linear function of the position, which trilinear interpolation reproduces.
fn ramp() -> Probe {
    let codes = texture_of(|p| (0..3).map(|a| p[a] * SLOPES[a]).sum::<u32>() as u16);
    let between = |seed: u32| 0.5 + scatter(seed, 4096) as f32 / 4095.0 * (EDGE - 1) as f32;
    let positions = (0..PROBES).map(|i| [between(3 * i), between(3 * i + 1), between(3 * i + 2), 0.0]).collect();
    Probe { codes, positions }
}

/// Texture, sampler, positions, answers.
fn entries() -> [wgpu::BindGroupLayoutEntry; 4] {
    let sampler = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
    let volume = texture(wgpu::TextureViewDimension::D3, true);
    [entry(0, volume), entry(1, sampler), entry(2, storage(true)), entry(3, storage(false))]
}

/// Reads the texture at every position: (filtered, loaded).
fn ask(gpu: &Gpu, probe: &Probe) -> Result<Vec<[f32; 2]>, RaycastError> {
    let position_bytes = u64::from(PROBES) * 16;
    let answer_bytes = u64::from(PROBES) * 8;
    let device = &gpu.device;
    let staging = gpu.guarded("the filter's self-test", position_bytes + 2 * answer_bytes, || {
        let buffer = |size: u64, usage: wgpu::BufferUsages| {
            device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
        };
        let positions = buffer(position_bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST);
        let answers = buffer(answer_bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let staging = buffer(answer_bytes, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
        gpu.queue.write_buffer(&positions, 0, bytemuck::cast_slice(&probe.positions));
        let data = bytemuck::cast_slice(&probe.codes);
        let texture = texture_3d(gpu, [EDGE; 3], wgpu::TextureFormat::R16Unorm, data);
        let bound = layout(gpu, "filter probe", &entries());
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("filter probe"),
            bind_group_layouts: &[Some(&bound)],
            immediate_size: 0,
        });
        let source = filter_probe_wgsl().to_owned();
        let pipeline = compute_pipeline(gpu, Some(&pipeline_layout), "filter_probe", source, &[]);
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let sampler = linear_sampler(gpu);
        let whole =
            |buffer| wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size: None::<NonZeroU64> });
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("filter probe"),
            layout: &bound,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&sampler) },
                wgpu::BindGroupEntry { binding: 2, resource: whole(&positions) },
                wgpu::BindGroupEntry { binding: 3, resource: whole(&answers) },
            ],
        });
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &bind_group, &[]);
            pass.dispatch_workgroups(PROBES.div_ceil(64), 1, 1);
        }
        encoder.copy_buffer_to_buffer(&answers, 0, &staging, 0, answer_bytes);
        gpu.queue.submit([encoder.finish()]);
        staging
    })?;
    gpu.read("the filter's self-test", &staging, answer_bytes, |bytes| {
        bytes.chunks_exact(8).map(bytemuck::pod_read_unaligned).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::super::reflection::unbound;
    use super::*;

    #[test]
    fn the_layout_binds_what_the_probe_declares() {
        assert_eq!(unbound(filter_probe_wgsl(), &[entries().to_vec()]), [""; 0]);
    }
}
