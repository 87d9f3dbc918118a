use super::*;

const PLAIN: &str =
    r#"{"position": [60, 30, 80], "focalPoint": [11.5, 11.5, 11.5], "viewUp": [0, 1, 0], "viewAngle": 40}"#;

fn with(extra: &str) -> String {
    PLAIN.replacen('{', &format!("{{{extra}, "), 1)
}

fn camera(text: &str) -> (Camera, Vec<String>) {
    read("c.json", text).unwrap_or_else(|error| panic!("{text}: {error}"))
}

fn refused(text: &str) -> String {
    let error = read("c.json", text).unwrap_err().to_string();
    assert!(error.contains("c.json") || error.starts_with("camera "), "{error}");
    error
}

#[test]
fn viewers_states_are_the_same_camera() {
    let want = camera(PLAIN).0;
    let identity = "[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]";
    let states = [
        with(
            r#""clippingRange": [1, 500], "useHorizontalViewAngle": false, "vtkClass": "vtkCamera", "parallelScale": 12"#,
        ),
        with(
            r#""directionOfProjection": [0, 0, -1], "windowCenter": [0, 0], "projectionMatrix": null, "thickness": 499"#,
        ),
        with(&format!(r#""modelTransformMatrix": {identity}, "useOffAxisProjection": 0, "viewShear": [0, 0, 1]"#)),
        r#"{"CameraPosition": [60, 30, 80], "CameraFocalPoint": [11.5, 11.5, 11.5], "CameraViewUp": [0, 1, 0],
            "CameraViewAngle": 40, "CameraParallelProjection": 0, "CameraParallelScale": 3}"#
            .to_owned(),
        PLAIN.replace("focalPoint", "focal_point").replace("viewAngle", "view_angle").replace("viewUp", "ViewUp"),
        format!(r#"{{"acceleration": {{"leap": "off"}}, "camera": {PLAIN}, "complete": true, "size": [9, 9]}}"#),
        format!("\u{feff}{PLAIN}"),
    ];
    for state in states {
        assert_eq!(camera(&state), (want, vec![]), "{state}");
    }
}

#[test]
fn parallel_views_keep_their_scale_and_need_no_angle() {
    let state = with(r#""parallelProjection": 1, "parallelScale": 12, "useHorizontalViewAngle": true"#);
    assert_eq!(camera(&state).0.projection(), crate::Projection::Parallel { parallel_scale: 12.0 });
}

#[test]
fn of_a_sequence_the_first_camera_is_taken_and_that_is_told() {
    let far = PLAIN.replace("80", "180");
    for text in [format!(r#"{{"frames": [{{"camera": {PLAIN}}}, {{"camera": {far}}}]}}"#), format!("[{PLAIN}, {far}]")]
    {
        let (got, notes) = camera(&text);
        assert_eq!(got, camera(PLAIN).0);
        assert!(matches!(&notes[..], [note] if note.contains("2 cameras, the first")), "{notes:?}");
    }
}

#[test]
fn what_would_change_the_picture_is_refused_by_name() {
    for (extra, word) in [
        (
            r#""useHorizontalViewAngle": true"#,
            "\"useHorizontalViewAngle\" = true would change the picture: give viewAngle",
        ),
        (r#""windowCenter": [0.5, 0]"#, "windowCenter"),
        (r#""useOffAxisProjection": 1"#, "useOffAxisProjection"),
        (r#""eyeTransformMatrix": [[0,1,0,0],[1,0,0,0],[0,0,1,0],[0,0,0,1]]"#, "eyeTransformMatrix"),
        (r#""projectionMatrix": {"0": 2, "1": 0}"#, "projectionMatrix"),
        (r#""viewShear": [0.1, 0, 1]"#, "viewShear"),
        (r#""fov": 50"#, "call it viewAngle"),
        (r#""up": [0, 0, 1]"#, "call it viewUp"),
        (r#""CameraViewAngle": 41"#, "viewAngle is there twice"),
        (r#""parallelProjection": "yes", "a": 1"#, "true or false"),
    ] {
        let error = refused(&with(extra));
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn unknown_keys_are_left_aside_by_name() {
    let (got, notes) = camera(&with(r#""shininess\u001b[31m": 3, "clippingRange": [0, 1]"#));
    assert_eq!(got, camera(PLAIN).0);
    assert!(matches!(&notes[..], [note] if note.contains("shininess") && !note.contains('\u{1b}')), "{notes:?}");
}

#[test]
fn what_holds_no_camera_is_told() {
    for (text, word) in [
        ("{\n \"position\": [1, 2]}", "line 2"),
        ("3", "not a camera"),
        ("[]", "the list holds no camera"),
        ("[3]", "an object with position"),
        (r#"{"frames": []}"#, "the list holds no camera"),
        (r#"{"store": "x"}"#, "position"),
        (r#"{"position": [0, 0, 1], "vtkClass": "x"}"#, "focalPoint"),
        (r#"{"position": [0, 0, 1], "focalPoint": [0, 0, 1], "vtkClass": "x"}"#, "looks nowhere"),
    ] {
        let error = refused(text);
        assert!(error.contains(word), "{text}: {error}");
    }
    // Nothing that nests leads astray.
    let nested = format!("{}1{}", r#"{"camera": "#.repeat(100), "}".repeat(100));
    refused(&nested);
    refused(&"[".repeat(100_000));
}
