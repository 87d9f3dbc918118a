//! Every kernel as naga sees it.

use brickcast_shaders::{
    KernelKey, RaycastVariant, SlabKind, TakeKind, distance_wgsl, filter_probe_wgsl, macrocell_wgsl, march_wgsl,
};
use brickcast_volume::PixelKind;
use brickcast_volume::style::Lighting;

pub(crate) fn parse(source: &str) -> naga::Module {
    naga::front::wgsl::parse_str(source).unwrap_or_else(|e| panic!("{}", e.emit_to_string(source)))
}

pub(crate) fn march(variant: RaycastVariant, key: KernelKey) -> naga::Module {
    parse(&march_wgsl(variant, key))
}

/// A key for every choice of parts.
pub(crate) fn all_keys() -> Vec<KernelKey> {
    let slabs = SlabKind { preintegrated: true, light: Some(Lighting::Centroid), surfaces: true };
    let takes = [TakeKind::Sampled, TakeKind::Slabs(slabs), TakeKind::Projection(PixelKind::Largest)];
    let walks = [(false, false), (true, false), (false, true), (true, true)];
    let key = |take| walks.map(|(skips, leaps)| KernelKey { skips, leaps, take, ..KernelKey::PLAIN });
    let keys: Vec<KernelKey> = takes.into_iter().flat_map(key).collect();
    let on_borders = keys.iter().filter(|key| !key.take.is_projection()).map(|key| KernelKey { borders: true, ..*key });
    keys.iter().copied().chain(on_borders).collect()
}

/// Of all kernels.
pub(crate) fn sources() -> Vec<String> {
    let variants = [RaycastVariant::Hardware, RaycastVariant::Exact];
    let marches =
        variants.into_iter().flat_map(|variant| all_keys().into_iter().map(move |key| march_wgsl(variant, key)));
    marches.chain([macrocell_wgsl(), distance_wgsl(), filter_probe_wgsl().to_owned()]).collect()
}
