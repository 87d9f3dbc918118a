//! What stands in Rust and in WGSL must be the same: where the members of uniforms lie, constants, numbers of bindings,
//! overrides; from naga's view of the WGSL.

use std::collections::BTreeSet;
use std::mem::{offset_of, size_of};

use brickcast_shaders::{BrickUniform, FrameUniform, KernelKey, RaycastVariant, StyleUniform};
use naga::TypeInner;

use super::modules::{all_keys, march, parse, sources};

type Members = Vec<(String, u32)>;

/// Members and size of a WGSL struct.
fn wgsl_struct(module: &naga::Module, name: &str) -> (Members, u32) {
    let ty = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name)).map(|(_, ty)| &ty.inner);
    let Some(TypeInner::Struct { members, span }) = ty else { panic!("no struct {name}") };
    (members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset)).collect(), *span)
}

macro_rules! rust_struct {
    ($ty:ident: $($field:ident)*) => {{
        // Fails to compile where a field is missing from this list.
        #[allow(dead_code)]
        fn names_every_field($ty { $($field: _),* }: $ty) {}
        let members = vec![$((stringify!($field).to_owned(), offset_of!($ty, $field) as u32)),*];
        (members, size_of::<$ty>() as u32)
    }};
}

fn frame() -> (Members, u32) {
    rust_struct!(FrameUniform: eye step ray_forward stop_alpha ray_right inverse_width ray_up inverse_height
        voxels_per_unit parallel width height table_first table_scale fan shown region_first region_scale table_last
        region_last nearest finest weight reserved)
}

fn brick() -> (Members, u32) {
    rust_struct!(BrickUniform: owned_lo accumulator_base owned_hi accumulator_stride stored_lo counter stored_dims
        region_flags rect_lo rect_size cell_lo cell_shift code_scale holes borders reserved)
}

fn style() -> (Members, u32) {
    rust_struct!(StyleUniform: volume_hi surface_count light ambient diffuse specular shininess plane_count light_from
        reserved codes colors planes)
}

/// Of a key whose module has all uniforms.
fn styled() -> KernelKey {
    all_keys().into_iter().find(|key| !key.take.is_projection() && key.take.ends_beyond()).unwrap()
}

#[test]
fn members_lie_where_the_kernels_read_them() {
    for (key, module) in all_keys().into_iter().map(|key| (key, march(RaycastVariant::Exact, key))) {
        assert_eq!(wgsl_struct(&module, "FrameUniform"), frame());
        assert_eq!(wgsl_struct(&module, "BrickUniform"), brick());
        if key.take != KernelKey::PLAIN.take {
            assert_eq!(wgsl_struct(&module, "StyleUniform"), style());
        }
    }
}

/// The comparison itself must notice two swapped members and a member that moved.
#[test]
fn the_comparison_can_fail() {
    let good = brickcast_shaders::march_wgsl(RaycastVariant::Exact, styled());
    let swapped = good.replace("width: i32,\n    height: i32,", "height: i32,\n    width: i32,");
    assert_ne!(swapped, good);
    assert_ne!(wgsl_struct(&parse(&swapped), "FrameUniform"), frame());
    let moved = good.replace("rect_lo: vec2<u32>,", "moved: u32,\n    rect_lo: vec2<u32>,");
    assert_ne!(moved, good);
    assert_ne!(wgsl_struct(&parse(&moved), "BrickUniform"), brick());
}

/// Names of the overrides of a module.
fn wgsl_overrides(module: &naga::Module) -> BTreeSet<String> {
    module.overrides.iter().filter_map(|(_, o)| o.name.clone()).collect()
}

fn rust_overrides(key: KernelKey) -> BTreeSet<String> {
    brickcast_shaders::overrides(key).into_iter().map(|(name, _)| name.to_owned()).collect()
}

#[test]
fn a_key_gives_every_override_of_its_module_and_no_other() {
    for key in all_keys() {
        for variant in [RaycastVariant::Exact, RaycastVariant::Hardware] {
            assert_eq!(wgsl_overrides(&march(variant, key)), rust_overrides(key), "{key:?}");
        }
    }
}

/// One more and one less are noticed.
#[test]
fn the_comparison_of_overrides_can_fail() {
    let key = styled();
    let good = brickcast_shaders::march_wgsl(RaycastVariant::Exact, key);
    let more = format!("override MORE: bool;\n{good}");
    assert_ne!(wgsl_overrides(&parse(&more)), rust_overrides(key));
    assert_ne!(wgsl_overrides(&march(RaycastVariant::Exact, KernelKey::PLAIN)), rust_overrides(key));
}

#[test]
fn kernels_are_valid() {
    for source in sources() {
        let flags = naga::valid::ValidationFlags::all();
        let capabilities = naga::valid::Capabilities::empty();
        naga::valid::Validator::new(flags, capabilities)
            .validate(&parse(&source))
            .unwrap_or_else(|e| panic!("{}", e.emit_to_string(&source)));
    }
}
