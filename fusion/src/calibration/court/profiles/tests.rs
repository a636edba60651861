use super::*;
use crate::calibration::court::drawn::seen_court;
use crate::calibration::court::paint;
use crate::pretend;
use shm_layout::Camera;

#[test]
fn pieces_lie_where_the_lines_are_whatever_the_ground_on_either_side() {
    let rig = pretend::reference_rig();
    let pose = rig.tracking_from(Camera::Left);
    let lens = rig.eye(Camera::Left).lens;
    let lines = paint::lines(0.1, 0.05);
    let picture = seen_court(&lens, &pose, &lines);
    // Expected a third of a pixel off, and found where they are all the same.
    let off = crate::world::adjustment::moved(&pose, &[2.5e-4, -2.5e-4, 0.0, 0.0, 0.0, 0.0]);
    let view = View {
        picture: &picture,
        lens: &lens,
        court_from_camera: &off,
        within_px: 2.0,
        blur_px: 0.35,
        every: 1,
    };
    let pieces = from_view(&view, &lines);
    assert!(pieces.len() > 150, "{}", pieces.len());
    let mut seen = [0; paint::LINES];
    for (line_idx, line) in lines.iter().enumerate() {
        let offs: Vec<f64> = pieces
            .iter()
            .filter(|piece| piece.line_idx == line_idx)
            .map(|piece| {
                let point = pose.inverse() * line.at(piece.part);
                let raw = lens.raw_from_point(&point).unwrap();
                (piece.seen.x_px - raw.x_px) * piece.normal[0]
                    + (piece.seen.y_px - raw.y_px) * piece.normal[1]
            })
            .collect();
        seen[line_idx] = offs.len();
        if offs.is_empty() {
            continue;
        }
        let mean = offs.iter().sum::<f64>() / offs.len() as f64;
        println!("{}: {} pieces, {mean:+.3} px off in the mean", line.name, offs.len());
        assert!(mean.abs() < 0.03, "{}: {mean} px", line.name);
    }
    assert!(seen[2] > 30 && seen[3] > 30 && seen[6] > 10, "{seen:?}");
    assert_eq!(seen[0], 0, "the near baseline is under the camera");
}

#[test]
fn a_picture_without_lines_has_no_pieces() {
    let rig = pretend::reference_rig();
    let pose = rig.tracking_from(Camera::Left);
    let lens = rig.eye(Camera::Left).lens;
    let luma = (0..640 * 480).map(|i| (i * 7919 % 97) as f32).collect();
    let view = View {
        picture: &Picture::new(640, 480, luma),
        lens: &lens,
        court_from_camera: &pose,
        within_px: 2.0,
        blur_px: 0.4,
        every: 1,
    };
    let n = from_view(&view, &paint::lines(0.1, 0.05)).len();
    assert!(n < 3, "{n} pieces in noise");
}
