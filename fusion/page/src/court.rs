//! Rig and machine -> the court as the page draws it.

use crate::views::{Court, Net};
use fusion::Rig;
use fusion::aim::Machine;
use fusion::calibration::court::{Settings, paint};
use fusion::world::court::{
    DOUBLES_HALF_WIDTH_M, LENGTH_M, NET_CENTER_HEIGHT_M, NET_POST_HEIGHT_M, NET_Y_M,
};
use shm_layout::Camera;

/// Net posts stand this far outside the doubles lines (ITF rule 1).
const POST_OUTSIDE_M: f64 = 0.914;
/// Length of a centre mark (ITF rule 1).
const CENTRE_MARK_M: f64 = 0.1;

/// The middle of every painted line, as a calibration looks for it, and the centre marks.
#[must_use]
pub fn lines_m() -> Vec<[[f64; 2]; 2]> {
    let Settings { baseline_m, others_m, .. } = Settings::default();
    let lines = paint::lines(baseline_m, others_m);
    let ends = lines.iter().map(|line| [0.0, 1.0].map(|part| line.at(part).xy().coords.into()));
    let far = LENGTH_M;
    let marks = [[[0.0, 0.0], [0.0, CENTRE_MARK_M]], [[0.0, far - CENTRE_MARK_M], [0.0, far]]];
    ends.chain(marks).collect()
}

/// What stands still.
#[must_use]
pub fn court_from(name: &str, rig: Option<&Rig>, machine: Option<&Machine>) -> Court {
    let post_x_m = DOUBLES_HALF_WIDTH_M + POST_OUTSIDE_M;
    let of_rig = rig.and_then(Rig::launcher_in_court_m);
    let launcher = machine.map(|machine| machine.launcher_in_court_m).or(of_rig);
    let cameras = rig.and_then(|rig| {
        let court_from_left = rig.court_from_left()?;
        let place = |camera| {
            let left_from_camera = match camera {
                Camera::Left => return court_from_left.translation.vector.into(),
                Camera::Right => rig.right_from_left().inverse(),
            };
            (court_from_left * left_from_camera).translation.vector.into()
        };
        Some(Camera::BOTH.map(place).to_vec())
    });
    Court {
        name: name.to_owned(),
        lines_m: lines_m(),
        net: Net {
            y_m: NET_Y_M,
            posts_x_m: [-post_x_m, post_x_m],
            height_post_m: NET_POST_HEIGHT_M,
            height_center_m: NET_CENTER_HEIGHT_M,
        },
        launcher_m: launcher.map(|place| place.coords.into()),
        cameras_m: cameras.unwrap_or_default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_court_is_that_of_the_rules() {
        let court = court_from("rose", None, None);
        assert_eq!(court.lines_m.len(), 11);
        assert!((court.net.y_m - 11.885).abs() < 1e-9 && court.cameras_m.is_empty());
        // 10.97 m wide for doubles, and 0.914 m more to each post.
        assert!((court.net.posts_x_m[1] - court.net.posts_x_m[0] - 12.798).abs() < 1e-9);
    }

    #[test]
    fn cameras_stand_where_the_rig_says() {
        let text = include_str!("../../rigs/desk.toml");
        let rig = Rig::from_file_text("desk.toml", text).unwrap();
        let on_no_court = court_from("rose", Some(&rig), None);
        assert_eq!(
            on_no_court.cameras_m.len(),
            if rig.court_from_left().is_some() { 2 } else { 0 }
        );
    }
}
