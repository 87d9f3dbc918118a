//! Uniforms must lie where the kernels read them: names and offsets, from naga's view of the WGSL.

use std::mem::{offset_of, size_of};

use brickcast_shaders::{
    BrickUniform, FrameUniform, RaycastVariant, SlabKind, StyleUniform, accelerated_wgsl, distance_wgsl,
    filter_probe_wgsl, integral_wgsl, macrocell_wgsl, raycast_wgsl,
};
use brickcast_volume::scene::{Word, Words};
use brickcast_volume::style::Lighting;
use naga::{Expression, Literal, TypeInner};

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
        region_last nearest reserved)
}

fn brick() -> (Members, u32) {
    rust_struct!(BrickUniform: owned_lo accumulator_base owned_hi accumulator_stride stored_lo counter stored_dims
        region_flags rect_lo rect_size cell_lo cell_shift map_mask code_scale holes reserved)
}

fn style() -> (Members, u32) {
    rust_struct!(StyleUniform: volume_hi surface_count light ambient diffuse specular shininess plane_count light_from
        reserved codes colors planes)
}

fn parse(source: &str) -> naga::Module {
    naga::front::wgsl::parse_str(source).unwrap_or_else(|e| panic!("{}", e.emit_to_string(source)))
}

#[test]
fn members_lie_where_the_kernels_read_them() {
    for variant in [RaycastVariant::Hardware, RaycastVariant::Exact] {
        assert_eq!(wgsl_struct(&parse(&integral_wgsl(variant)), "StyleUniform"), style());
        for source in [raycast_wgsl(variant), accelerated_wgsl(variant), integral_wgsl(variant)] {
            let module = parse(&source);
            assert_eq!(wgsl_struct(&module, "FrameUniform"), frame());
            assert_eq!(wgsl_struct(&module, "BrickUniform"), brick());
        }
    }
}

/// The comparison itself must notice two swapped members and a member that moved.
#[test]
fn the_comparison_can_fail() {
    let good = raycast_wgsl(RaycastVariant::Exact);
    let swapped = good.replace("width: i32,\n    height: i32,", "height: i32,\n    width: i32,");
    assert_ne!(swapped, good);
    assert_ne!(wgsl_struct(&parse(&swapped), "FrameUniform"), frame());
    let moved = good.replace("rect_lo: vec2<u32>,", "moved: u32,\n    rect_lo: vec2<u32>,");
    assert_ne!(moved, good);
    assert_ne!(wgsl_struct(&parse(&moved), "BrickUniform"), brick());
}

/// The value of a constant; `None` where there is none of that name.
fn wgsl_constant(module: &naga::Module, name: &str) -> Option<u32> {
    let (_, constant) = module.constants.iter().find(|(_, constant)| constant.name.as_deref() == Some(name))?;
    match module.global_expressions[constant.init] {
        Expression::Literal(Literal::U32(value)) => Some(value),
        _ => None,
    }
}

#[test]
fn a_lighting_has_one_number_in_both_languages() {
    let module = parse(&integral_wgsl(RaycastVariant::Exact));
    for Word { value, word, .. } in Lighting::WORDS {
        let kinds = SlabKind { light: Some(*value), ..SlabKind::default() };
        let name = format!("LIGHT_{}", word.to_uppercase());
        assert_eq!(wgsl_constant(&module, &name), Some(kinds.light_number()), "{name}");
    }
    assert_eq!(SlabKind::default().light_number(), 0);
    assert_eq!(wgsl_constant(&module, "LIGHT_OF_NOBODY"), None);
}

#[test]
fn kernels_are_valid() {
    let sources = [
        raycast_wgsl(RaycastVariant::Hardware),
        raycast_wgsl(RaycastVariant::Exact),
        accelerated_wgsl(RaycastVariant::Hardware),
        accelerated_wgsl(RaycastVariant::Exact),
        integral_wgsl(RaycastVariant::Hardware),
        integral_wgsl(RaycastVariant::Exact),
        macrocell_wgsl(),
        distance_wgsl(),
        filter_probe_wgsl().to_owned(),
    ];
    for source in sources {
        let flags = naga::valid::ValidationFlags::all();
        let capabilities = naga::valid::Capabilities::empty();
        naga::valid::Validator::new(flags, capabilities)
            .validate(&parse(&source))
            .unwrap_or_else(|e| panic!("{}", e.emit_to_string(&source)));
    }
}
