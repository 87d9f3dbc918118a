//! Layouts held to what kernels declare, by naga's view of their source.

use naga::{AddressSpace, ImageClass, ImageDimension, ScalarKind, StorageAccess, StorageFormat, TypeInner};
use wgpu::{BindGroupLayoutEntry, BindingType, BufferBindingType, TextureSampleType};

/// Does a layout's entry bind what the kernel declares?
fn fits(module: &naga::Module, variable: &naga::GlobalVariable, ty: BindingType) -> bool {
    let (d2, d3) = (wgpu::TextureViewDimension::D2, wgpu::TextureViewDimension::D3);
    match (&module.types[variable.ty].inner, variable.space, ty) {
        (TypeInner::Sampler { comparison: false }, _, BindingType::Sampler(_)) => true,
        (&TypeInner::Image { dim, class: ImageClass::Sampled { kind, multi: false }, .. }, _, ty) => {
            let BindingType::Texture { sample_type, view_dimension, .. } = ty else { return false };
            let is_float = matches!(sample_type, TextureSampleType::Float { .. });
            let of_dim = if dim == ImageDimension::D3 { d3 } else { d2 };
            view_dimension == of_dim && (kind == ScalarKind::Float) == is_float
        }
        (
            &TypeInner::Image { dim, class: ImageClass::Storage { format: StorageFormat::R32Uint, access }, .. },
            _,
            BindingType::StorageTexture { access: wgpu::StorageTextureAccess::WriteOnly, format, view_dimension },
        ) => {
            let is_written = access == StorageAccess::STORE && format == wgpu::TextureFormat::R32Uint;
            is_written && dim == ImageDimension::D3 && view_dimension == d3
        }
        (
            _,
            AddressSpace::Storage { access },
            BindingType::Buffer { ty: BufferBindingType::Storage { read_only }, .. },
        ) => read_only != access.contains(StorageAccess::STORE),
        _ => false,
    }
}

/// What of a kernel the pipelines' layouts do not bind, or bind as something else.
pub(super) fn unbound(source: &str, groups: &[Vec<BindGroupLayoutEntry>]) -> Vec<String> {
    let module = naga::front::wgsl::parse_str(source).unwrap();
    let bound = |at: naga::ResourceBinding| groups.get(at.group as usize)?.iter().find(|e| e.binding == at.binding);
    let variables = module.global_variables.iter().filter_map(|(_, v)| Some((v, v.binding?)));
    let wrong = variables.filter(|(v, at)| !bound(*at).is_some_and(|entry| fits(&module, v, entry.ty)));
    wrong.map(|(v, _)| v.name.clone().unwrap_or_default()).collect()
}
