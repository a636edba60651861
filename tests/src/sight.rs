//! Renderer, time -> where the ball is seen in a frame, and whether it can be.
//!
//! A label is the exact image of the ball's centre at the middle of the exposure of its row. It is
//! hard when less than half of the ball is left by the net and by whoever stands before it, when
//! the ball, or the 3 pixels around it that tell a whole ball from one that is cut, reach over the
//! edge of the picture, and after the second bounce, when the ball is dead and nobody asks for it.

use crate::camera::Camera;
use crate::cast::Cast;
use crate::renderer::Renderer;
use page::labels::Label;

/// A pixel looks one pixel around itself; another two show that the ball ends there.
const EDGE_PX: f64 = 3.0;
/// A ball of which less is seen is hard.
const VISIBLE_SHARE_MIN: f32 = 0.5;

impl Renderer {
    /// The label of a frame whose first row is exposed at `first_row_at_s`; `None` when the ball's
    /// centre is not in the picture.
    pub fn label_at(&self, first_row_at_s: f64) -> Option<Label> {
        let camera = self.camera_at(first_row_at_s);
        let seen_at = |at_s: f64| camera.pixel_from_court(&self.truth.position_in_court_m(at_s)?);
        // Its row says when it was exposed; a ball moves a fraction of a row meanwhile.
        let row_px = seen_at(first_row_at_s)?.y;
        let at_s = camera.row_exposed_at_s(first_row_at_s, row_px);
        let pixel = seen_at(at_s)?;
        let is_inside = |at_px: f64, n_px: usize| (0.0..=(n_px - 1) as f64).contains(&at_px);
        if !is_inside(pixel.x, camera.width_px) || !is_inside(pixel.y, camera.height_px) {
            return None;
        }
        let flight = self.truth.flights_between(at_s, at_s).last()?;
        let cast = Cast::new(&self.scenario, &self.truth, &camera, first_row_at_s);
        let shift_px = self.scenario.conditions.shake.shift_px(first_row_at_s);
        let open = |column, row| self.open(column, row, shift_px);
        let is_dead = flight.bounces.get(1).is_some_and(|bounce| bounce.bounced_at_s < at_s);
        let is_hard = is_dead
            || self.is_cut(&camera, at_s)
            || cast.visible_share(flight, open) < VISIBLE_SHARE_MIN;
        Some(Label { x_px: pixel.x, y_px: pixel.y, is_hard })
    }

    /// Does the ball, blurred by its motion, reach over the edge?
    fn is_cut(&self, camera: &Camera, at_s: f64) -> bool {
        let reaches_out = |at_s: f64| {
            let Some(center) = self.truth.position_in_court_m(at_s) else { return false };
            let Some(pixel) = camera.pixel_from_court(&center) else { return true };
            let distance_m = (center - camera.position_in_court_m).norm();
            let radius_px = camera.focal_px[0] * self.scenario.world.ball_radius_m / distance_m;
            let margin_px = radius_px + EDGE_PX;
            let is_in = |at_px: f64, n_px: usize| {
                (margin_px..=(n_px - 1) as f64 - margin_px).contains(&at_px)
            };
            !is_in(pixel.x, camera.width_px) || !is_in(pixel.y, camera.height_px)
        };
        let half_s = 0.5 * camera.exposure_s;
        reaches_out(at_s - half_s) || reaches_out(at_s) || reaches_out(at_s + half_s)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::camera::Side;
    use crate::person::Walk;
    use crate::scenario::Scenario;
    use crate::truth::Truth;

    fn labels(change: impl Fn(&mut Scenario)) -> Vec<(f64, Label)> {
        let mut scenario = Scenario::thesis_shot();
        change(&mut scenario);
        let truth = Truth::from_scenario(&scenario);
        let renderer = Renderer::new(&scenario, &truth, Side::Left);
        let at = (60..180).map(|k| f64::from(k) / 90.0);
        at.filter_map(|at_s| Some((at_s, renderer.label_at(at_s)?))).collect()
    }

    #[test]
    fn a_ball_is_hard_only_where_the_picture_cuts_it() {
        let labels = labels(|_| ());
        assert!(labels.len() > 60, "{}", labels.len());
        let n_hard = labels.iter().filter(|(_, label)| label.is_hard).count();
        assert!(n_hard < 6, "{n_hard} of {}", labels.len());
    }

    #[test]
    fn a_ball_behind_the_tape_is_hard_and_one_behind_the_mesh_is_not() {
        let labels = labels(|s| {
            s.launches[0].position_in_court_m = Point3::new(1.0, 12.0, 2.0);
            s.launches[0].speed_m_s = 0.0;
        });
        let hard: Vec<bool> = labels.iter().map(|(_, label)| label.is_hard).collect();
        let changes = hard.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert!(changes >= 2 && !hard[0], "{hard:?}");
    }

    #[test]
    fn somebody_who_stands_before_a_ball_hides_it() {
        let ball = Point3::new(1.0, 20.0, 1.2);
        let labels = labels(|s| {
            s.launches[0].position_in_court_m = ball;
            s.launches[0].speed_m_s = 0.0;
            let eye = s.rig.left.position_in_court_m;
            // On the line of sight, three metres nearer, and slow.
            let at = ball - (ball - eye) * (3.0 / (ball - eye).norm());
            s.conditions.people.push(Walk {
                from_in_court_m: nalgebra::Point2::new(at.x - 0.02, at.y),
                to_in_court_m: nalgebra::Point2::new(at.x + 2.0, at.y),
                starts_at_s: 0.0,
                speed_m_s: 0.02,
                height_m: 1.8,
            });
        });
        assert!(labels[0].1.is_hard, "{:?}", labels[0]);
    }
}
