//! What a real court has besides sun, noise and trees, as plain data: all of it off by default.
//!
//! Each part is described, and worked out, in the file of its name. A scenario whose conditions are
//! the default ones is rendered as if this file were not there, bit for bit.

use crate::bird::BirdFlight;
use crate::daylight::Daylight;
use crate::grain::Grain;
use crate::haze::Haze;
use crate::lamps::Lamps;
use crate::overcast::Overcast;
use crate::person::Walk;
use crate::shade::MovingShade;
use crate::shake::Shake;
use crate::stray_ball::StrayBall;

/// Everything that makes balls hard to find.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Conditions {
    /// What a video encoder leaves: noise with neighbours alike.
    pub grain: Grain,
    /// Lamps that flicker with the mains.
    pub lamps: Lamps,
    /// Clouds, and an exposure that is set anew.
    pub daylight: Daylight,
    /// Patches of shade that move over the ground.
    pub shade: MovingShade,
    /// A veil of light over the picture.
    pub haze: Haze,
    /// A bright sky that lights balls from above.
    pub overcast: Overcast,
    /// How much brighter than the ground around it a ball is, in grey levels, in place of what
    /// light and felt would give.
    pub ball_contrast_grey: Option<f64>,
    /// A camera that does not stand still.
    pub shake: Shake,
    /// Who walks by.
    pub people: Vec<Walk>,
    /// What flies by.
    pub birds: Vec<BirdFlight>,
    /// Balls that nobody plays with.
    pub stray_balls: Vec<StrayBall>,
}

impl Conditions {
    /// True when there is nothing of all this.
    pub fn are_calm(&self) -> bool {
        *self == Self::default()
    }
}
