//! Evidence of ball after ball -> what is known of machine and air.
//!
//! A Kalman filter on eleven numbers ([`actuators`]) whose gain follows from covariance: a machine
//! that scatters half a metre is not chased. Around it stand the things a filter alone gets wrong:
//!
//! - **A ball may be odd**: a gust, a dead ball, a net cord, a wrong track. Each is a kind with a
//!   prior probability and a wider scatter ([`Oddity`]); the update is the mixture of all, so an
//!   odd ball is believed as far as it may be an ordinary one. Of the last two balls each kind
//!   stays open: the first ball of a session may be the dead one, and if two balls disagree a
//!   third tells which was odd.
//! - **Things change at once**: the wind turns, somebody knocks against the machine. With every
//!   ball the hypotheses "the air changed just now" and "the machine did" come up beside "nothing
//!   did", and live or die by what follows: Bayesian online change-point detection (Adams & MacKay
//!   2007) as a Gaussian sum, keyed by when each changed last. A gust dies out, a step wins within
//!   two or three balls.
//!
//! A ball's evidence may be silent in some directions ([`Causes`]); with Σ the covariance expected
//! of its causes and Λ its information, `M = (Λ + Σ⁻¹)⁻¹` is what is known of the causes
//! afterwards, and the evidence is worth `−½ ln|I + ΛΣ| − ½ rᵀ(Λ − ΛMΛ)r`. At most 168 such
//! steps of 11 by 11 a ball. Each looks at the evidence from where it takes the ball to have been
//! ([`Passage`]): seen from elsewhere a truth would be thought impossible.

use super::actuators::{self, DRAG, Design, Known, KnownMatrix, N_KNOWN, OFFSETS};
use crate::causes::{Cause, CauseColumn, CauseMatrix, Causes, Passage};

/// Hypotheses that are kept.
const N_MAX: usize = 24;

/// A hypothesis that is less likely than this is dropped.
const WEIGHT_MIN: f64 = 1e-6;

/// A hypothesis less likely than this expects the next ball to be an ordinary one and nothing to
/// change: likelier ones do that for it.
const FERTILE_MIN: f64 = 1e-3;

/// How likely the air, or the machine, is to have changed at any ball. A gust that lasts two balls
/// must not win, a step must within three or four.
const AIR_CHANGES: f64 = 0.002;
const MACHINE_CHANGES: f64 = 0.001;

/// What may change with a ball, and how likely: nothing, the air (0), the machine (1).
const CHANGES: [Option<(usize, f64)>; 3] =
    [None, Some((0, AIR_CHANGES)), Some((1, MACHINE_CHANGES))];

/// 1 sigma of such a change.
const AIR_CHANGE: [f64; 3] = [0.03, 2.5, 2.5];
const MACHINE_CHANGE: [f64; 4] = [0.02, 0.015, 0.015, 15.0];

/// Changes longer ago than this, in balls, are told apart no more.
const FORGOTTEN: u64 = 25;

/// Where a ball most likely was is found in so many steps.
const N_LOOKS: usize = 2;

/// Of what kind these last balls were is kept open: the next one may tell.
const N_OPEN: u32 = 2;

/// Bits that hold a kind's place in [`KINDS`].
const KIND_BITS: u32 = 3;

/// What kind of ball it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Oddity {
    /// As usual.
    None,
    /// A gust, or a ball with another felt than the others.
    Air,
    /// It left otherwise than others: dead, wet, caught by a wheel.
    Launch,
    /// Neither: a net cord, a wrong track.
    All,
}

/// A kind of ball.
struct Kind {
    oddity: Oddity,
    /// How likely it is.
    probability: f64,
    /// By which part of its speed it leaves slower, and 1 sigma of that.
    slower_parts: [f64; 2],
    /// 1 sigma that it adds: speed, elevation and azimuth, spin, drag, wind, release.
    sigmas: [f64; 6],
}

/// The ordinary one is the first.
///
/// A dead ball is a kind of its own, for it is an ordinary one in all but its speed. Were it one
/// of all that leave otherwise, the room these have in angles and spin would count against it: a
/// first ball 10 % slow would be a slow machine with 600 to 1; it is with 2 to 1. A ball bounces to
/// 135 to 147 cm by the ITF's rule; one that reaches 1.0 to 1.2 m comes off with √(1.1 / 1.41) of
/// the speed: 12 % less, ± 5 %.
const KINDS: [Kind; 5] = [
    kind(Oddity::None, 0.91, [0.0; 2], [0.0; 6]),
    kind(Oddity::Air, 0.04, [0.0; 2], [0.0, 0.0, 0.0, 0.05, 2.0, 0.0]),
    kind(Oddity::Launch, 0.03, [0.12, 0.05], [0.0; 6]),
    kind(Oddity::Launch, 0.01, [0.0; 2], [2.5, 0.03, 80.0, 0.0, 0.0, 0.0]),
    kind(Oddity::All, 0.01, [0.0; 2], [4.0, 0.1, 150.0, 0.2, 5.0, 0.3]),
];

const fn kind(oddity: Oddity, probability: f64, slower_parts: [f64; 2], sigmas: [f64; 6]) -> Kind {
    Kind { oddity, probability, slower_parts, sigmas }
}

/// What one ball was found to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Learned {
    /// Its causes, by all that is known, and their covariance.
    pub causes: CauseColumn,
    /// See `causes`.
    pub covariance: CauseMatrix,
    /// What it most likely was.
    pub oddity: Oddity,
    /// How likely it was an ordinary ball.
    pub ordinary: f64,
    /// How likely the air is to have changed with it.
    pub air_changed: f64,
    /// And the machine.
    pub machine_changed: f64,
    /// Mean square of each launch cause's scatter, if it was an ordinary ball.
    pub scatter_squares: [f64; 4],
}

#[derive(Debug, Clone, Copy)]
struct Hypothesis {
    weight: f64,
    mean: Known,
    covariance: KnownMatrix,
    key: Key,
}

/// By what hypotheses differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Key {
    /// At which ball the air changed last, and the machine.
    changed: [u64; 2],
    /// Places in [`KINDS`] of the last balls, [`KIND_BITS`] each, the latest lowest.
    ///
    /// To know that a ball was odd is not enough: after a gust the machine is known as after any
    /// ball, after a dead ball it is not, and a mean of the two is neither.
    kinds: u32,
}

/// What is known of machine and air.
#[derive(Debug, Clone)]
pub struct Belief {
    hypotheses: Vec<Hypothesis>,
    n_balls: u64,
}

impl Default for Belief {
    fn default() -> Self {
        let (mean, covariance) = actuators::prior();
        let key = Key { changed: [0; 2], kinds: 0 };
        let first = Hypothesis { weight: 1.0, mean, covariance, key };
        Self { hypotheses: vec![first], n_balls: 0 }
    }
}

impl Belief {
    /// The mean over all hypotheses.
    #[must_use]
    pub fn mean(&self) -> Known {
        self.hypotheses.iter().map(|h| h.mean * h.weight).sum()
    }

    /// The covariance over all hypotheses.
    #[must_use]
    pub fn covariance(&self) -> KnownMatrix {
        let mean = self.mean();
        let of = |h: &Hypothesis| (h.covariance + square(&(h.mean - mean))) * h.weight;
        self.hypotheses.iter().map(of).sum()
    }

    /// Balls it has learned from.
    #[must_use]
    pub fn n_balls(&self) -> u64 {
        self.n_balls
    }

    /// Wind and drag are known less after a pause.
    pub fn paused(&mut self, pause_s: f64) {
        for hypothesis in &mut self.hypotheses {
            actuators::forget(pause_s, &mut hypothesis.mean, &mut hypothesis.covariance);
        }
    }

    /// Takes a ball in: what it says, what was told (`told + design · known` is expected), and how
    /// it scatters. None if the numbers are such that nothing can be said; then nothing changes.
    pub fn update(
        &mut self,
        evidence: &Passage,
        told: &CauseColumn,
        design: &Design,
        scatter: &CauseMatrix,
    ) -> Option<Learned> {
        let ball = Ball { evidence, told, design, scatter };
        let now = self.n_balls + 1;
        let mut children: Vec<Child> = Vec::with_capacity(self.hypotheses.len() * 6);
        for hypothesis in &self.hypotheses {
            let mut drifted = *hypothesis;
            drifted.covariance += actuators::drift();
            let is_fertile = hypothesis.weight >= FERTILE_MIN;
            let n_changes = if is_fertile { CHANGES.len() } else { 1 };
            for change in &CHANGES[..n_changes] {
                let mut parent = drifted;
                if let Some((what, rate)) = *change {
                    parent.weight *= rate;
                    parent.key.changed[what] = now;
                    parent.widen(what);
                }
                // A change and an odd ball at once would be found with the next ball as well.
                let n_kinds = if change.is_none() && is_fertile { KINDS.len() } else { 1 };
                for kind_idx in 0..n_kinds {
                    children.push(ball.seen_by(&parent, kind_idx)?);
                }
            }
        }
        let most = children.iter().map(|c| c.log_weight).fold(f64::MIN, f64::max);
        let mut sum = 0.0;
        for child in &mut children {
            child.hypothesis.weight = (child.log_weight - most).exp();
            sum += child.hypothesis.weight;
        }
        if !(sum.is_finite() && sum > 0.0) {
            return None;
        }
        children.iter_mut().for_each(|child| child.hypothesis.weight /= sum);
        let learned = learned_from(&children, now, &ball)?;
        self.n_balls = now;
        self.hypotheses = merged(&children, now);
        Some(learned)
    }
}

impl Hypothesis {
    /// Makes room for a change of the air (0) or the machine (1).
    fn widen(&mut self, what: usize) {
        let mut add = |i: usize, sigma: f64| self.covariance[(i, i)] += sigma * sigma;
        if what == 0 {
            AIR_CHANGE.into_iter().enumerate().for_each(|(i, sigma)| add(DRAG + i, sigma));
        } else {
            OFFSETS.into_iter().zip(MACHINE_CHANGE).for_each(|(i, sigma)| add(i, sigma));
        }
    }
}

/// A hypothesis and a kind of ball, after that ball.
struct Child {
    hypothesis: Hypothesis,
    log_weight: f64,
    oddity: Oddity,
    causes: CauseColumn,
    covariance: CauseMatrix,
    /// Of the causes expected, and its inverse times what they were off.
    expected: CauseMatrix,
    expected_inverse: CauseMatrix,
    off: CauseColumn,
}

struct Ball<'a> {
    evidence: &'a Passage,
    told: &'a CauseColumn,
    design: &'a Design,
    scatter: &'a CauseMatrix,
}

impl Ball<'_> {
    fn seen_by(&self, parent: &Hypothesis, kind_idx: usize) -> Option<Child> {
        let Self { evidence, told, design, scatter } = *self;
        let Kind { oddity, probability, slower_parts, sigmas } = KINDS[kind_idx];
        let mut before = told + design * parent.mean;
        let through = parent.covariance * design.transpose();
        let mut expected = design * through + scatter;
        add_oddity(&mut expected, &sigmas);
        let [slower_m_s, slower_sigma_m_s] = slower_parts.map(|part| part * before[SPEED]);
        before[SPEED] -= slower_m_s;
        expected[(SPEED, SPEED)] += slower_sigma_m_s * slower_sigma_m_s;
        let roots = expected.cholesky()?;
        let expected_inverse = roots.inverse();
        // Evidence is looked at from where the ball was, if it was of this kind; that is found from
        // what was expected of it.
        let look = |from: CauseColumn| {
            let (Causes { likely, information, .. }, apart) = evidence.seen_from(&from)?;
            let after = (information + expected_inverse).cholesky()?;
            let off = likely - before;
            let pull = information * off;
            let moved = after.solve(&pull);
            Some((after, moved, off.dot(&pull) - pull.dot(&moved) + apart))
        };
        let mut from = before;
        for _ in 0..N_LOOKS {
            let (_, moved, _) = look(from)?;
            from = before + moved;
        }
        let (after, moved, distance) = look(from)?;
        let covariance = after.inverse();
        let log_volume = log_determinant(&roots) + log_determinant(&after);
        let gain = through * expected_inverse;
        let mut hypothesis = *parent;
        hypothesis.key.kinds = parent.key.kinds << KIND_BITS | kind_idx as u32;
        hypothesis.mean += gain * moved;
        hypothesis.covariance -= gain * (expected - covariance) * gain.transpose();
        hypothesis.covariance = (hypothesis.covariance + hypothesis.covariance.transpose()) * 0.5;
        let log_weight =
            (parent.weight * probability).ln() - 0.5 * (distance.max(0.0) + log_volume);
        Some(Child {
            hypothesis,
            log_weight,
            oddity,
            causes: before + moved,
            covariance,
            expected,
            expected_inverse,
            off: moved,
        })
    }
}

fn add_oddity(covariance: &mut CauseMatrix, [speed, angle, spin, drag, wind, release]: &[f64; 6]) {
    let sigmas = [speed, angle, angle, spin, spin, spin, drag, wind, wind, release, release];
    for (cause, sigma) in Cause::ALL.into_iter().zip(sigmas) {
        covariance[(cause.idx(), cause.idx())] += sigma * sigma;
    }
}

fn log_determinant(
    roots: &nalgebra::Cholesky<f64, nalgebra::Const<{ crate::causes::N_CAUSES }>>,
) -> f64 {
    2.0 * roots.l_dirty().diagonal().iter().map(|root| root.ln()).sum::<f64>()
}

fn square(off: &Known) -> KnownMatrix {
    off * off.transpose()
}

fn learned_from(children: &[Child], now: u64, ball: &Ball<'_>) -> Option<Learned> {
    let weight_of = |is_one: &dyn Fn(&Child) -> bool| -> f64 {
        children.iter().filter(|child| is_one(child)).map(|child| child.hypothesis.weight).sum()
    };
    let best =
        children.iter().max_by(|a, b| a.hypothesis.weight.total_cmp(&b.hypothesis.weight))?;
    let usual = children.iter().filter(|child| child.oddity == Oddity::None);
    let usual = usual.max_by(|a, b| a.hypothesis.weight.total_cmp(&b.hypothesis.weight))?;
    // What of the ball's own scatter is known: R Σ⁻¹ of what it was off, and what is left open.
    let share = ball.scatter * usual.expected_inverse;
    let own = share * usual.off;
    let open = ball.scatter - share * (usual.expected - usual.covariance) * share.transpose();
    Some(Learned {
        causes: best.causes,
        covariance: best.covariance,
        oddity: best.oddity,
        ordinary: weight_of(&|child| child.oddity == Oddity::None),
        air_changed: weight_of(&|child| child.hypothesis.key.changed[0] == now),
        machine_changed: weight_of(&|child| child.hypothesis.key.changed[1] == now),
        scatter_squares: std::array::from_fn(|i| own[i] * own[i] + open[(i, i)].max(0.0)),
    })
}

/// Children that say the same of changes become one with their mean and covariance; the likeliest
/// are kept.
fn merged(children: &[Child], now: u64) -> Vec<Hypothesis> {
    let mut merged: Vec<Hypothesis> = Vec::with_capacity(N_MAX);
    let mut keys: Vec<Key> = Vec::new();
    let key_of = |child: &Child| {
        let Key { changed, kinds } = child.hypothesis.key;
        let changed = changed.map(|at| if now - at > FORGOTTEN { 0 } else { at });
        Key { changed, kinds: kinds & ((1 << (KIND_BITS * N_OPEN)) - 1) }
    };
    for child in children {
        let key = key_of(child);
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    for key in keys {
        let same = || children.iter().filter(|child| key_of(child) == key).map(|c| &c.hypothesis);
        let weight: f64 = same().map(|h| h.weight).sum();
        if weight < WEIGHT_MIN {
            continue;
        }
        let mean: Known = same().map(|h| h.mean * (h.weight / weight)).sum();
        let of = |h: &Hypothesis| (h.covariance + square(&(h.mean - mean))) * (h.weight / weight);
        let covariance = same().map(of).sum();
        merged.push(Hypothesis { weight, mean, covariance, key });
    }
    merged.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    merged.truncate(N_MAX);
    let sum: f64 = merged.iter().map(|h| h.weight).sum();
    merged.iter_mut().for_each(|h| h.weight /= sum);
    merged
}

const SPEED: usize = Cause::Speed.idx();

const _: () = assert!(KINDS.len() <= 1 << KIND_BITS, "a kind's place fits into its bits");
const _: () = assert!(DRAG + AIR_CHANGE.len() == N_KNOWN, "drag and wind come last");
