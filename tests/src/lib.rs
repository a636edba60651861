//! A court that is not there, and what is played on it.
//!
//! Everything that pretends lives in this room, and it enters the system by the doors that real
//! cameras use: frames in shared memory, files in a shot folder. Read in this order: a seed becomes
//! a [`scenario`] in a [`world`]; the ball accelerates through the air ([`acceleration`]) and
//! leaves the ground ([`rebound`]), which makes the [`truth`]; a [`camera`] looks at a [`court`],
//! its [`net`] and its [`surroundings`] ([`texture`] gives them grain), which makes the
//! [`background`]; balls ([`spot`], [`ball_image`]) and sensor [`noise`] on it, with
//! [`swaying_trees`] on a windy day, make the frames ([`renderer`]), and those a [`shot_folder`].
//!
//! A real court has more ([`conditions`]): [`lamps`], [`daylight`] that changes, an [`overcast`]
//! sky, moving [`shade`], [`haze`], the [`grain`] of an encoder, a camera that is not still
//! ([`shake`]); a [`person`] or a [`bird`] comes by ([`figure`] draws both), a [`stray_ball`] lies
//! about. [`cast`] says who is in a frame, [`conditioned`] renders it, [`sight`] labels the ball.
//! [`scenes`] gives names to what is hard about a court, [`scene_table`] says how a detector fares,
//! a [`contact_sheet`] shows it.
//!
//! [`player`] plays a scenario into shared memory, [`processes`] and [`chain`] start the real
//! binaries, on [`hosts`] of a network that is as bad as asked; [`link`] measures what gets
//! through. A person says where the ball is in a clip (`page::labels`); [`evaluation`] and
//! [`overlay`] say and show how well balls are found there.
//!
//! A [`witness`] keeps an account of every frame; [`kills`] says how soon a board goes on without
//! one of its processes, [`faults`] how a whole court takes whatever is done to it. [`progress`] is
//! what long work says of itself.
//!
//! [`accuracy`] says how well `fusion` measures shots, from candidates and from pixels; [`courts`]
//! how well rigs are calibrated from a court's lines; [`bumped`] how soon `fusion` notices that a
//! camera was turned; [`sessions`] how soon a [`machine`] that is off hits its targets, when it is
//! corrected by what was measured.
//!
//! Deliberately absent: any code shared with the estimator. Physics and projection are written
//! anew here, so that both can only agree by both being right.
#![forbid(unsafe_code)]

// In the order of the chain; the blank lines keep rustfmt from sorting them.
pub mod scenario;

pub mod conditions;

pub mod world;

pub mod acceleration;

pub mod rebound;

pub mod truth;

pub mod camera;

pub mod texture;

pub mod court;

pub mod net;

pub mod surroundings;

pub mod background;

pub mod lamps;

pub mod daylight;

pub mod overcast;

pub mod shake;

pub mod haze;

pub mod grain;

pub mod shade;

pub mod stray_ball;

pub mod figure;

pub mod person;

pub mod bird;

pub mod spot;

pub mod ball_image;

pub mod noise;

pub mod swaying_trees;

pub mod cast;

pub mod conditioned;

pub mod renderer;

pub mod sight;

pub mod shot_folder;

pub mod player;

pub mod hosts;

pub mod processes;

pub mod chain;
pub mod club;

pub mod witness;

pub mod progress;

pub mod kills;

pub mod faults;

pub mod link;

pub mod latency;

pub mod evaluation;

pub mod overlay;

pub mod scenes;

pub mod scene_table;

pub mod contact_sheet;

pub mod accuracy;

pub mod bumped;
pub mod courts;

pub mod machine;

pub mod sessions;
