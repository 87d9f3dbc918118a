//! Where a header says that its volume lies.

use super::*;

fn notes_of(changes: &[(&str, &str)]) -> SourceHeader {
    let folder = Folder::new();
    read(&folder.write("x.nrrd", &[header(changes).as_bytes(), &bytes(Endian::Little)]), 4).unwrap().0
}

#[test]
fn vectors_become_spacing_and_directions() {
    let no = ("spacings", "");
    let straight = notes_of(&[
        no,
        ("s", "space: left-posterior-superior"),
        ("d", "space directions: (0.5,0,0) (0, 2,0)  (0,0,3)"),
        ("o", "space origin: (-1,2,1e1)"),
        ("u", "space units: \"mm\" \"mm\" \"mm\""),
    ]);
    assert_eq!(straight.geometry.spacing().to_array(), [0.5, 2.0, 3.0]);
    assert_eq!(straight.geometry.origin().to_array(), [-1.0, 2.0, 10.0]);
    assert_eq!((straight.space_unit.as_deref(), straight.notes.len()), (Some("mm"), 0));

    for (directions, spacing, columns, mirrored) in [
        ("(-1,0,0) (0,2,0) (0,0,3)", [1.0, 2.0, 3.0], [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], true),
        ("(0,0,2) (1,0,0) (0,1,0)", [2.0, 1.0, 1.0], [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], false),
        ("(3,4,0) (-4,3,0) (0,0,1)", [5.0, 5.0, 1.0], [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]], false),
    ] {
        let line = format!("space directions: {directions}");
        let turned = notes_of(&[no, ("d", &line), ("o", "space origin: (1,2,3)")]);
        assert_eq!(turned.geometry.spacing().to_array(), spacing, "{directions}");
        assert_eq!(turned.geometry.origin().to_array(), [1.0, 2.0, 3.0]);
        let want = glam::DMat3::from_cols_array_2d(&columns);
        assert!(turned.geometry.directions().abs_diff_eq(want, 1e-15), "{directions}");
        let told = turned.notes.iter().any(|n| n.contains("stored mirrored"));
        assert!(told == mirrored && turned.notes.len() == usize::from(mirrored), "{:?}", turned.notes);
    }
}

/// One and the same place in every space that has a name, long and short; unnamed ones are taken as they are.
#[test]
fn named_spaces_become_left_posterior_superior() {
    let of = |space: &str, directions: &str, origin: &str| {
        let (space, directions) = (format!("space: {space}"), format!("space directions: {directions}"));
        notes_of(&[("spacings", ""), ("s", &space), ("d", &directions), ("o", &format!("space origin: {origin}"))])
    };
    let (lps, lps_at) = ("(0,2,0) (-1,0,0) (0,0,-3)", "(10,20,0)");
    let want = of("left-posterior-superior", lps, lps_at);
    assert_eq!(want.geometry.origin().to_array(), [10.0, 20.0, 0.0]);
    for (space, directions, origin, told) in [
        ("LPS", lps, lps_at, 0),
        ("scanner-xyz", lps, lps_at, 0),
        ("3D-right-handed", lps, lps_at, 0),
        ("3D-left-handed", lps, lps_at, 0),
        ("right-anterior-superior", "(0,-2,0) (1,0,0) (0,0,-3)", "(-10,-20,0)", 1),
        ("RAS", "(0,-2,0) (1,0,0) (0,0,-3)", "(-10,-20,0)", 1),
        ("Left-Anterior-Superior", "(0,-2,0) (-1,0,0) (0,0,-3)", "(10,-20,0)", 1),
        ("LAS", "(0,-2,0) (-1,0,0) (0,0,-3)", "(10,-20,0)", 1),
        ("somewhere else", lps, lps_at, 1),
    ] {
        let got = of(space, directions, origin);
        assert_eq!(got.geometry, want.geometry, "{space}");
        // All are stored mirrored, which is said, too.
        assert_eq!(got.notes.len(), told + 1, "{space}: {:?}", got.notes);
    }
    let straight = notes_of(&[("s", "space: RAS"), ("m", "axis mins: 10 20 30")]).geometry;
    assert_eq!(straight.origin().to_array(), [-10.0, -20.0, 30.0]);
    assert_eq!(straight.directions().to_cols_array(), [-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn nearly_right_angles_are_set_right_and_told_and_shear_is_refused() {
    let of = |directions: &str| notes_of(&[("spacings", ""), ("d", &format!("space directions: {directions}"))]);
    let near = of("(0.00005,-1,0) (1,0,0.00005) (0,0,1)");
    assert_eq!(near.geometry.directions().to_cols_array(), [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    assert!(near.notes.len() == 1 && near.notes[0].contains("5.0e-5"), "{:?}", near.notes);
    let bent = of("(0.6,0.8,0) (-0.8,0.6,0.0009) (0,0,1)");
    assert!(bent.notes.len() == 1 && bent.notes[0].contains("moved by up to"), "{:?}", bent.notes);
    let decimals = of("(0.707106781,0.707106781,0) (-0.707106781,0.707106781,0) (0,0,1)");
    assert!(decimals.notes.is_empty(), "{:?}", decimals.notes);
    let refuses = |directions: &str, words: &[&str]| {
        let line = format!("space directions: {directions}");
        refused(&[header(&[("spacings", ""), ("d", &line)]).as_bytes(), &bytes(Endian::Little)], words);
    };
    refuses("(1,0,0) (0.5,1,0) (0,0,1)", &["space directions", "sheared", "63.43 (x, y)", "90.00 (y, z)"]);
    refuses("(1,0,0) (0,0,0) (0,0,1)", &["axis 1", "not zero"]);
    refuses("(1,0,0) (0,inf,0) (0,0,1)", &["axis 1", "finite"]);
    refuses("(1,0,0) (1,0,0) (0,0,1)", &["sheared", "0.00 (x, y)"]);
}

/// What a header says of its place, by which labels are compared with it.
#[test]
fn a_header_says_what_it_says() {
    let says = |changes: &[(&str, &str)]| {
        let p = notes_of(changes).placement;
        [p.spacing, p.origin, p.directions]
    };
    let no = ("spacings", "");
    assert_eq!(says(&[]), [true, false, false]);
    assert_eq!(says(&[no]), [false; 3]);
    assert_eq!(says(&[("spacings", "spacings: nan nan nan")]), [false; 3]);
    assert_eq!(says(&[no, ("d", "space directions: (1,0,0) (0,1,0) (0,0,1)")]), [true, false, true]);
    assert_eq!(says(&[("o", "space origin: (0,0,0)")]), [true, true, false]);
    assert_eq!(says(&[no, ("o", "axis mins: 0 0 0")]), [false, true, false]);
}

#[test]
fn unknown_spacing_and_fields_are_said() {
    let nan = notes_of(&[("spacings", "spacings: nan 2 NaN")]);
    assert_eq!(nan.geometry.spacing().to_array(), [1.0, 2.0, 1.0]);
    assert!(nan.notes[0].contains("nan 2 NaN"), "{:?}", nan.notes);
    assert!(notes_of(&[("spacings", "")]).notes[0].contains("spacing not said"));
    let typo = notes_of(&[("x", "spacigns: 4 4 4")]);
    assert!(typo.notes[0].contains("spacigns"), "{:?}", typo.notes);
    let units = notes_of(&[("u", "units: \"mm\" \"mm\" \"s\"")]);
    assert_eq!(units.space_unit, None);
    assert!(units.notes[0].contains("differ"), "{:?}", units.notes);
}

#[test]
fn axis_mins_are_the_origin_and_cells_begin_half_a_voxel_before_their_sample() {
    let nodes = notes_of(&[("m", "axis mins: 10 nan 30")]);
    assert_eq!(nodes.geometry.origin().to_array(), [10.0, 0.0, 30.0]);
    let cells = notes_of(&[("m", "axis mins: 10 20 30"), ("c", "centerings: cell node cell")]);
    assert_eq!(cells.geometry.origin().to_array(), [10.5, 20.0, 31.5]);
}
