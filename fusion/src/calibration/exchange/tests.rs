//! The fixtures were written by OpenCV 5.0.0 (`intrinsics.yml`, `extrinsics.yml`,
//! `left_camera.yml`), or hold OpenCV's `stereoRectify` of the same rig in the form of ROS and
//! its R and T in that of Kalibr.

use super::*;
use crate::pretend;
use nalgebra::Vector3;
use shm_layout::Camera;

const INTRINSICS: &str = include_str!("fixtures/intrinsics.yml");
const EXTRINSICS: &str = include_str!("fixtures/extrinsics.yml");
const LEFT: &str = include_str!("fixtures/left_camera.yml");
const ROS: [&str; 2] =
    [include_str!("fixtures/ros_left.yaml"), include_str!("fixtures/ros_right.yaml")];
const CAMCHAIN: &str = include_str!("fixtures/camchain.yaml");

const GIVEN: Given = Given { image_px: Some([640, 480]), is_mm: false };

fn documents(texts: &[&str]) -> Result<Vec<Document>, Refused> {
    let name = |i: usize| ["a.yml", "b.yml", "c.yml"][i];
    texts.iter().enumerate().map(|(i, text)| Document::parse(name(i), text)).collect()
}

fn of_both(texts: &[&str], given: &Given) -> Result<Imported, Refused> {
    rig_from(&Files { both: documents(texts)?, own: None }, given)
}

fn of_each(texts: [&str; 2], both: &[&str], given: &Given) -> Result<Imported, Refused> {
    let own = [Document::parse("left.yml", texts[0])?, Document::parse("right.yml", texts[1])?];
    rig_from(&Files { both: documents(both)?, own: Some(own) }, given)
}

/// What OpenCV was told to write.
fn assert_is_the_rig_of_opencv(rig: &Rig, tolerance: f64) {
    let [left, right] = Camera::BOTH.map(|camera| rig.eye(camera).lens);
    assert_eq!(left.image_px(), [640, 480]);
    assert_eq!(left.focal_px(), [1240.123456789012, 1239.9]);
    assert_eq!((left.center_px(), right.center_px()), ([319.5, 239.25], [321.1, 241.0]));
    assert_eq!(left.distortion(), [-0.21, 0.1, 1e-4, -2.5e-4, 0.0]);
    assert_eq!(right.distortion()[..4], [-0.2, 0.09, 0.0, 1e-7]);
    let moved = rig.right_from_left();
    let off_m = (moved.translation.vector - Vector3::new(-3.97, 0.02, 0.42)).norm();
    let turned = moved.rotation.scaled_axis() - Vector3::new(0.01, -0.2094395, 0.003);
    assert!(off_m <= tolerance && turned.norm() < 1e-12 + tolerance, "{off_m} {turned}");
}

#[test]
fn what_opencv_writes_is_read_to_the_last_bit() {
    let imported = of_both(&[INTRINSICS, EXTRINSICS], &GIVEN).unwrap();
    assert_eq!(imported.form, Form::OpenCv);
    assert_is_the_rig_of_opencv(&imported.rig, 0.0);
    assert_eq!(imported.rig.eye(Camera::Right).lens.distortion()[4], 0.01);
    let old = [INTRINSICS, EXTRINSICS].map(|text| text.replace("%YAML 1.2", "%YAML:1.0"));
    let again = of_both(&[&old[0], &old[1]], &GIVEN).unwrap();
    assert_eq!(again.rig, imported.rig);
}

#[test]
fn a_file_for_each_camera_brings_its_size_along() {
    let imported = of_each([LEFT, LEFT], &[EXTRINSICS], &Given::default()).unwrap();
    assert_eq!(imported.rig.eye(Camera::Left).lens.image_px(), [640, 480]);
    let fisheye = LEFT.replace("fisheye_model: 0", "fisheye_model: 1");
    let refused = of_each([LEFT, &fisheye], &[EXTRINSICS], &GIVEN).unwrap_err().to_string();
    assert_eq!(refused, "right.yml: `fisheye_model` is 1, expected a pinhole: k1 k2 p1 p2 k3");
}

#[test]
fn ros_knows_the_relation_by_both_rectifications() {
    let imported = of_each(ROS, &[], &Given::default()).unwrap();
    assert_eq!(imported.form, Form::Ros);
    assert_is_the_rig_of_opencv(&imported.rig, 1e-9);
}

#[test]
fn kalibr_names_no_left_and_needs_none() {
    let imported = of_both(&[CAMCHAIN], &Given::default()).unwrap();
    assert_eq!(imported.form, Form::Kalibr);
    assert_is_the_rig_of_opencv(&imported.rig, 0.0);
    // The same chain begun at the other end.
    let back = imported.rig.right_from_left().inverse();
    let m = back.to_homogeneous();
    let rows = [0, 1, 2]
        .map(|i| format!("  - [{}, {}, {}, {}]", m[(i, 0)], m[(i, 1)], m[(i, 2)], m[(i, 3)]));
    let (first, second) = CAMCHAIN.split_once("cam1:").unwrap();
    let (_, second) = second.split_once("- [0.0, 0.0, 0.0, 1.0]").unwrap();
    let relation = format!("  T_cn_cnm1:\n{}\n  - [0, 0, 0, 1]\n", rows.join("\n"));
    let chain = format!("cam0:{second}{}", first.replace("cam0:\n", &format!("cam1:\n{relation}")));
    let swapped = of_both(&[&chain], &Given::default()).unwrap();
    assert_is_the_rig_of_opencv(&swapped.rig, 1e-9);
    assert_eq!(swapped.notes, ["cam0 is the right camera, cam1 the left one"]);
}

#[test]
fn what_is_not_asked_for_does_no_harm() {
    let others = "  rolling: {y: 1, no: false, x: ~, on: .nan, t: [a, [1]]}\n";
    let text = format!("{CAMCHAIN}{others}");
    assert_is_the_rig_of_opencv(&of_both(&[&text], &Given::default()).unwrap().rig, 0.0);
}

#[test]
fn an_exported_rig_comes_back() {
    let imported = of_both(&[INTRINSICS, EXTRINSICS], &GIVEN).unwrap().rig;
    for rig in [imported, pretend::courtless_rig()] {
        let text = opencv::text_from(&rig);
        let back = of_both(&[&text], &Given::default()).unwrap().rig;
        assert_eq!(back.right_from_left(), rig.right_from_left());
        let lenses = |rig: &Rig| Camera::BOTH.map(|camera| rig.eye(camera).lens);
        assert_eq!(lenses(&back), lenses(&rig));
    }
    let wide = pretend::REFERENCE_RIG.replacen("[640, 480]", "[641, 480]", 1);
    let text = opencv::text_from(&wide.parse().unwrap());
    assert_eq!(
        of_both(&[&text], &Given::default()).unwrap().rig.eye(Camera::Left).lens.image_px(),
        [641, 480]
    );
}

#[test]
fn millimetres_are_noticed_and_taken_when_said() {
    let mm =
        EXTRINSICS.replace("-3.9700000000000002, 0.02, 0.41999999999999998", "-3970., 20., 420.");
    assert_ne!(mm, EXTRINSICS);
    let refused = of_both(&[INTRINSICS, &mm], &GIVEN).unwrap_err().to_string();
    assert!(refused.starts_with("b.yml: `T` is a baseline of 3992.2") && refused.contains("--mm"));
    let given = Given { is_mm: true, ..GIVEN };
    assert_is_the_rig_of_opencv(&of_both(&[INTRINSICS, &mm], &given).unwrap().rig, 1e-12);
}

/// Every refusal names the file, the key, and what was expected.
#[test]
fn what_is_no_rig_is_refused_by_file_and_key() {
    let swap = |from: &str, to: &str| {
        assert!(INTRINSICS.contains(from), "{from}");
        INTRINSICS.replacen(from, to, 1)
    };
    for (text, says) in [
        (swap("M1", "N1"), "a.yml, b.yml: `M1` is missing, expected the matrix of the left"),
        (swap("D2", "E2"), "a.yml, b.yml: `D2` is missing, expected the distortion of the right"),
        (swap("rows: 3", "rows: 4"), "a.yml: `M1.data` is 9 numbers, expected 12"),
        (swap("319.5", "2319.5"), "a.yml: `M1` is a matrix whose center (2319.5, 239.2) is out"),
        (swap("319.5", ".Nan"), "a.yml: `M1.data[2]` is \".Nan\", expected a finite number"),
        (swap("319.5", ".inf"), "a.yml: `M1.data[2]` is inf, expected a finite number"),
        (swap("319.5", "~"), "a.yml: `M1.data[2]` is empty, expected a finite number"),
        (swap("1240.1234567890119, 0.", "1240., 3."), "a.yml: `M1` is [[1240, 3, 319.5]"),
        (swap("1240.1234567890119", "-1240."), "a.yml: `left.focal_px` is [-1240.0, 1239.9]"),
        (format!("{INTRINSICS}R: 1\n"), "a.yml: `R` is given twice, the second time in b.yml"),
        ("<?xml version=\"1.0\"?>".to_owned(), "a.yml: XML, expected YAML"),
        ("M1: [1, 2".to_owned(), "a.yml: not a YAML map: "),
        ("just words".to_owned(), "a.yml: not a YAML map: "),
        ("[".repeat(100_000), "a.yml: not a YAML map: "),
        (" ".repeat(2 << 20), "a.yml: 2097152 bytes, expected at most 1 MiB"),
    ] {
        let refused = of_both(&[&text, EXTRINSICS], &GIVEN).unwrap_err().to_string();
        assert!(refused.starts_with(says), "{refused}\nexpected {says}");
    }
    let eight =
        INTRINSICS.replace("cols: 5", "cols: 8").replace("0. ]\nM2", "0., 1., 2., 3. ]\nM2");
    let refused = of_both(&[&eight, EXTRINSICS], &GIVEN).unwrap_err().to_string();
    assert!(
        refused.contains("`D1` is 8 numbers of a rational") && refused.contains("number 6 is 1")
    );
    let refused = of_both(&[INTRINSICS, EXTRINSICS], &Given::default()).unwrap_err().to_string();
    assert!(refused.contains("--size 640x480"), "{refused}");
    let refused = of_both(&[LEFT], &GIVEN).unwrap_err().to_string();
    assert!(refused.contains("--left FILE --right FILE"), "{refused}");
    let mirror = EXTRINSICS.replace("[ -3.9700000000000002", "[ 3.9700000000000002");
    let refused = of_both(&[INTRINSICS, &mirror], &GIVEN).unwrap_err().to_string();
    assert!(refused.contains("a right camera to the right"), "{refused}");
}

#[test]
fn other_models_are_refused_by_name() {
    for (from, to, says) in [
        ("radtan", "equidistant", "a.yml: `cam0.distortion_model` is \"equidistant\""),
        ("pinhole", "omni", "a.yml: `cam0.camera_model` is \"omni\""),
        ("[640, 480]", "[640.5, 480]", "a.yml: `cam0.resolution` is [640.5, 480]"),
        ("cam1", "cam2", "a.yml: `cam1` is missing"),
        ("T_cn_cnm1", "T_cam_imu", "a.yml: `cam1.T_cn_cnm1` is missing"),
    ] {
        let refused = of_both(&[&CAMCHAIN.replace(from, to)], &Given::default()).unwrap_err();
        assert!(refused.to_string().starts_with(says), "{refused}");
    }
    let [left, right] = ROS;
    let fish = right.replace("plumb_bob", "equidistant");
    let refused = of_each([left, &fish], &[], &Given::default()).unwrap_err().to_string();
    assert!(refused.starts_with("right.yml: `distortion_model` is \"equidistant\""), "{refused}");
    let refused = of_each([left, left], &[], &Given::default()).unwrap_err().to_string();
    assert!(refused.contains("`projection_matrix` is one without a baseline"), "{refused}");
    let given = Given { image_px: Some([1280, 960]), is_mm: false };
    let refused = of_each(ROS, &[], &given).unwrap_err().to_string();
    assert!(refused.starts_with("left.yml: `image_width` is 640x480, expected 1280x960"));
}
