//! Constants and bindings that stand in both languages.

use brickcast_shaders::binding::{Binding, MARCH};
use brickcast_shaders::layout::{COUNTERS, Counter, RegionFlags, SHOWS_REGIONS, SHOWS_RESIDUAL, TABLE_ROW};
use brickcast_shaders::twin::take::{Projection, Sampled, Slabs, Take};
use brickcast_shaders::twin::{holes, ray, scene, surface, walk};
use brickcast_shaders::{KernelKey, RaycastVariant, SlabKind, TakeKind, WORKGROUP_PIXELS, march_wgsl};
use brickcast_volume::PixelKind;
use brickcast_volume::macrocell::{MAX_CELL_DISTANCE, MapTexel};
use brickcast_volume::scene::{Word, Words};
use brickcast_volume::style::{Lighting, MAX_PLANES, MAX_SURFACES};
use naga::{Expression, Literal};

use super::modules::{all_keys, march, parse};

/// What a constant is in Rust, as f64; `None` where it has no such name there.
fn rust_constant(key: KernelKey, name: &str) -> Option<Vec<f64>> {
    let light = |lighting: &Lighting| SlabKind { light: Some(*lighting), ..SlabKind::default() }.light_number();
    if let Some(word) = name.strip_prefix("LIGHT_") {
        let of = |w: &&Word<Lighting>| w.word.to_uppercase() == word;
        return Lighting::WORDS.iter().find(of).map(|w| vec![f64::from(light(&w.value))]);
    }
    if let Some(word) = name.strip_prefix("MODE_") {
        let of = |w: &&Word<PixelKind>| w.word.to_uppercase() == word;
        return PixelKind::WORDS.iter().find(of).map(|w| vec![f64::from(w.value as u8)]);
    }
    let takes_empty = match key.take {
        TakeKind::Sampled => Sampled::TAKES_EMPTY,
        TakeKind::Slabs(_) => Slabs::TAKES_EMPTY,
        TakeKind::Projection(_) => Projection::TAKES_EMPTY,
    };
    let integer = |value: u32| Some(f64::from(value));
    let number = |value: f32| Some(f64::from(value));
    let value = match name {
        "WORKGROUP_PIXELS" => integer(WORKGROUP_PIXELS),
        "TABLE_ROW" => integer(TABLE_ROW),
        "COUNTERS" => integer(COUNTERS),
        "COUNT_READS" => integer(Counter::Reads as u32),
        "COUNT_TAKEN" => integer(Counter::Taken as u32),
        "COUNT_LEAPT" => integer(Counter::Leapt as u32),
        "COUNT_JUMPS" => integer(Counter::Jumps as u32),
        "SHOWS_RESIDUAL" => integer(SHOWS_RESIDUAL),
        "SHOWS_REGIONS" => integer(SHOWS_REGIONS),
        "FLAGS_EVERY_VOXEL" => integer(RegionFlags::EveryVoxel as u32),
        "FLAGS_TEXTURE" => integer(RegionFlags::Texture as u32),
        "MAX_SURFACES" => integer(MAX_SURFACES as u32),
        "MAX_PLANES" => integer(MAX_PLANES as u32),
        "MAP_EMPTY" => integer(MapTexel { empty: u8::MAX, ..MapTexel::default() }.pack()),
        "MAX_CELL_DISTANCE" => integer(MAX_CELL_DISTANCE),
        "ENTRY_PROBES" => integer(walk::ENTRY_PROBES),
        "BISECTIONS" => integer(surface::BISECTIONS),
        "NEARLY_EQUAL" => number(walk::NEARLY_EQUAL),
        "MARGIN" => number(walk::MARGIN),
        "MARGIN_SHARE" => number(walk::MARGIN_SHARE),
        "NOTHING_YET" => number(walk::NOTHING_YET),
        "NO_DATA" => number(holes::NO_DATA),
        "FAR" => number(ray::FAR),
        "PARALLEL_TO_PLANE" => number(ray::PARALLEL_TO_PLANE),
        "LEAST_CUT" => number(scene::LEAST_CUT),
        "BORDERS" => integer(u32::from(key.borders)),
        "HAS_MAP" => integer(u32::from(key.has_map())),
        "TAKES_EMPTY" => integer(u32::from(takes_empty)),
        // Factor and glint of what is not lit.
        "UNLIT" => return Some(vec![1.0, 0.0]),
        _ => None,
    };
    value.map(|value| vec![value])
}

/// Names and values of a module's constants.
fn wgsl_constants(module: &naga::Module) -> Vec<(String, Vec<f64>)> {
    let value = |init| values(&module.global_expressions, init);
    module.constants.iter().filter_map(|(_, c)| Some((c.name.clone()?, value(c.init)))).collect()
}

fn values(all: &naga::Arena<Expression>, at: naga::Handle<Expression>) -> Vec<f64> {
    match &all[at] {
        Expression::Literal(Literal::F32(value)) => vec![f64::from(*value)],
        Expression::Literal(Literal::U32(value)) => vec![f64::from(*value)],
        Expression::Literal(Literal::I32(value)) => vec![f64::from(*value)],
        Expression::Literal(Literal::Bool(value)) => vec![f64::from(*value)],
        Expression::Compose { components, .. } => components.iter().flat_map(|&part| values(all, part)).collect(),
        other => panic!("a constant that is {other:?}"),
    }
}

/// Constants of a module that are not what Rust says, or that it does not know.
fn wrong_constants(module: &naga::Module, key: KernelKey) -> Vec<String> {
    let is_wrong = |(name, value): &(String, Vec<f64>)| rust_constant(key, name).as_ref() != Some(value);
    wgsl_constants(module).into_iter().filter(is_wrong).map(|(name, _)| name).collect()
}

#[test]
fn constants_have_one_value_in_both_languages() {
    let mut seen = std::collections::BTreeSet::new();
    for key in all_keys() {
        for variant in [RaycastVariant::Exact, RaycastVariant::Hardware] {
            let module = march(variant, key);
            assert_eq!(wrong_constants(&module, key), [""; 0], "{key:?}");
            seen.extend(wgsl_constants(&module).into_iter().map(|(name, _)| name));
        }
    }
    let cells = parse(&brickcast_shaders::macrocell_wgsl());
    assert_eq!(wrong_constants(&cells, KernelKey::PLAIN), [""; 0]);
    for lighting in Lighting::WORDS {
        assert!(seen.contains(&format!("LIGHT_{}", lighting.word.to_uppercase())), "{}", lighting.word);
    }
    assert!(seen.len() > 25, "{seen:?}");
}

/// Another value of each type, and a name that Rust does not know.
#[test]
fn the_comparison_of_constants_can_fail() {
    let key = all_keys().into_iter().find(|key| key.leaps && key.skips && key.take.ends_beyond()).unwrap();
    let good = march_wgsl(RaycastVariant::Exact, key);
    let changes = [
        ("ENTRY_PROBES: u32 = 2u", "ENTRY_PROBES: u32 = 3u", "ENTRY_PROBES"),
        ("MARGIN: f32 = 1e-3", "MARGIN: f32 = 1.1e-3", "MARGIN"),
        ("BISECTIONS: i32 = 6", "BISECTIONS: i32 = 7", "BISECTIONS"),
        ("TAKES_EMPTY: bool = false", "TAKES_EMPTY: bool = true", "TAKES_EMPTY"),
        ("UNLIT: vec2<f32> = vec2(1.0, 0.0)", "UNLIT: vec2<f32> = vec2(1.0, 0.5)", "UNLIT"),
        ("const LEAST_CUT", "const NOBODY: f32 = 1.0;\nconst LEAST_CUT", "NOBODY"),
    ];
    for (from, to, name) in changes {
        let changed = good.replacen(from, to, 1);
        assert_ne!(changed, good, "{name}");
        assert_eq!(wrong_constants(&parse(&changed), key), [name]);
    }
    assert_eq!(SlabKind::default().light_number(), 0);
}

/// Bindings of a module that Rust does not have, or has elsewhere.
fn wrong_bindings(module: &naga::Module) -> Vec<String> {
    let is_known = |name: &str, at: &naga::ResourceBinding| {
        MARCH.iter().any(|b| b.names.contains(&name) && (b.group, b.number) == (at.group, at.binding))
    };
    bindings_of(module).into_iter().filter(|(name, at)| !is_known(name, at)).map(|(name, _)| name).collect()
}

fn bindings_of(module: &naga::Module) -> Vec<(String, naga::ResourceBinding)> {
    module.global_variables.iter().filter_map(|(_, v)| Some((v.name.clone()?, v.binding?))).collect()
}

#[test]
fn bindings_have_one_number_in_both_languages() {
    let mut seen = std::collections::BTreeSet::new();
    for key in all_keys() {
        for variant in [RaycastVariant::Exact, RaycastVariant::Hardware] {
            let module = march(variant, key);
            assert_eq!(wrong_bindings(&module), [""; 0], "{key:?}");
            seen.extend(bindings_of(&module).into_iter().map(|(name, _)| name));
            let entry = &module.entry_points[0];
            assert_eq!((entry.name.as_str(), module.entry_points.len()), ("march", 1));
            assert_eq!(entry.workgroup_size.iter().product::<u32>(), WORKGROUP_PIXELS * WORKGROUP_PIXELS);
        }
    }
    let named = MARCH.iter().flat_map(|Binding { names, .. }| *names);
    assert_eq!(named.map(|&name| name.to_owned()).collect::<std::collections::BTreeSet<_>>(), seen);
}

/// Two that changed places, and one that is new.
#[test]
fn the_comparison_of_bindings_can_fail() {
    let good = march_wgsl(RaycastVariant::Exact, KernelKey::PLAIN);
    let swapped = good.replace("@binding(3) var region_table", "@binding(4) var region_table");
    assert_eq!(wrong_bindings(&parse(&swapped)), ["region_table"]);
    let more = format!("@group(2) @binding(9) var unheard_of: texture_3d<u32>;\n{good}");
    assert_eq!(wrong_bindings(&parse(&more)), ["unheard_of"]);
}
