//! Sessions in a closed loop: a machine that is off, two cameras, `fusion`, a controller.
//!
//! Read in this order: the [`targets`]; a [`scene`] makes a plan of a seed; [`played`] plays it
//! with one of the [`controllers`], [`sighted`] by cameras (at candidate level, or rendered) and
//! [`watched`] by `fusion`; [`figures`] makes numbers of many sessions, [`table`] the text. Two
//! threads share the sessions. [`served`] plays frames to a `fusion` that is a process.
//!
//! All controllers of a comparison play the same machine with the same chances.

pub mod targets;

pub mod scene;

pub mod controllers;

pub mod sighted;
pub mod watched;

pub mod played;

pub mod served;

pub mod practice;

pub mod figures;

pub mod table;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use crate::machine::actuators::Build;
use crate::scene_table::Backgrounds;
use played::Session;
use scene::{Plan, Scene};
use sighted::{Eyes, Rendered};

/// Threads that play sessions.
const N_THREADS: usize = 2;

/// What is played with many seeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variant {
    /// What the sessions meet.
    pub scene: Scene,
    /// The machine's kind.
    pub build: Build,
    /// Name of the controller.
    pub controller: &'static str,
    /// Whether frames are rendered, and shown to workers.
    pub is_rendered: bool,
}

/// How many sessions, and how long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Amount {
    /// Sessions of each variant.
    pub n_sessions: usize,
    /// Balls of each session.
    pub n_balls: usize,
    /// The first session's seed; each other one has the next.
    pub first_seed: u64,
}

/// Plays all sessions of all variants; `progress` hears what is begun. They come in order.
///
/// # Panics
/// When a thread did, or a controller is not known.
pub fn all(
    variants: &[Variant],
    amount: &Amount,
    progress: impl Fn(&str) + Sync,
) -> Vec<Vec<Session>> {
    let jobs: Vec<(usize, u64)> = (0..variants.len())
        .flat_map(|idx| (0..amount.n_sessions as u64).map(move |k| (idx, amount.first_seed + k)))
        .collect();
    let next = AtomicUsize::new(0);
    let backgrounds = Arc::new(Backgrounds::default());
    let done = Mutex::new(vec![None; jobs.len()]);
    let work = || {
        loop {
            let idx = next.fetch_add(1, Ordering::Relaxed);
            let Some(&(variant_idx, seed)) = jobs.get(idx) else { break };
            let variant = &variants[variant_idx];
            if seed == amount.first_seed {
                let Variant { scene, build, controller, is_rendered } = variant;
                let pixels = if *is_rendered { ", rendered" } else { "" };
                let scene = scene.name();
                progress(&format!("{scene}, {} machine, {controller}{pixels} …", build.name));
            }
            let session = one(variant, seed, amount.n_balls, &backgrounds);
            done.lock().expect("no thread panicked")[idx] = Some(session);
        }
    };
    std::thread::scope(|threads| {
        (1..N_THREADS).for_each(|_| drop(threads.spawn(work)));
        work();
    });
    let mut by_variant: Vec<Vec<Session>> = variants.iter().map(|_| Vec::new()).collect();
    for ((variant_idx, _), session) in
        jobs.into_iter().zip(done.into_inner().expect("no thread panicked"))
    {
        by_variant[variant_idx].push(session.expect("every session was played"));
    }
    by_variant
}

/// One session of a variant.
///
/// # Panics
/// When the controller is not known.
pub fn one(
    variant: &Variant,
    seed: u64,
    n_balls: usize,
    backgrounds: &Arc<Backgrounds>,
) -> Session {
    let plan = Plan::drawn(seed, variant.scene, variant.build, n_balls);
    let controller = controllers::from_name(variant.controller, &variant.build);
    let mut controller = controller.expect("a known controller");
    let eyes = if variant.is_rendered {
        let scenario = sighted::scenario(seed, true);
        Eyes::Rendered(Box::new(Rendered::new(&scenario, Arc::clone(backgrounds))))
    } else {
        Eyes::Drawn
    };
    played::session(&plan, controller.as_mut(), eyes)
}

#[cfg(test)]
mod tests;
