//! What is known before play: the court, the ball, the two cameras and where they stand.
//!
//! ```text
//!   court (metres)                           left, right (metres, OpenCV)
//!
//!            far baseline y = 23.77                    z forward
//!     ┌─────────────────────────────┐                 ↗
//!     │                             │           centre ───→ x right
//!     │                             │                 │
//!     ├──────── net y = 11.885 ─────┤                 ↓ y down
//!     │             y               │
//!     │             ↑               │           raw        pixels as captured, distorted
//!     │             │               │           rectified  pixels after rectification
//!     └─────────────┼───→ x ────────┘           (0,0) is the centre of the top-left pixel
//!      left ▲    origin     ▲ right
//!              (z up, ground z = 0)
//! ```
//!
//! **One convention for poses**: `x_cam = R (X_court − C)`, and so `X_court = Rᵀ x_cam + C`, where
//! `C` is the optical centre in court. Transforms are named result first: `court_from_left` holds
//! the rotation `Rᵀ` and the translation `C`. The thesis composed them the other way round,
//! `R (p + T)`, and lost `h·sin 10° = 0.608` m with `h = 3.5` m (see [`rig`], tests).
//!
//! **tracking**: the frame the pipeline works in: `court` if the rig says where the court is,
//! otherwise `left`. Without a court nothing is known of gravity or the ground.

pub mod acceleration;
pub mod adjustment;
pub mod air;
pub mod ball;
pub mod camera;
pub mod court;
pub mod rebound;
pub mod rectification;
pub mod rig;
mod rig_toml;
pub mod trajectory;
