//! What was known before, and the evidence of the last shots -> which camera has turned, and how
//! sure that is.
//!
//! Stories: the left camera has turned, the right one has, both have, about all of the camera's x,
//! y and z; or one of them about one of these. The evidence G, W of the last shots is `G = −W (δ +
//! H t) + noise`; δ is what was believed of the rig, of light and of the air, with its covariance.
//! Each story's odds against "nothing has turned" are the ratio of likelihoods with the turn
//! averaged over what a bump may be (Bayes factor), so that three numbers are no excuse. Odds of c
//! are exceeded by chance once in c (Markov), whatever the flights tell.

use crate::calibration::belief::Belief;
use crate::flight::evidence::{Evidence, SharedColumn, SharedMatrix};
use crate::world::adjustment::{OPTICS, RIG, RigCovariance, RigStep, first_of};
use nalgebra::{Cholesky, DMatrix, DVector};
use shm_layout::Camera;

/// 1 sigma of a bump, each axis: 0.1°. More is bent out of shape, less does not matter.
const BUMP_SIGMA_RAD: f64 = 1.7e-3;

/// Who has turned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Who {
    /// One camera alone.
    One(Camera),
    /// Both, each its own way.
    Both,
}

impl Who {
    /// Everybody.
    pub const ALL: [Self; 3] = [Self::One(Camera::Left), Self::One(Camera::Right), Self::Both];
}

/// Who has turned, and about which axis if it is but one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Story {
    /// Who.
    pub who: Who,
    /// x, y or z of the camera; None is all three.
    pub axis: Option<usize>,
}

impl Story {
    /// All three turns of both.
    pub const ANY: Self = Self { who: Who::Both, axis: None };

    /// All stories: any turn of one or of both, and one turn of one.
    pub fn all() -> impl Iterator<Item = Self> {
        let of_one = Camera::BOTH.into_iter().flat_map(|camera| {
            let axes = [None, Some(0), Some(1), Some(2)];
            axes.map(|axis| Self { who: Who::One(camera), axis })
        });
        of_one.chain([Self::ANY])
    }

    fn places(self) -> Vec<usize> {
        let cameras: &[Camera] = match &self.who {
            Who::One(camera) => std::slice::from_ref(camera),
            Who::Both => &Camera::BOTH,
        };
        let axes = self.axis.map_or(0..3, |axis| axis..axis + 1);
        let turns = |camera: &Camera| first_of(*camera) + OPTICS;
        cameras.iter().flat_map(|c| axes.clone().map(move |axis| turns(c) + axis)).collect()
    }
}

/// A story, and how well it fits.
#[derive(Debug, Clone, PartialEq)]
pub struct Turn {
    /// Which.
    pub story: Story,
    /// Logarithm of the odds against "nothing has turned".
    pub log_odds: f64,
    /// How much: a change of the rig that has turns alone.
    pub step: RigStep,
    /// Its covariance.
    pub covariance: RigCovariance,
    /// Squared distance from no turn, in sigmas.
    pub square: f64,
}

/// The last shots, without what was believed before.
pub struct News {
    information: SharedMatrix,
    pull: SharedColumn,
}

impl News {
    /// None if it can not be solved.
    #[must_use]
    pub fn new(before: &Belief, evidence: &Evidence) -> Option<Self> {
        let Evidence { information, gradient } = evidence;
        let after = before.updated(evidence)?.covariance();
        let surprise = gradient + information * before.mean();
        Some(Self {
            information: information - information * after * information,
            pull: information * (after * surprise) - surprise,
        })
    }

    /// How well a story fits; None if it can not be told.
    #[must_use]
    pub fn turn_of(&self, story: Story) -> Option<Turn> {
        let places = story.places();
        let n = places.len();
        let told = DMatrix::from_fn(n, n, |i, j| self.information[(places[i], places[j])]);
        let told = (&told + told.transpose()) * 0.5;
        let pull = DVector::from_fn(n, |i, _| self.pull[places[i]]);
        let bump = BUMP_SIGMA_RAD.powi(-2);
        let whole = Cholesky::new(told + DMatrix::identity(n, n) * bump)?;
        let turn = whole.solve(&pull);
        let covariance = whole.inverse();
        // det(I + τ² F) of F + τ⁻² I.
        let log_det =
            2.0 * whole.l().diagonal().iter().map(|v| v.ln()).sum::<f64>() - n as f64 * bump.ln();
        let square = pull.dot(&turn);
        let mut step = RigStep::zeros();
        let mut wide = RigCovariance::zeros();
        for (i, &row) in places.iter().enumerate() {
            step[row] = turn[i];
            for (j, &column) in places.iter().enumerate() {
                wide[(row, column)] = covariance[(i, j)];
            }
        }
        const { assert!(OPTICS + 3 <= RIG) };
        let log_odds = 0.5 * (square - log_det);
        log_odds.is_finite().then_some(Turn { story, log_odds, step, covariance: wide, square })
    }

    /// The story that fits best of those about somebody, or of all.
    #[must_use]
    pub fn best(&self, who: Option<Who>) -> Option<Turn> {
        let asked = Story::all().filter(|story| who.is_none_or(|who| story.who == who));
        let all = asked.filter_map(|story| self.turn_of(story));
        all.max_by(|a, b| a.log_odds.total_cmp(&b.log_odds))
    }
}

/// All stories at once, each as likely as its odds have it; named after the likeliest.
#[must_use]
pub fn averaged(stories: &[Turn]) -> Option<Turn> {
    let best = stories.iter().max_by(|a, b| a.log_odds.total_cmp(&b.log_odds))?;
    let weights = stories.iter().map(|turn| (turn.log_odds - best.log_odds).exp());
    let sum: f64 = weights.clone().sum();
    let mut all = Turn { step: RigStep::zeros(), covariance: RigCovariance::zeros(), ..*best };
    for (turn, weight) in stories.iter().zip(weights.clone()) {
        all.step += turn.step * (weight / sum);
    }
    for (turn, weight) in stories.iter().zip(weights) {
        let apart = turn.step - all.step;
        all.covariance += (turn.covariance + apart * apart.transpose()) * (weight / sum);
    }
    Some(all)
}
